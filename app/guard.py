"""The outermost layer: who may call, how much may be sent, what every reply says to the browser.

Host must be on the list, or a page elsewhere could reach a local service by a name of its own
(DNS rebinding). A request that changes something, and every websocket, must come from our own
page or from no page at all. Bodies are counted while they arrive.
"""

from collections.abc import Awaitable, Callable
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .problems import problem
from .settings import Settings

PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; frame-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": PAGE_POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
READING = ("GET", "HEAD", "OPTIONS")

# A browser shows a refusal only if its upload was taken to the end: this much more is thrown away.
DRAINED_BODIES = 10
MULTIPART_ENVELOPE = 65_536

SETUP_BYTES = 64_000
"""A change of a set-up, which names some dozens of things."""


class Guard:
    """ASGI middleware around the whole service."""

    def __init__(self, app: ASGIApp, settings: Settings):
        self.app = app
        self.hosts = settings.host_names()
        self.limits = settings.limits

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            if refusal(scope, self.hosts):
                await receive()
                await send({"type": "websocket.close", "code": 1008})
            else:
                await self.app(scope, receive, send)
        else:
            await self._http(scope, receive, _with_headers(send))

    async def _http(self, scope: Scope, receive: Receive, send: Send) -> None:
        if reason := refusal(scope, self.hosts):
            await problem(403, "forbidden", reason)(scope, receive, send)
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
            await _drain(receive, DRAINED_BODIES * limit)
            await problem(413, "too-large", too_large)(scope, receive, send)
            return
        await self.app(scope, _counted(receive, limit, too_large), send)

    def _body_limit(self, scope: Scope) -> int:
        if scope["method"] == "POST" and scope["path"].endswith("/measurements"):
            return self.limits.upload_bytes + MULTIPART_ENVELOPE
        if scope["method"] == "PATCH" and scope["path"].endswith("/setup"):
            return min(SETUP_BYTES, self.limits.body_bytes)
        return self.limits.body_bytes


def refusal(scope: Scope, hosts: frozenset[str]) -> str | None:
    """Why a request may not come in, or None."""
    headers = Headers(scope=scope)
    # Of two it is not known which one is meant.
    host = ",".join(headers.getlist("host")).lower()
    if _without_port(host) not in hosts:
        return (
            "This service does not answer to that host name; use its own address, or add the name "
            "to RIDETUNE_ALLOWED_HOSTS."
        )
    if scope["type"] == "http" and scope["method"] in READING:
        return None
    origin = headers.get("origin")
    foreign = origin is not None and urlsplit(origin.lower()).netloc != host
    if foreign or headers.get("sec-fetch-site") in ("cross-site", "same-site"):
        return "Requests from pages of another origin are refused; use the service's own page."
    return None


def _without_port(host: str) -> str:
    name, colon, port = host.rpartition(":")
    return name if colon and port.isdigit() else host


def _announced(scope: Scope) -> int:
    length = Headers(scope=scope).get("content-length", "")
    return int(length) if length.isdecimal() and len(length) < 20 else 0


async def _drain(receive: Receive, limit: int) -> None:
    taken = 0
    while taken <= limit:
        message = await receive()
        taken += len(message.get("body", b""))
        if message["type"] != "http.request" or not message.get("more_body", False):
            return


def _counted(receive: Receive, limit: int, too_large: str) -> Receive:
    taken = 0

    async def counted() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        if taken > limit:
            raise HTTPException(413, too_large)
        return message

    return counted


def _with_headers(send: Send) -> Callable[[Message], Awaitable[None]]:
    async def with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return with_headers
