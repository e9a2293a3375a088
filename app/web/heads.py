"""HEAD wherever GET is answered: the same head, and no body.

The routes see a GET that comes for its head alone; what would go on after it, as an event stream or
a download does, is stopped there.
"""

import anyio
from anyio.lowlevel import checkpoint
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_ALONE = "ridetune.head_alone"


def wants_head_alone(connection: HTTPConnection) -> bool:
    """Whether the GET is a HEAD, after which nothing may be other than before it."""
    return connection.scope.get(_ALONE, False)


class Heads:
    """ASGI middleware next to the routes."""

    def __init__(self, app: ASGIApp):
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, a HEAD as a GET whose body goes nowhere."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return
        with anyio.CancelScope() as asked:

            async def send_head(message: Message) -> None:
                if message["type"] == "http.response.start":
                    await send(message)
                    await send({"type": "http.response.body", "body": b""})
                    asked.cancel()
                elif message.get("more_body", False):
                    await checkpoint()  # where the cancellation arrives

            # Parts of a body are for GET alone (RFC 9110, 14.2).
            headers = [pair for pair in scope["headers"] if pair[0] != b"range"]
            inner = {**scope, "method": "GET", "headers": headers, _ALONE: True}
            try:
                await self.app(inner, receive, send_head)
            finally:
                if "route" in inner:  # for the log and the metrics
                    scope["route"] = inner["route"]
