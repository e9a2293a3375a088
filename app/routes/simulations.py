"""Interactive simulations of a session's car."""

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import StreamingResponse

from .. import frames
from ..access.sessions import SessionId, user_who_opened
from ..schemas import SimulationRequest
from ..web.services import Services, Shared
from ..work.excitation_mode import mode_of, recording_of
from ..work.identification import KIND as IDENTIFICATION
from ..work.identification import done
from ..work.interactive import simulated
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
    """Simulate a manoeuvre, a recording's wheel motion or a rig test. A websocket at the same
    address takes such bodies as messages, and of those that wait the newest alone.
    """
    form = frames.form_of(request.headers.get("accept"))
    user = user_who_opened(request)
    found = await services.interactive.run(sid, lambda: content_of(services, sid, user, body, form))
    if isinstance(found, bytes):
        return Response(found, media_type=frames.MEDIA_TYPE_OF[form])
    return csv_reply(found)


def content_of(
    services: Services, sid: str, user: str | None, body: SimulationRequest, form: frames.Form
) -> Any:
    """What a request's simulation finds: bytes, for CSV the run; on a thread of the pool for
    interactive work.
    """
    mode_of(body)
    fit = None
    if body.bands is not None:
        fit = done(services.jobs.get(sid, body.bands.identification, IDENTIFICATION))
    store = services.store
    found, shown = services.in_simulator(
        sid,
        simulated,
        body,
        form,
        store.sessions.get(sid).vehicle if body.vehicle is None else body.vehicle,
        recording_of(body, sid, store),
        fit,
        services.settings.limits,
        charge=services.callers.simulating(sid, user),
    )
    if shown is not None:
        services.viewers.show(sid, shown)
    return found


def frames_reply(head: dict[str, Any], taken: frames.Frames, form: frames.Form) -> Response:
    """Histories as binary or JSON."""
    return Response(frames.written(head, taken, form), media_type=frames.MEDIA_TYPE_OF[form])


def csv_reply(run: Any, headers: Mapping[str, str] | None = None) -> Response:
    """A run as the measurement file it would be, written while it is sent."""
    from ...engine.measurement import csv_blocks

    # A generator that is not asynchronous is gone through in the thread pool.
    return StreamingResponse(csv_blocks(run), headers=headers, media_type="text/csv; charset=utf-8")
