"""A kept HTTP connection that takes little of the processor, which the service is to have.

It knows as much of HTTP as the service's own replies need: a length, or a stream without end.
"""

import asyncio
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ....engine.errors import RideError

FRAMES = "application/vnd.ridetune.frames"
HEAD_END = b"\r\n\r\n"
LENGTH = b"content-length: "


class Unexpected(RideError):
    """The service answered otherwise than it must for anything to be measured."""

    code = "unexpected"


@dataclass(frozen=True, slots=True)
class Reply:
    """Status and body of an answer."""

    status: int
    body: bytes

    @property
    def json(self) -> Any:
        """The body as JSON."""
        return json.loads(self.body)


def request(
    method: str,
    path: str,
    token: str = "",
    body: Mapping[str, Any] | bytes | None = None,
    accept: str = "application/json",
) -> bytes:
    """A request as bytes; it can be sent any number of times."""
    head = [f"{method} {path} HTTP/1.1", "Host: 127.0.0.1", f"Accept: {accept}"]
    if token:
        head.append(f"Authorization: Bearer {token}")
    data = b""
    if body is not None:
        plain = isinstance(body, bytes)
        data = body if plain else json.dumps(body, separators=(",", ":")).encode()
        head.append(f"Content-Type: {'text/csv' if plain else 'application/json'}")
        head.append(f"Content-Length: {len(data)}")
    return "\r\n".join([*head, "", ""]).encode() + data


class Connection:
    """One kept connection; one request after the other."""

    def __init__(self, port: int):
        self._port = port
        self._reader: asyncio.StreamReader | None = None
        self._writer: asyncio.StreamWriter | None = None

    async def ask(self, request: bytes) -> Reply:
        """Send a request and wait for its whole answer."""
        status, head = await self.begin(request)
        assert self._reader is not None
        at = head.lower().find(LENGTH)
        if at < 0:
            return Reply(status, b"")
        length = int(head[at + len(LENGTH) : head.index(b"\r", at)])
        return Reply(status, await self._reader.readexactly(length))

    async def begin(self, request: bytes) -> tuple[int, bytes]:
        """Send a request and wait for status and head of its answer, as of an event stream."""
        if self._reader is None or self._writer is None:
            self._reader, self._writer = await asyncio.open_connection("127.0.0.1", self._port)
        self._writer.write(request)
        head = await self._reader.readuntil(HEAD_END)
        return int(head[9:12]), head

    async def wanted(self, request: bytes, *statuses: int) -> Reply:
        """As `ask`; Unexpected for another status than these (200 if none are named)."""
        reply = await self.ask(request)
        if reply.status not in (statuses or (200,)):
            said = reply.body[:300].decode(errors="replace")
            asked = request.partition(b"\r\n")[0].decode()
            raise Unexpected(f"The service answered {asked} with {reply.status}: {said}.")
        return reply

    def close(self) -> None:
        """Hang up."""
        if self._writer is not None:
            self._writer.close()
        self._reader = self._writer = None
