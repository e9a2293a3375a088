"""Advice on what to drive next, given at once."""

from typing import Any

from fastapi import APIRouter

from .access import SessionId
from .identification_job import KIND as IDENTIFICATION
from .schemas import AdviceRequest
from .services import Services, Shared
from .strict_json import StrictRoute

router = APIRouter(prefix="/api/sessions/{sid}/advice", tags=["advice"], route_class=StrictRoute)


@router.post("")
async def advise(sid: SessionId, services: Shared, body: AdviceRequest) -> dict[str, Any]:
    """Rank manoeuvres by what they would do to the weakest parameters."""
    services.warmup.require()
    return await services.interactive.run(sid, lambda: _advice(services, sid, body))


def _advice(services: Services, sid: str, body: AdviceRequest) -> dict[str, Any]:
    from .advice import advice

    asked = body.identification
    fitted = None if asked is None else services.jobs.get(sid, asked, IDENTIFICATION)
    store, limits = services.store, services.settings.limits
    return advice(body, sid, fitted, store, services.recordings, limits)
