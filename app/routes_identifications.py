"""Identifications: background jobs that can be followed and cancelled."""

from collections.abc import AsyncIterator
from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends
from fastapi.sse import EventSourceResponse, ServerSentEvent

from ..engine.vehicle_file import vehicle_from_json, vehicle_to_json
from .access import SessionId
from .errors import InvalidRequest, NotFound
from .frames import clean
from .identification_job import (
    KIND,
    as_asked,
    build_problem,
    check_budget,
    filled_in,
    marked_runs,
)
from .job_store import Job
from .schemas import IdentificationRequest
from .services import Services, Shared
from .strict_json import StrictRoute

router = APIRouter(
    prefix="/api/sessions/{sid}/identifications", tags=["identifications"], route_class=StrictRoute
)


ASKED = ("runs", "free", "fixed", "bounds", "start", "noise", "traction", "settings", "braking")
"""Fields of a request that its job shows, with what held untold filled in."""


def job_to_json(job: Job, *, with_result: bool = False) -> dict[str, Any]:
    """A job as the REST interface shows it: its state, and what was asked as the request names it.

    runs : id and name of each, and the noise that was stated of it
    vehicle, result : only with the result
    """
    spec = job.spec
    shown = {
        "id": job.id,
        "kind": job.kind,
        "state": job.state,
        "created": _instant(job.created),
        "started": _instant(job.started),
        "finished": _instant(job.finished),
        **{name: spec[name] for name in ASKED},
        "progress": job.progress,
        "error": job.error,
    }
    if with_result:
        shown |= {"vehicle": spec["vehicle"], "result": job.result}
    return clean(shown)


def _instant(seconds: float | None) -> str | None:
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC).isoformat()


@router.post("", status_code=202)
async def submit(sid: SessionId, services: Shared, body: IdentificationRequest) -> dict[str, Any]:
    """Queue an identification; the same `key` again gives the same job."""
    return await services.interactive.run(sid, lambda: _submitted(services, sid, body))


def _submitted(services: Services, sid: str, body: IdentificationRequest) -> dict[str, Any]:
    """The job kept under the request's key whatever has changed since, else a new one."""
    asked = as_asked(body)
    job = services.jobs.known(sid, body.key, asked)
    if job is None:
        spec = {**_spec(services, sid, body), "asked": asked}
        job = services.jobs.submit(sid, KIND, spec, body.key)
    return job_to_json(job)


def _spec(services: Services, sid: str, body: IdentificationRequest) -> dict[str, Any]:
    """Everything that the job needs, checked."""
    kept = [services.store.measurement(sid, measurement) for measurement in body.runs]
    check_budget(kept, body.settings.step, services.settings.limits)
    vehicle = services.store.session(sid).vehicle if body.vehicle is None else body.vehicle
    spec = body.model_dump(mode="json", exclude={"key", "runs", "vehicle"})
    spec["vehicle"] = vehicle_to_json(vehicle_from_json(vehicle))
    spec["runs"] = [{"id": one.id, "name": one.name, "noise": one.noise} for one in kept]
    if strangers := set(body.braking) - {one.id for one in kept}:
        raise InvalidRequest(
            f"Braking is marked for {min(strangers)}, which is not among the runs; leave it out or "
            "add the run.",
            field="braking",
        )
    return filled_in(spec, build_problem(spec, marked_runs(spec, kept, services.recordings)))


@router.get("")
def all_of_session(sid: SessionId, services: Shared) -> list[dict[str, Any]]:
    """The session's identifications, oldest first, without results."""
    return [job_to_json(job) for job in services.jobs.of_session(sid, KIND)]


@router.get("/{jid}")
def one(sid: SessionId, jid: str, services: Shared) -> dict[str, Any]:
    """One identification; `result` is a fit.json once it is done."""
    return job_to_json(services.jobs.get(sid, jid, KIND), with_result=True)


def _known(sid: SessionId, jid: str, services: Shared) -> Job:
    return services.jobs.get(sid, jid, KIND)


@router.get("/{jid}/events", response_class=EventSourceResponse)
async def events(
    sid: SessionId, services: Shared, known: Annotated[Job, Depends(_known)]
) -> AsyncIterator[ServerSentEvent]:
    """The job's state now, then every change of state and progress, until its final state."""
    state, progress = None, known.progress
    try:
        async for job in services.jobs.follow(sid, known.id):
            if job.progress != progress and job.progress:
                progress = job.progress
                yield ServerSentEvent(event="progress", data=clean(progress))
            if job.state != state:
                state = job.state
                yield ServerSentEvent(event="state", data=job_to_json(job))
    except NotFound:
        # Deleted while somebody watched.
        return


@router.post("/{jid}/cancel", status_code=202)
def cancel(sid: SessionId, jid: str, services: Shared) -> dict[str, Any]:
    """Ask the job to stop; it does within a fraction of a second."""
    return job_to_json(services.jobs.cancel(sid, jid))


@router.delete("/{jid}", status_code=204)
def delete(sid: SessionId, jid: str, services: Shared) -> None:
    """Remove the job and its result, cancelled first if need be."""
    services.jobs.delete(sid, jid)
