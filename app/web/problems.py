"""Errors as the web sees them: RFC 9457 problem details, one sentence each, no echo of the input.

An unknown exception stays a loud 500: logged with its traceback, answered without it. A failure of
ours names the request, under which the log has the rest.
"""

import contextlib
import logging
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ...engine.errors import RideError
from .. import logs
from ..errors import InvalidRequest, ServiceError
from ..storage.disk_errors import trouble_of
from .route_template import route_of

log = logging.getLogger(__name__)

MEDIA_TYPE = "application/problem+json"
CODES = {
    400: "bad-request",
    404: "not-found",
    405: "method-not-allowed",
    408: "too-slow",
    413: "too-large",
}


def problem(
    status: int,
    code: str,
    detail: str,
    *,
    field: str | None = None,
    headers: Mapping[str, str] | None = None,
) -> JSONResponse:
    """Reply with problem details."""
    body = {
        "type": "about:blank",
        "title": HTTPStatus(status).phrase,
        "status": status,
        "detail": detail,
        "code": code,
    }
    if field:
        body["field"] = field
    if status >= 500 and (request := logs.known_about().get("request")):
        body["request"] = request
    return JSONResponse(body, status, headers=headers, media_type=MEDIA_TYPE)


def reply_to(error: Exception) -> JSONResponse:
    """Problem details of an error that a person can mend; any other is raised again."""
    match error:
        case ServiceError():
            return problem(
                error.status, error.code, str(error), field=error.field, headers=error.headers
            )
        case RideError():
            return problem(422, error.code, str(error))
        case OSError():
            return _reply_to_disk(error)
        case RequestValidationError():
            return _reply_to_form(error)
        case HTTPException():
            return _reply_to_http(error)
    raise error


def reply_to_errors(app: FastAPI) -> None:
    """Answer every error of every route with problem details."""
    for kind in (RideError, OSError, RequestValidationError, HTTPException):
        app.add_exception_handler(kind, _handler)


async def _handler(_: Request, error: Exception) -> JSONResponse:
    return reply_to(error)


def _reply_to_disk(error: OSError) -> JSONResponse:
    if (trouble := trouble_of(error)) is None:
        raise error
    log.error("%s: %s", trouble, error.strerror)
    return reply_to(trouble)


def _reply_to_form(error: RequestValidationError) -> JSONResponse:
    if isinstance(error.body, bytes):
        return problem(
            415,
            "unsupported-media-type",
            "The body is not sent as JSON; send it with Content-Type: application/json.",
        )
    field, detail = _first_complaint(error)
    return problem(422, InvalidRequest.code, detail, field=field)


def _reply_to_http(error: HTTPException) -> JSONResponse:
    code = CODES.get(error.status_code, "http")
    detail = str(error.detail).rstrip(".") + "."
    if error.status_code == 404:
        detail = "There is nothing at this address; see /api/openapi.json for what there is."
    headers = dict(error.headers or {})
    if error.status_code == 405:
        detail = "This address does not take that method; see /api/openapi.json."
        if headers.get("Allow") == "GET":
            headers["Allow"] = "GET, HEAD"  # see heads.py
    return problem(error.status_code, code, detail, headers=headers)


class Unexpected:
    """ASGI middleware next to the routes: the last resort of an exception, told in the log only."""

    def __init__(self, app: ASGIApp):
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and answer for what goes wrong."""
        begun = False

        async def noted(message: Message) -> None:
            nonlocal begun
            begun = begun or message["type"] == "http.response.start"
            await send(message)

        try:
            await self.app(scope, receive, noted)
        except ClientDisconnect:
            # Half a request: there is nobody to answer, and nothing of ours went wrong.
            pass
        except Exception:
            if scope["type"] == "lifespan":
                raise
            log.exception("unexpected error in %s", route_of(scope))
            if scope["type"] == "websocket":
                await _close_failed(send)
            elif not begun:
                failed = "The service failed here; its log has the details under this request."
                await problem(500, "internal", failed)(scope, receive, send)


async def _close_failed(send: Send) -> None:
    with contextlib.suppress(OSError, RuntimeError):
        await send({"type": "websocket.close", "code": 1011, "reason": "The service failed here."})


def _first_complaint(error: RequestValidationError) -> tuple[str, str]:
    complaints = error.errors()
    first = complaints[0]
    kind, place = first["type"], _place(first, error.body)
    if kind.startswith("union_tag"):
        place.append(first["ctx"]["discriminator"].strip("'"))
    field = ".".join(map(str, place))[:120] or "body"
    more = f" ({len(complaints) - 1} more like this.)" if len(complaints) > 1 else ""
    return field, f"The field {field} {_said(first)}.{more}"


def _place(complaint: Mapping[str, Any], body: Any) -> list[Any]:
    """Keys and indices that lead to what is complained of, without those names of a union's
    members that are not in the request.
    """
    source, *parts = complaint["loc"]
    if source != "body":
        return [source, *parts]
    place, value = [], body
    for part in parts:
        if _holds(value, part):
            place.append(part)
            value = value[part]
    return [*place, parts[-1]] if complaint["type"] == "missing" and parts else place


def _holds(value: Any, part: Any) -> bool:
    """Whether there is such a key or index in a value of the request."""
    if isinstance(value, list):
        return isinstance(part, int) and part < len(value)
    return isinstance(value, Mapping) and part in value


def _said(complaint: Mapping[str, Any]) -> str:
    """What is wrong with a field, as the rest of a sentence about it."""
    match complaint["type"]:
        case "missing" | "union_tag_not_found":
            return "is missing"
        case "extra_forbidden":
            return "is not known here; check its spelling or leave it out"
        case "union_tag_invalid":
            return f"is refused: input should be one of {complaint['ctx']['expected_tags']}"
        case "dict_type" | "mapping_type" | "model_type" | "model_attributes_type":
            return "is refused: input should be an object"
    message = complaint["msg"]
    return f"is refused: {message[:1].lower()}{message[1:200]}"
