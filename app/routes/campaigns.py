"""Campaigns: background jobs like identifications, whose recordings come as files."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import PurePath
from typing import Any
from zipfile import ZipFile

from fastapi.responses import FileResponse, Response

from ...engine.run_notes import parse_notes
from ..access.sessions import SessionId
from ..errors import Conflict, NotFound
from ..jobs.kinds import as_asked
from ..recordings.measurement_view import measurements_to_json
from ..schemas import CampaignRequest
from ..storage.job_row import Job
from ..storage.measurement import Measurement, NewMeasurement
from ..web.services import Services, Shared
from ..work.campaign import KIND, check_and_fill
from .jobs import View, job_router, submitted

ASKED = (
    *("plant", "manoeuvres", "class_factor", "band", "road_seed"),
    *("noise", "sensors", "seed", "format", "date"),
)
"""What a job shows of its request, with what held untold filled in; `date` is that of the request,
as the recordings have it."""

MEDIA_TYPES = {
    ".csv": "text/csv; charset=utf-8",
    ".json": "application/json",
    ".mf4": "application/octet-stream",
    ".toml": "application/toml",
}

VIEW = View(
    KIND,
    asked=lambda job: {name: job.spec[name] for name in ASKED},
    result=lambda job: {"vehicle": job.spec["vehicle"], "result": job.result},
)

router = job_router("campaigns", VIEW)


@router.post("", status_code=202)
async def submit(sid: SessionId, services: Shared, body: CampaignRequest) -> dict[str, Any]:
    """Queue a campaign; the same `key` again gives the same job."""
    return await submitted(
        services, sid, VIEW, body.key, lambda: as_asked(body), lambda: _spec(services, sid, body)
    )


def _spec(services: Services, sid: str, body: CampaignRequest) -> dict[str, Any]:
    """Everything that the job needs, checked."""
    store = services.store
    vehicle, limits = store.sessions.get(sid).vehicle, services.settings.limits
    spec = services.in_simulator(sid, check_and_fill, body, vehicle, limits)
    store.files.require_room(sid, spec.pop("most_bytes"))
    return spec


@router.get("/{jid}/files")
def files(sid: SessionId, jid: str, services: Shared) -> list[Mapping[str, Any]]:
    """What a campaign that has ended wrote: name, size and SHA-256 of each file."""
    return _result(_ended(services, sid, jid))["files"]


@router.get("/{jid}/files/{name}", response_class=Response)
def one_file(sid: SessionId, jid: str, name: str, services: Shared) -> Response:
    """One of the files."""
    job = _ended(services, sid, jid)
    if name not in {one["name"] for one in _result(job)["files"]}:
        raise NotFound("The campaign wrote no file by that name; its list of files has them all.")
    return Response(
        _read(services, job, name),
        media_type=MEDIA_TYPES[PurePath(name).suffix],
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )


@router.get("/{jid}/campaign.zip", response_class=FileResponse)
def archive(sid: SessionId, jid: str, services: Shared) -> FileResponse:
    """All of the files in one archive."""
    return FileResponse(
        _archive(services, _ended(services, sid, jid)),
        filename="campaign.zip",
        media_type="application/zip",
    )


@router.post("/{jid}/measurements", status_code=201)
async def take_over(sid: SessionId, jid: str, services: Shared) -> list[dict[str, Any]]:
    """Make the whole recordings the session's measurements, those that it does not hold yet."""
    kept = await services.readers.run(sid, lambda: _taken(services, sid, jid))
    return measurements_to_json(services.store, sid, kept)


def _taken(services: Services, sid: str, jid: str) -> list[Measurement]:
    """The measurements of all whole recordings, in the order of the drives."""
    job, store = _ended(services, sid, jid), services.store
    if job.spec["format"] != "csv":
        raise Conflict("Recordings in MDF4 are not read back; drive again with format csv.")
    whole = [one for one in _result(job)["recordings"] if one["state"] == "whole"]
    if not whole:
        raise Conflict("The campaign has no whole recording; see why, and drive again.")
    held = {one.sha256: one for one in store.measurements.of_session(sid)}
    new = [_recorded(services, job, one) for one in whole if one["sha256"] not in held]
    held |= {one.sha256: one for one in store.measurements.add_all(sid, new)}
    return [held[one["sha256"]] for one in whole]


def _recorded(services: Services, job: Job, recording: Mapping[str, Any]) -> NewMeasurement:
    """A whole recording with the noise that its notes state, what was driven and by which car."""
    name = f"{recording['name']}.toml"
    notes = parse_notes(_read(services, job, name), name)
    data = _read(services, job, recording["file"])
    new = services.recordings.recorded(data, recording["file"], notes.noise)
    driven = json.loads(_read(services, job, f"{recording['name']}.manoeuvre.json"))
    return replace(
        new,
        manoeuvre=driven,
        summary={**new.summary, "vehicle": notes.vehicle, "plant": notes.plant},
    )


def _ended(services: Services, sid: str, jid: str) -> Job:
    """A campaign with files; Conflict before, and where it has none."""
    job = services.jobs.get(sid, jid, KIND)
    if job.file is None:
        remedy = "drive it again" if job.ended else "wait until it has ended"
        raise Conflict(f"The campaign has no files, its state is {job.state}; {remedy}.")
    return job


def _result(job: Job) -> Mapping[str, Any]:
    assert job.result is not None
    return job.result


def _archive(services: Services, job: Job) -> Any:
    assert job.file is not None
    return services.store.files.original(job.file)


def _read(services: Services, job: Job, name: str) -> bytes:
    with ZipFile(_archive(services, job)) as archive:
        return archive.read(name)
