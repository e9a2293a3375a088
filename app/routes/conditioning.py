"""What is done to a measurement before it is used: the steps, what they did, what is suggested."""

from dataclasses import replace
from typing import Any

from fastapi import APIRouter

from ..access.sessions import SessionId
from ..recordings.measurement_view import measurement_to_json
from ..schemas import ConditioningRequest
from ..storage.measurement import Measurement
from ..web.services import Services, Shared
from .strict_json import StrictRoute

router = APIRouter(
    prefix="/api/sessions/{sid}/measurements/{mid}/conditioning",
    tags=["measurements"],
    route_class=StrictRoute,
)


@router.get("")
async def conditioning(sid: SessionId, mid: str, services: Shared) -> dict[str, Any]:
    """The steps in force, what each of them did, and those that the recording calls for."""
    return await services.readers.run(
        sid, lambda: _shown(services, sid, services.store.measurements.get(sid, mid))
    )


@router.put("")
async def set_conditioning(
    sid: SessionId, mid: str, services: Shared, body: ConditioningRequest
) -> dict[str, Any]:
    """Do these steps to the recording; the original stays, and so does what jobs were given."""
    return await services.readers.run(sid, lambda: _condition(services, sid, mid, body))


def _condition(services: Services, sid: str, mid: str, body: ConditioningRequest) -> dict[str, Any]:
    # They bring scipy, which takes long to load.
    from ...engine.conditioning.chain import needs_vehicle, steps_from_json, steps_to_json
    from ...engine.vehicle_file import vehicle_from_json, vehicle_to_json

    kept = services.store.measurements.get(sid, mid)
    steps = steps_from_json(body.steps)
    asked = None
    if steps:
        vehicle = None
        if needs_vehicle(steps):
            told = (
                services.store.sessions.get(sid).vehicle if body.vehicle is None else body.vehicle
            )
            vehicle = vehicle_to_json(vehicle_from_json(told))
        asked = {"steps": steps_to_json(steps), "vehicle": vehicle}
    done = replace(kept, conditioning=asked)
    found = services.recordings.summed_up(done)
    return _shown(
        services, sid, services.store.measurements.set_conditioning(sid, kept.id, asked, found)
    )


def _shown(services: Services, sid: str, kept: Measurement) -> dict[str, Any]:
    from ...engine.conditioning.chain import steps_to_json
    from ...engine.conditioning.kinds import steps_to_add
    from ...engine.conditioning.suggestion import suggest
    from ...engine.known_band import output_highpass
    from ...engine.step_record import step_record_to_json
    from ...engine.vehicle_file import vehicle_from_json

    in_force = kept.conditioning or {"steps": [], "vehicle": None}
    vehicle = vehicle_from_json(services.store.sessions.get(sid).vehicle)
    raw = services.recordings.raw(kept)
    found = suggest(raw, vehicle)
    run = services.recordings.run(kept)
    return {
        "steps": in_force["steps"],
        "vehicle": in_force["vehicle"],
        "record": [step_record_to_json(one) for one in run.conditioning],
        "output_highpass_hz": output_highpass(run),
        "suggestion": {
            "steps": steps_to_json(found.steps),
            "reasons": list(found.reasons),
            "lacks": list(found.lacks),
            "output_highpass_hz": found.output_highpass_hz,
        },
        "kinds": steps_to_add(raw),
        "measurement": measurement_to_json(services.store, sid, kept),
    }
