"""Profiles of a fit's parameters: background jobs, one a parameter."""

from typing import Any

from ..access.sessions import SessionId
from ..jobs.kinds import as_asked
from ..schemas import ProfileRequest
from ..web.services import Services, Shared
from ..work.identification import KIND as IDENTIFICATION
from ..work.profile import KIND, check_and_fill
from .jobs import View, job_router, submitted

VIEW = View(
    KIND,
    asked=lambda job: {name: job.spec[name] for name in ("identification", "parameter")},
    result=lambda job: {"result": job.result},
)

router = job_router("profiles", VIEW)


@router.post("", status_code=202)
async def submit(sid: SessionId, services: Shared, body: ProfileRequest) -> dict[str, Any]:
    """Queue the profile of a parameter of an identification that is done."""
    return await submitted(
        services, sid, VIEW, body.key, lambda: as_asked(body), lambda: _spec(services, sid, body)
    )


def _spec(services: Services, sid: str, body: ProfileRequest) -> dict[str, Any]:
    fitted = services.jobs.get(sid, body.identification, IDENTIFICATION)
    return check_and_fill(body, fitted, services.store)
