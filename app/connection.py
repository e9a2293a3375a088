"""uvicorn's connections, with limits that they lack: they would take a request's head of any length
and wait for it for ever, and for a peer that does not read; and what is too much would be refused
without a word.
"""

from asyncio import TimerHandle, Transport
from typing import Any

from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from .draining import PROBES
from .limits import Limits
from .problems import problem

RETRY_AFTER = 5

HEAD_BYTES = 65_536
"""Of a request before its body, but for what comes in one piece with its end."""


class _Reading:
    """A connection whose peer must read what it asked for."""

    limits: Limits
    transport: Transport
    loop: Any
    _stalled: TimerHandle | None = None

    def pause_writing(self) -> None:
        """Much waits to be read."""
        super().pause_writing()  # pyright: ignore[reportAttributeAccessIssue]
        self._stalled = self.loop.call_later(self.limits.stalled_seconds, self.transport.abort)

    def resume_writing(self) -> None:
        """It was read."""
        super().resume_writing()  # pyright: ignore[reportAttributeAccessIssue]
        self._no_longer_stalled()

    def connection_lost(self, exc: Exception | None) -> None:
        """The end."""
        self._no_longer_stalled()
        super().connection_lost(exc)  # pyright: ignore[reportAttributeAccessIssue]

    def _no_longer_stalled(self) -> None:
        if self._stalled is not None:
            self._stalled.cancel()
            self._stalled = None


class Connection(_Reading, HttpToolsProtocol):
    """HTTP/1.1."""

    _head: TimerHandle | None = None
    _head_bytes = 0
    _surplus = False

    def connection_made(self, transport: Transport) -> None:
        """A peer has connected."""
        super().connection_made(transport)
        if len(self.connections) > 2 * self.limits.connections:
            transport.abort()
        elif len(self.connections) > self.limits.connections:
            self._surplus = True
            self.app = _no_room_for_more(self.app)
        self._await_head()

    def data_received(self, data: bytes) -> None:
        """Part of a request; its head must be whole before long."""
        super().data_received(data)
        if self._busy():
            self._head_came()
        elif self.transport.get_protocol() is self:
            self._head_bytes += len(data)
            if self._head_bytes > HEAD_BYTES:
                self.transport.close()
            elif self._head is None:
                self._await_head()

    def handle_websocket_upgrade(self) -> None:
        """The connection goes on as another."""
        self._head_came()
        if self._surplus:
            self.transport.close()
        else:
            super().handle_websocket_upgrade()

    def connection_lost(self, exc: Exception | None) -> None:
        """The end."""
        self._head_came()
        super().connection_lost(exc)

    def _busy(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _await_head(self) -> None:
        self._head = self.loop.call_later(self.limits.head_seconds, self._give_up)

    def _head_came(self) -> None:
        self._head_bytes = 0
        if self._head is not None:
            self._head.cancel()
            self._head = None

    def _give_up(self) -> None:
        self._head = None
        if not self._busy():
            self.transport.close()


class Socket(_Reading, WebSocketsSansIOProtocol):
    """A websocket."""


def connections(limits: Limits) -> tuple[type[Connection], type[Socket]]:
    """The protocols of a service with these limits."""
    known = {"limits": limits}
    return type("Connection", (Connection,), known), type("Socket", (Socket,), known)


def _no_room_for_more(app: ASGIApp) -> ASGIApp:
    async def refuse(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["path"] in PROBES:
            await app(scope, receive, send)
            return
        headers = {"Retry-After": str(RETRY_AFTER), "Connection": "close"}
        sentence = "The service has as many connections as it takes; try again in a moment."
        await problem(503, "unavailable", sentence, headers=headers)(scope, receive, send)

    return refuse
