"""Simulations over a websocket, as of a slider that is being moved: of the requests that wait for
their turn only the newest is run, so that what comes back is what was asked for last.

A message holds what the body of `POST .../simulations` does. The answer is its binary reply, or, as
text, the problem with the request's `seq`. They come in the order of the requests.
"""

import asyncio
import json
import threading
from contextlib import suppress
from typing import Any

from fastapi import APIRouter
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.websockets import WebSocket

from ...engine.errors import RideError
from ..access.login import user_of
from ..access.sockets import accept, hanging_up, let_in, messages, while_theirs
from ..limits import Limits
from ..schemas import SimulationRequest
from ..web.problems import reply_to
from ..web.services import Services, services_of
from .simulations import content_of
from .strict_json import read

router = APIRouter()

FORM = "binary"


class _Newest:
    """The request that came last, until it is taken."""

    def __init__(self):
        self._request: str | bytes | None = None
        self._lock = threading.Lock()
        self._here = asyncio.Event()

    def put(self, request: str | bytes) -> None:
        """Have a request in the place of the one that waits."""
        with self._lock:
            self._request = request
        self._here.set()

    async def wait(self) -> None:
        """Until there is one."""
        while self._request is None:
            self._here.clear()
            await self._here.wait()

    def take(self) -> str | bytes:
        """The one that is there; from any thread."""
        with self._lock:
            taken, self._request = self._request, None
        assert taken is not None
        return taken


@router.websocket("/api/sessions/{sid}/simulations")
async def stream(websocket: WebSocket, sid: str) -> None:
    services = services_of(websocket)
    async with hanging_up(websocket):
        await let_in(websocket, sid)
        user = await run_in_threadpool(user_of, websocket)
        with services.simulation_streams.one_more(sid):
            await accept(websocket)
            newest = _Newest()
            await while_theirs(
                websocket,
                sid,
                _heard(websocket, newest, services.settings.limits),
                _answered(websocket, newest, services, sid, user),
            )


async def _heard(websocket: WebSocket, newest: _Newest, limits: Limits) -> None:
    async for message in messages(websocket, limits):
        newest.put(message)


async def _answered(
    websocket: WebSocket, newest: _Newest, services: Services, sid: str, user: str | None
) -> None:
    while True:
        await newest.wait()
        taken: list[str | bytes] = []

        def work(taken: list[str | bytes] = taken) -> bytes:
            taken.append(newest.take())
            return content_of(services, sid, user, _request(taken[0]), FORM)

        try:
            reply = await services.interactive.run(sid, work)
        except (RideError, OSError, RequestValidationError, HTTPException) as error:
            # Where too much waits, it is refused before its turn.
            refused = taken[0] if taken else newest.take()
            # To read a message once more may take long.
            await websocket.send_text(await run_in_threadpool(_told, error, refused))
        else:
            await websocket.send_bytes(reply)


def _request(message: str | bytes) -> SimulationRequest:
    value = _value(message)
    try:
        return SimulationRequest.model_validate(value)
    except ValidationError as error:
        complaints = [{**one, "loc": ("body", *one["loc"])} for one in error.errors()]
        raise RequestValidationError(complaints, body=value) from None


def _value(message: str | bytes) -> Any:
    return read(message.encode() if isinstance(message, str) else message)


def _told(error: Exception, message: str | bytes) -> str:
    reply = reply_to(error)
    problem = json.loads(bytes(reply.body))
    if (wait := reply.headers.get("Retry-After")) is not None:
        problem["retry_after"] = int(wait)
    with suppress(HTTPException):
        value = _value(message)
        problem["seq"] = value.get("seq") if isinstance(value, dict) else None
    return json.dumps(problem)
