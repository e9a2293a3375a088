"""An upload on its way in: a form's file or the bare body, to the bytes and a harmless name."""

import re
from collections.abc import AsyncIterator, Callable
from tempfile import SpooledTemporaryFile
from typing import Any, BinaryIO, cast

from fastapi import HTTPException, Request
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile

from ..errors import InvalidRequest, TooLarge

LONGEST_NAME = 100
IN_MEMORY = 1_000_000


def openapi(*media_types: str) -> dict[str, Any]:
    """How the description of the interface shows a request with one file."""
    file = {"type": "string", "format": "binary"}
    form = {"type": "object", "required": ["file"], "properties": {"file": file}}
    bare = dict.fromkeys(media_types, {"schema": file})
    content = {"multipart/form-data": {"schema": form}, **bare}
    return {"requestBody": {"required": True, "content": content}}


class Upload:
    """A file that has arrived whole: its name and where to read it."""

    def __init__(self, name: str, file: BinaryIO):
        self.name = name
        self._file = file

    def read(self, limit: int) -> bytes:
        """All bytes; TooLarge beyond the limit."""
        self._file.seek(0)
        data = self._file.read(limit + 1)
        if len(data) > limit:
            raise TooLarge(
                f"{self.name}: the file is over the limit of {limit / 1e6:g} MB; cut it into "
                "shorter recordings or sample it less often."
            )
        return data


def receive(untold: str) -> Callable[..., AsyncIterator[Upload]]:
    """The dependency that takes the one file of a request, called `untold` unless it has a name."""

    async def received(request: Request, name: str = "") -> AsyncIterator[Upload]:
        # The counting of its bytes is the guard's.
        if request.headers.get("content-type", "").lower().startswith("multipart/form-data"):
            async with request.form(max_files=1, max_fields=5) as form:
                file = form.get("file")
                if not isinstance(file, UploadFile):
                    raise InvalidRequest(
                        'The form has no file; send it in a part called "file".', field="file"
                    )
                yield Upload(harmless(name or file.filename or "") or untold, file.file)
            return
        with SpooledTemporaryFile(max_size=IN_MEMORY) as file:
            async for chunk in request.stream():
                await run_in_threadpool(file.write, chunk)
            if not file.tell():
                raise HTTPException(400, "The body is empty; send the file.")
            yield Upload(harmless(name) or untold, cast(BinaryIO, file))

    return received


def harmless(name: str) -> str:
    """The last part of a path, without control characters, of bounded length; perhaps nothing."""
    last = re.split(r"[/\\]", name)[-1]
    plain = re.sub(r"[\x00-\x1f\x7f-\x9f\ud800-\udfff]", "", last).strip(" .")
    return plain[-LONGEST_NAME:]
