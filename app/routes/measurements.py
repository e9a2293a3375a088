"""Measurements: upload, list, look at, take back byte for byte, delete."""

from dataclasses import replace
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import FileResponse, StreamingResponse
from starlette.concurrency import run_in_threadpool

from ...engine.channels import OUTPUT_CHANNELS
from ...engine.errors import ManoeuvreError, MeasurementError
from ...engine.json_text import parse_json
from ...engine.run_notes import notes_of, parse_notes
from ...engine.step_record import step_record_to_json
from .. import frames
from ..access.sessions import SessionId
from ..recordings.measurement_view import measurement_to_json, measurements_to_json
from ..recordings.recordings import named_car
from ..storage.measurement import Measurement
from ..web.services import Services, Shared
from .downloads import saved_as
from .simulations import csv_reply, described, frames_reply
from .strict_json import StrictRoute
from .uploads import Upload, openapi, receive

router = APIRouter(
    prefix="/api/sessions/{sid}/measurements", tags=["measurements"], route_class=StrictRoute
)

Conditioned = Annotated[
    bool, Query(description="False for the recording before anything is done to it.")
]
Recording = Annotated[Upload, Depends(receive("measurement.csv"))]
Notes = Annotated[Upload, Depends(receive("notes.toml"))]
Driven = Annotated[Upload, Depends(receive("manoeuvre.json"))]


@router.post("", status_code=201, openapi_extra=openapi("text/csv", "application/octet-stream"))
async def upload(sid: SessionId, services: Shared, received: Recording) -> dict[str, Any]:
    """Upload a recording of any kind: a form with the part `file`, or the bare file with ?name=."""
    kept = await services.readers.run(sid, lambda: _keep(services, sid, received))
    return measurement_to_json(services.store, sid, kept)


def _keep(services: Services, sid: str, received: Upload) -> Measurement:
    data = received.read(services.settings.limits.upload_bytes)
    return services.store.measurements.add(sid, services.recordings.recorded(data, received.name))


@router.get("")
def all_of_session(sid: SessionId, services: Shared) -> list[dict[str, Any]]:
    """The session's measurements, oldest first."""
    return measurements_to_json(services.store, sid)


@router.get("/{mid}")
def one(sid: SessionId, mid: str, services: Shared) -> dict[str, Any]:
    """One measurement: what was found in it."""
    return measurement_to_json(services.store, sid, services.store.measurements.get(sid, mid))


@router.get("/{mid}/frames", responses=described(frames.HISTORIES), response_class=Response)
async def histories(
    sid: SessionId,
    mid: str,
    services: Shared,
    request: Request,
    channels: Annotated[
        str | None, Query(max_length=10_000, description="Comma separated.")
    ] = None,
    max_samples: Annotated[int | None, Query(ge=2, le=2_000_000)] = None,
    decimate: frames.Decimate = "extremes",
    conditioned: Conditioned = True,
) -> Response:
    """The recording's histories in SI: binary or JSON."""
    form = frames.form_of(request.headers.get("accept"), frames.HISTORIES)
    names = None if channels is None else [name for name in channels.split(",") if name]
    kept = services.store.measurements.get(sid, mid)
    if not conditioned:
        kept = replace(kept, conditioning=None)

    def shown() -> Response:
        run = services.recordings.run(kept)
        taken = frames.take(run, names, max_samples, decimate)
        head = {"mode": "measured", "name": run.name, "duration": run.duration}
        return frames_reply({**head, "warnings": list(run.warnings)}, taken, form)

    # What is in memory need not wait for those who read files.
    if services.recordings.remembers(kept):
        return await run_in_threadpool(shown)
    return await services.readers.run(sid, shown)


@router.get("/{mid}/run.csv", response_class=StreamingResponse)
async def as_csv(
    sid: SessionId, mid: str, services: Shared, conditioned: Conditioned = True
) -> Response:
    """The recording as it is used, in SI and by our channels' names, as a file."""
    kept = services.store.measurements.get(sid, mid)
    if not conditioned:
        kept = replace(kept, conditioning=None)
    run = await services.readers.run(sid, lambda: services.recordings.run(kept))
    return csv_reply(run, saved_as(kept.name, "run.csv"))


@router.get("/{mid}/run.toml", response_class=Response)
async def its_notes(sid: SessionId, mid: str, services: Shared) -> Response:
    """The notes that belong beside `run.csv`: its noise, and what was done to it."""
    kept = services.store.measurements.get(sid, mid)
    run = await services.readers.run(sid, lambda: services.recordings.run(kept))
    return Response(
        notes_of(run), media_type="application/toml", headers=saved_as(kept.name, "run.toml")
    )


@router.get("/{mid}/original", response_class=FileResponse)
def original(sid: SessionId, mid: str, services: Shared) -> FileResponse:
    """The uploaded file, byte for byte."""
    kept = services.store.measurements.get(sid, mid)
    return FileResponse(
        services.store.measurements.original(kept),
        filename=kept.name,
        media_type="application/octet-stream",
    )


@router.put("/{mid}/notes", openapi_extra=openapi("application/toml"))
async def set_notes(sid: SessionId, mid: str, services: Shared, received: Notes) -> dict[str, Any]:
    """Take a recording's noise, and what was done to it, from a NAME.toml as it lies beside it."""
    noted = await services.readers.run(sid, lambda: _note(services, sid, mid, received))
    return measurement_to_json(services.store, sid, noted)


def _note(services: Services, sid: str, mid: str, received: Upload) -> Measurement:
    kept = services.store.measurements.get(sid, mid)
    data = received.read(services.settings.limits.body_bytes)
    notes = parse_notes(data, received.name)
    noise, done = dict(notes.noise), [step_record_to_json(one) for one in notes.conditioning]
    car = {"vehicle": notes.vehicle, "plant": notes.plant}
    if not (done or any(car.values()) or noise.keys() & set(OUTPUT_CHANNELS)):
        raise MeasurementError(
            f"{received.name} states no noise of {', '.join(OUTPUT_CHANNELS)}; write [noise] and "
            'below it lines such as "chassis.z" = 0.0005, in SI, or vehicle = and the name of the '
            "car."
        )
    told = {**kept.summary, **named_car(car, kept.summary)}
    if kept.summary.get("needs_mapping"):
        return services.store.measurements.set_notes(sid, kept.id, noise, done, told)
    known = dict(services.recordings.parse(kept, noise).noise)
    noted = replace(kept, noise=known, conditioned=done or None, summary=told)
    found = services.recordings.summed_up(noted)
    return services.store.measurements.set_notes(sid, kept.id, known, done, found)


@router.put("/{mid}/manoeuvre", openapi_extra=openapi("application/json"))
async def set_manoeuvre(
    sid: SessionId, mid: str, services: Shared, received: Driven
) -> dict[str, Any]:
    """Take what was driven from a manoeuvre file, as the NAME.manoeuvre.json beside it."""
    services.store.measurements.get(sid, mid)
    driven = await run_in_threadpool(_driven, services, received)
    return measurement_to_json(
        services.store, sid, services.store.measurements.set_manoeuvre(sid, mid, driven)
    )


def _driven(services: Services, received: Upload) -> dict[str, Any]:
    # It brings scipy, which takes long to load.
    from ...engine.manoeuvre import manoeuvre_from_json, manoeuvre_to_json

    data = received.read(services.settings.limits.body_bytes)
    manoeuvre = manoeuvre_from_json(parse_json(data, received.name, ManoeuvreError), received.name)
    if manoeuvre.kind != "road":
        raise ManoeuvreError(
            f'{received.name}: a recording is of a drive; give a manoeuvre of kind "road".'
        )
    return manoeuvre_to_json(manoeuvre)


@router.delete("/{mid}/manoeuvre")
def forget_manoeuvre(sid: SessionId, mid: str, services: Shared) -> dict[str, Any]:
    """What was driven is not known."""
    services.store.measurements.get(sid, mid)
    return measurement_to_json(
        services.store, sid, services.store.measurements.set_manoeuvre(sid, mid, None)
    )


@router.delete("/{mid}", status_code=204)
def delete(sid: SessionId, mid: str, services: Shared) -> None:
    """Remove a measurement; refused while an identification reads it."""
    services.store.measurements.delete(sid, mid)
