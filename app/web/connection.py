"""uvicorn's connections, with limits that they lack: they would take a request's head of any length
and wait for it for ever, and for a peer that does not read; and what is too much would be refused
without a word.
"""

from asyncio import TimerHandle, Transport
from typing import Any

from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from ..addresses import Network, is_in, is_loopback, site
from ..limits import Limits
from .draining import PROBES
from .problems import problem

RETRY_AFTER = 5
ALL = f"The service has as many connections as it takes; try again in {RETRY_AFTER} s."
PEERS = (
    "The service has as many connections from where you are as it takes; close some, or try again "
    f"in {RETRY_AFTER} s."
)

HEAD_BYTES = 65_536
"""Of a request before its body, but for what comes in one piece with its end."""


class _Reading:
    """A connection whose peer must read what it asked for."""

    limits: Limits
    proxies: tuple[Network, ...]
    transport: Transport
    loop: Any
    client: tuple[str, int] | None
    peer = ""
    """From where it comes; nothing of what many come through, a proxy or this machine."""
    _stalled: TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """A peer has connected."""
        super().connection_made(transport)  # pyright: ignore[reportAttributeAccessIssue]
        host = self.client[0] if self.client else ""
        if not (is_loopback(host) or is_in(host, self.proxies)):
            self.peer = site(host)

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
        open, most = len(self.connections), self.limits.connections
        theirs, most_of_theirs = self._of_peer(), self.limits.peer_connections
        if open > 2 * most or theirs > 2 * most_of_theirs:
            transport.abort()
        elif open > most or theirs > most_of_theirs:
            self._surplus = True
            self.app = _no_room_for_more(self.app, PEERS if open <= most else ALL)
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

    def _of_peer(self) -> int:
        if not self.peer:
            return 0
        return sum(one.peer == self.peer for one in self.connections)  # pyright: ignore[reportAttributeAccessIssue]

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


def connections(
    limits: Limits, proxies: tuple[Network, ...] = ()
) -> tuple[type[Connection], type[Socket]]:
    """The protocols of a service with these limits behind these proxies."""
    known = {"limits": limits, "proxies": proxies}
    return type("Connection", (Connection,), known), type("Socket", (Socket,), known)


def _no_room_for_more(app: ASGIApp, sentence: str) -> ASGIApp:
    async def refuse(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["path"] in PROBES:
            await app(scope, receive, send)
            return
        headers = {"Retry-After": str(RETRY_AFTER), "Connection": "close"}
        await problem(503, "unavailable", sentence, headers=headers)(scope, receive, send)

    return refuse
