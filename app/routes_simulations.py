"""Interactive simulations of a session's car."""

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse, StreamingResponse

from . import frames
from .access import SessionId, user_who_opened
from .errors import InvalidRequest
from .identification_job import KIND as IDENTIFICATION
from .schemas import SimulationRequest
from .services import Services, Shared
from .strict_json import StrictRoute

router = APIRouter(
    prefix="/api/sessions/{sid}/simulations", tags=["simulations"], route_class=StrictRoute
)


def described(forms: Mapping[str, frames.Form]) -> dict[int | str, dict[str, Any]]:
    """How the description of the interface shows a reply in one of the forms."""
    return {
        200: {
            "description": "Head and histories, in the form that the Accept header asks for.",
            "content": {name: {} for name in forms},
        }
    }


@router.post("", responses=described(frames.MEDIA_TYPES), response_class=Response)
async def simulate(
    sid: SessionId, services: Shared, body: SimulationRequest, request: Request
) -> Response:
    """Simulate a manoeuvre, a recording's wheel motion or a rig test."""
    form = frames.form_of(request.headers.get("accept"))
    services.warmup.require()
    user = user_who_opened(request)
    return await services.interactive.run(sid, lambda: _simulated(services, sid, user, body, form))


def _simulated(
    services: Services, sid: str, user: str | None, body: SimulationRequest, form: frames.Form
) -> Response:
    from .simulate import plan, reply

    asked = body.bands
    fitted = None if asked is None else services.jobs.get(sid, asked.identification, IDENTIFICATION)
    if asked is not None and form == "csv":
        raise InvalidRequest("Bands come as JSON or frames; ask for one of them.", field="bands")
    store, limits = services.store, services.settings.limits
    task = plan(body, sid, fitted, store, services.recordings, limits)
    services.callers.simulate(sid, user, task.seconds)
    found = reply(body, task)
    if body.scene and services.viewers is not None:
        services.viewers.show(sid, task.vehicle)
    if form == "csv":
        return csv_reply(found.run)
    taken, *ends = (
        frames.take(run, body.channels, body.max_samples, body.decimate)
        for run in (found.run, *((found.bands.lower, found.bands.upper) if found.bands else ()))
    )
    return frames_reply(found.head, taken.within(*ends) if ends else taken, form)


def frames_reply(head: dict[str, Any], taken: frames.Frames, form: frames.Form) -> Response:
    """Histories as binary or JSON."""
    if form == "binary":
        return Response(frames.to_binary(head, taken), media_type="application/vnd.ridetune.frames")
    return JSONResponse(frames.to_json(head, taken))


def csv_reply(run: Any, headers: Mapping[str, str] | None = None) -> Response:
    """A run as the measurement file it would be, written while it is sent."""
    from ..engine.measurement import csv_blocks

    # A generator that is not asynchronous is gone through in the thread pool.
    return StreamingResponse(csv_blocks(run), headers=headers, media_type="text/csv; charset=utf-8")
