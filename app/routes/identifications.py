"""Identifications: background jobs that can be followed and cancelled."""

from typing import Any

from ...engine.vehicle_file import vehicle_from_json, vehicle_to_json
from ..access.sessions import SessionId
from ..errors import InvalidRequest
from ..schemas import IdentificationRequest
from ..storage.measurement import stated
from ..web.services import Services, Shared
from ..work.identification import (
    KIND,
    UNTOLD,
    as_asked,
    filled_in,
)
from .jobs import View, job_router, submitted

ASKED = (
    *("runs", "free", "fixed", "bounds", "start", "noise", "traction", "settings", "braking"),
    *("starts", "seed", "loss", "loss_scale", "priors"),
    *("sensors", "fit_noise"),
)
"""Fields of a request that its job shows, with what held untold filled in; of each run its id, its
name, the noise that was stated of it and what was done to it."""

VIEW = View(
    KIND,
    asked=lambda job: {name: (UNTOLD | job.spec)[name] for name in ASKED},
    result=lambda job: {"vehicle": job.spec["vehicle"], "result": job.result},
)

router = job_router("identifications", VIEW)


@router.post("", status_code=202)
async def submit(sid: SessionId, services: Shared, body: IdentificationRequest) -> dict[str, Any]:
    """Queue an identification; the same `key` again gives the same job."""
    return await submitted(
        services, sid, VIEW, body.key, lambda: as_asked(body), lambda: _spec(services, sid, body)
    )


def _spec(services: Services, sid: str, body: IdentificationRequest) -> dict[str, Any]:
    """Everything that the job needs, checked."""
    kept = [services.store.measurements.get(sid, measurement) for measurement in body.runs]
    vehicle = services.store.sessions.get(sid).vehicle if body.vehicle is None else body.vehicle
    spec = body.model_dump(mode="json", exclude={"key", "runs", "vehicle"})
    spec["vehicle"] = vehicle_to_json(vehicle_from_json(vehicle))
    spec["runs"] = [stated(one) for one in kept]
    if strangers := set(body.braking) - {one.id for one in kept}:
        raise InvalidRequest(
            f"Braking is marked for {min(strangers)}, which is not among the runs; leave it out or "
            "add the run.",
            field="braking",
        )
    return services.in_simulator(sid, filled_in, spec, kept, services.settings.limits)
