"""Request bodies as I-JSON (RFC 7493) means them: no NaN, no infinity, no key twice, nothing too
deep to walk; read only of who may send them.

Python's reader is more generous than the standard, and what it lets in (NaN, 1e999) cannot be
written back, so a reply that mentions it would fail.
"""

import json
import math
import re
from collections.abc import Callable, Coroutine
from typing import Any, NoReturn

from fastapi import HTTPException, Request, Response
from fastapi.routing import APIRoute
from starlette.concurrency import run_in_threadpool

from ..access.sessions import opened_session, require_visitor

DEEPEST = 40
LONGEST_INTEGER = 30
MOST_KEYS = 1000
"""Of one object; no form has so many, and each unknown one would be complained of for itself."""
AT_ONCE = 65_536
"""Bytes that are read on the event loop; 4 MB would keep everybody waiting for most of a second."""


class StrictRoute(APIRoute):
    """A route that reads its JSON body strictly."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Wrap the handler so that it sees a strict request."""
        handler = super().get_route_handler()

        async def strict(request: Request) -> Response:
            request = StrictRequest(request.scope, request.receive)
            if self.body_field is not None:
                # FastAPI reads a body before it asks who sends it, and a large one takes long.
                await _require_owner(request)
                if self.body_field.field_info.is_required() and not await request.body():
                    raise HTTPException(400, "The body is empty; send JSON.")
            return await handler(request)

        return strict


async def _require_owner(request: Request) -> None:
    """Refuse whose body need not be read."""
    sid = request.path_params.get("sid")
    if sid is None:
        await require_visitor(request)
    else:
        await opened_session(request, sid)


class StrictRequest(Request):
    """A request whose `json` refuses what I-JSON does not have."""

    async def json(self) -> Any:
        """Parsed body; HTTP 400 with a sentence for one that cannot be read."""
        body = await self.body()
        if len(body) <= AT_ONCE:
            return read(body)
        return await run_in_threadpool(read, body)


def read(body: bytes) -> Any:
    """Value of a body; HTTP 400 with a sentence for one that cannot be read."""
    try:
        return loads(body)
    except json.JSONDecodeError as error:
        raise HTTPException(400, _not_json(error)) from None
    except RecursionError:
        raise HTTPException(400, _TOO_DEEP) from None
    except ValueError as error:
        raise HTTPException(400, str(error)) from None


def loads(body: bytes) -> Any:
    """Value of a JSON text in UTF-8; ValueError with a sentence for what I-JSON does not have."""
    try:
        text = body.decode("utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"The body is not UTF-8 at byte {error.start}; send UTF-8.") from None
    value = json.loads(
        text,
        parse_constant=_no_constant,
        parse_float=_finite,
        parse_int=_short_integer,
        object_pairs_hook=_object,
    )
    _check_depth(value)
    if _SURROGATE.search(text):
        _check_characters(value)
    return value


_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")
_TOO_DEEP = f"The body is nested deeper than {DEEPEST} levels; send a flatter one."


def _not_json(error: json.JSONDecodeError) -> str:
    return f"The body is not JSON: {error.msg} at character {error.pos}; correct it there."


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"The body holds {name}, which JSON does not have; send a finite number.")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError("The body holds a number beyond 1.8e308; send a finite number.")
    return number


def _short_integer(text: str) -> int:
    if len(text) > LONGEST_INTEGER:
        raise ValueError(f"The body holds an integer of {len(text)} digits; send a shorter one.")
    return int(text)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(pairs) > MOST_KEYS:
        raise ValueError(
            f"The body holds an object of {len(pairs)} keys; send one of at most {MOST_KEYS}."
        )
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("The body holds an object with the same key twice; keep one of them.")
    return found


def _check_depth(value: Any) -> None:
    layer = [value]
    for _ in range(DEEPEST):
        layer = [
            child
            for parent in layer
            if isinstance(parent, dict | list)
            for child in (parent.values() if isinstance(parent, dict) else parent)
        ]
        if not layer:
            return
    raise ValueError(_TOO_DEEP)


def _check_characters(value: Any) -> None:
    try:
        json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        raise ValueError("The body holds half a character (a lone surrogate).") from None
