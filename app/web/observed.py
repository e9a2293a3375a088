"""The outermost layer: every request has an id, is counted, and is told in the log.

The id is the caller's where it is well formed, goes back with the reply, and stands in every record
that the request causes. Addresses are told as their templates and without their query, which may
hold a token.
"""

import logging
import re
import secrets
import time
from collections.abc import Callable

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .. import logs
from .metrics import Metrics
from .route_template import route_of

access = logging.getLogger("ridetune.access")

REQUEST_ID = "X-Request-Id"
_RAW_NAME = REQUEST_ID.lower().encode()
_WELL_FORMED = re.compile(r"[A-Za-z0-9._-]{8,64}")
_SESSION = re.compile(r"/(?:api/sessions|s)/([0-9a-f]{16})(?:/|$)")
METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
CLOSED_BY_CALLER = 499


class Observed:
    """ASGI middleware around all others."""

    def __init__(
        self, app: ASGIApp, metrics: Metrics, clock: Callable[[], float] = time.perf_counter
    ):
        self.app, self.metrics, self.clock = app, metrics, clock

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on under its id."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        known = {"request": _request_id(Headers(scope=scope))}
        if found := _SESSION.match(scope["path"]):
            known["session"] = found[1]
        with logs.about(**known):
            if scope["type"] == "websocket":
                await self._websocket(scope, receive, send)
            else:
                await self._http(scope, receive, send, known["request"])

    async def _http(self, scope: Scope, receive: Receive, send: Send, request: str) -> None:
        began = self.clock()
        status, received, sent = CLOSED_BY_CALLER, 0, 0

        async def heard() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            return message

        async def told(message: Message) -> None:
            nonlocal status, sent
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*message["headers"], (_RAW_NAME, request.encode())]
            else:
                sent += len(message.get("body", b""))
            await send(message)

        try:
            await self.app(scope, heard, told)
        finally:
            method = scope["method"] if scope["method"] in METHODS else "other"
            route, seconds = route_of(scope), self.clock() - began
            self.metrics.requested(method, route, status, seconds, received, sent)
            _tell(method, route, status, seconds, sent)

    async def _websocket(self, scope: Scope, receive: Receive, send: Send) -> None:
        began = self.clock()
        code, sent = 1006, 0

        async def told(message: Message) -> None:
            nonlocal code, sent
            if message["type"] == "websocket.close":
                code = message.get("code", 1000)
            sent += len(message.get("bytes") or b"")
            await send(message)

        async def heard() -> Message:
            nonlocal code
            message = await receive()
            if message["type"] == "websocket.disconnect":
                code = message.get("code", 1005)
            return message

        self.metrics.websockets.inc()
        try:
            await self.app(scope, heard, told)
        finally:
            self.metrics.websockets.dec()
            self.metrics.hung_up(code)
            _tell("WEBSOCKET", route_of(scope), code, self.clock() - began, sent)


def _request_id(headers: Headers) -> str:
    stated = headers.get(REQUEST_ID, "")
    return stated if _WELL_FORMED.fullmatch(stated) else secrets.token_hex(8)


def _tell(method: str, route: str, status: int, seconds: float, sent: int) -> None:
    if access.isEnabledFor(logging.INFO):
        milliseconds = round(1e3 * seconds, 1)
        fields = {
            "method": method,
            "route": route,
            "status": status,
            "milliseconds": milliseconds,
            "bytes": sent,
        }
        access.info(
            "%s %s %d %.1f ms %d B",
            method,
            route,
            status,
            milliseconds,
            sent,
            extra={"fields": fields},
        )
