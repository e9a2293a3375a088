"""Advice on what to drive next, given at once."""

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter

from ..access.sessions import SessionId
from ..schemas import AdviceRequest
from ..web.services import Services, Shared
from ..work.identification import KIND as IDENTIFICATION
from ..work.identification import fitted_recordings
from ..work.interactive import advised
from .strict_json import StrictRoute

router = APIRouter(prefix="/api/sessions/{sid}/advice", tags=["advice"], route_class=StrictRoute)


@router.post("")
async def advise(sid: SessionId, services: Shared, body: AdviceRequest) -> Mapping[str, Any]:
    """Rank manoeuvres by what they would do to the weakest parameters."""
    return await services.interactive.run(sid, lambda: _advice(services, sid, body))


def _advice(services: Services, sid: str, body: AdviceRequest) -> Mapping[str, Any]:
    store, asked = services.store, body.identification
    fitted = None if asked is None else services.jobs.get(sid, asked, IDENTIFICATION)
    return services.in_simulator(
        sid,
        advised,
        body,
        store.sessions.get(sid).vehicle if body.vehicle is None else body.vehicle,
        fitted,
        [] if fitted is None else fitted_recordings(fitted, store),
        services.settings.limits,
    )
