"""The outermost layer: who may call, how much may be sent, what every reply says to the browser.

Host, page (origins.py) and proxy (proxy_login.py) are looked at first. Bodies are counted, and
timed, while they arrive.
"""

from collections.abc import Awaitable, Callable
from contextlib import suppress

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..settings import Settings
from ..web.bodies import Body
from ..web.problems import problem
from . import origins, proxy_login

PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; frame-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_SAID = {
    "Content-Security-Policy": PAGE_POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Permissions-Policy": "camera=(), display-capture=(), geolocation=(), microphone=(), usb=()",
    "Cache-Control": "no-cache",
}
HEADERS = [(name.lower().encode(), value.encode()) for name, value in _SAID.items()]

# A browser shows a refusal only if its upload was taken to the end: this much more is thrown away.
DRAINED_BODIES = 10
MULTIPART_ENVELOPE = 65_536

SETUP_BYTES = 64_000
"""A change of a set-up, which names some dozens of things."""


class Guard:
    """ASGI middleware around the whole service."""

    def __init__(self, app: ASGIApp, settings: Settings):
        self.app = app
        self.settings = settings
        self.hosts = settings.host_names()
        self.limits = settings.limits

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            if self._refusal(scope):
                await receive()
                await send({"type": "websocket.close", "code": 1008})
            else:
                await self.app(scope, receive, send)
        else:
            await self._http(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope) -> str | None:
        return origins.refusal(scope, self.hosts, self.settings.public_url) or proxy_login.refusal(
            scope, self.settings
        )

    async def _http(self, scope: Scope, receive: Receive, send: Send) -> None:
        if reason := self._refusal(scope):
            await problem(403, "forbidden", reason)(scope, receive, send)
            return
        if "\0" in scope["path"]:  # which a database may refuse to look for
            await problem(404, "not-found", "No address has a NUL.")(scope, receive, send)
            return
        if Headers(scope=scope).get("content-encoding", "identity").lower() != "identity":
            # A kilobyte might become a gigabyte.
            packed = "The body is packed, as its Content-Encoding says; send it as it is."
            accepted = {"Accept-Encoding": "identity"}
            reply = problem(415, "unsupported-media-type", packed, headers=accepted)
            await reply(scope, receive, send)
            return
        limit = self._body_limit(scope)
        too_large = (
            f"The body is over the limit of {limit / 1e6:.3g} MB; send a smaller one, "
            "a measurement in several files, a set-up part by part."
        )
        if _announced(scope) > limit:
            thrown_away = Body(receive, DRAINED_BODIES * limit, too_large, self.limits)
            with suppress(HTTPException):
                while (await thrown_away.receive()).get("more_body", False):
                    pass
            await problem(413, "too-large", too_large)(scope, receive, send)
            return
        await self.app(scope, Body(receive, limit, too_large, self.limits).receive, send)

    def _body_limit(self, scope: Scope) -> int:
        if scope["method"] == "POST" and scope["path"].endswith("/measurements"):
            return self.limits.upload_bytes + MULTIPART_ENVELOPE
        if scope["method"] == "PATCH" and scope["path"].endswith("/setup"):
            return min(SETUP_BYTES, self.limits.body_bytes)
        return self.limits.body_bytes


def _announced(scope: Scope) -> int:
    length = Headers(scope=scope).get("content-length", "")
    return int(length) if length.isdecimal() and len(length) < 20 else 0


def _with_headers(send: Send) -> Callable[[Message], Awaitable[None]]:
    async def with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            told = {name for name, _ in message["headers"]}
            untold = [header for header in HEADERS if header[0] not in told]
            message["headers"] = [*message["headers"], *untold]
        await send(message)

    return with_headers
