"""How the service ends in good order: what is under way is let finish, nothing new is taken.

Once it is told to end, `/readyz` says so, new requests are refused with the time after which to try
again, event streams and websockets are closed so that the page connects anew, and no job is
started. The listener stays open meanwhile: a balancer before several services sees it coming.
"""

import asyncio
import contextlib

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .problems import problem

GOING = "The service is about to end or to start anew; try again in a moment."
RETRY_AFTER = 3
PROBES = ("/healthz", "/readyz", "/metrics")
SERVICE_RESTART = 1012
"""The close code after which a websocket's client connects again (RFC 6455's registry)."""


class Draining:
    """Whether the service is about to end, and how much is still under way; for the event loop."""

    def __init__(self):
        self._begun = asyncio.Event()
        self.under_way = 0
        """Requests and websockets, probes apart."""

    @property
    def begun(self) -> bool:
        """Whether it was told to end; may be asked from any thread."""
        return self._begun.is_set()

    def begin(self) -> None:
        """Take nothing more."""
        self._begun.set()

    async def wait(self) -> None:
        """Until it is told to end."""
        await self._begun.wait()


class Drain:
    """ASGI middleware: counts what is under way, refuses what is new, ends what has no end."""

    def __init__(self, app: ASGIApp, draining: Draining):
        self.app = app
        self.draining = draining

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on while the service goes on."""
        if scope["type"] == "lifespan" or scope["path"] in PROBES:
            await self.app(scope, receive, send)
        elif self.draining.begun:
            await _refuse(scope, receive, send)
        else:
            ways = _Ways(scope, receive, send, self.draining)
            self.draining.under_way += 1
            try:
                await self.app(scope, ways.receive, ways.send)
                await ways.end()
            except asyncio.CancelledError:
                # Its grace is over; what has begun to answer cannot be told.
                if ways.answered or not self.draining.begun:
                    raise
                await _refuse(scope, receive, send)
            finally:
                self.draining.under_way -= 1
                ways.close()


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": SERVICE_RESTART, "reason": GOING})
    else:
        headers = {"Retry-After": str(RETRY_AFTER), "Connection": "close"}
        await problem(503, "draining", GOING, headers=headers)(scope, receive, send)


class _Ways:
    """What one request receives and sends. To an event stream and to a websocket, which have no end
    of their own, the service's looks as if the caller hung up; the caller is told in good form.
    """

    def __init__(self, scope: Scope, receive: Receive, send: Send, draining: Draining):
        self._receive, self._send, self._draining = receive, send, draining
        self._socket = self._endless = scope["type"] == "websocket"
        self._whole = self._open = self._cut = self.answered = False
        self._news: asyncio.Future[Message] | None = None

    async def receive(self) -> Message:
        """The next message, or that it is over."""
        if not (self._socket or self._whole):
            message = await self._receive()
            self._whole = not message.get("more_body", False)
            return message
        if self._news is None:
            self._news = asyncio.ensure_future(self._receive())
        news, end = self._news, asyncio.ensure_future(self._draining.wait())
        try:
            await asyncio.wait((news, end), return_when=asyncio.FIRST_COMPLETED)
        finally:
            end.cancel()
        if self._endless and not news.done():
            self._cut = True
            kind = "websocket" if self._socket else "http"
            return {"type": f"{kind}.disconnect", "code": SERVICE_RESTART}
        message = await asyncio.shield(news)
        self._news = None
        return message

    async def send(self, message: Message) -> None:
        """Pass a message on."""
        if message["type"] == "http.response.start":
            kind = Headers(raw=message["headers"]).get("content-type", "")
            self._endless = kind.startswith("text/event-stream")
        self.answered = True
        self._open = message["type"] != "websocket.close" and message.get("more_body", True)
        await self._send(message)

    async def end(self) -> None:
        """Tell the caller that it was cut off."""
        if self._cut and self._open and self._socket:
            with contextlib.suppress(OSError):
                await self._send(
                    {"type": "websocket.close", "code": SERVICE_RESTART, "reason": GOING}
                )
        elif self._cut and self._open:
            await self._send({"type": "http.response.body", "body": b""})

    def close(self) -> None:
        """Wait for nothing more."""
        if self._news is not None:
            self._news.cancel()
