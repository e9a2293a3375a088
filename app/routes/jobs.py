"""What jobs of every kind have in common over REST: look, list, follow, cancel, delete."""

from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request
from fastapi.sse import EventSourceResponse, ServerSentEvent

from ..access.sessions import SessionId, session_of
from ..errors import NotFound
from ..frames import clean
from ..instants import instant
from ..storage.job_row import Job
from ..web.services import Services, Shared
from .strict_json import StrictRoute


@dataclass(frozen=True)
class View:
    """How a job of one kind is shown: what was asked, and what comes only with the result."""

    kind: str
    asked: Callable[[Job], Mapping[str, Any]]
    result: Callable[[Job], Mapping[str, Any]]


def job_to_json(job: Job, view: View, *, with_result: bool = False) -> dict[str, Any]:
    """A job as the REST interface shows it: its state, and what was asked as the request names
    it.
    """
    shown = {
        "id": job.id,
        "kind": job.kind,
        "state": job.state,
        "created": instant(job.created),
        "started": instant(job.started),
        "finished": instant(job.finished),
        **view.asked(job),
        "progress": job.progress,
        "error": job.error,
    }
    return clean({**shown, **(view.result(job) if with_result else {})})


def all_to_json(services: Services, sid: str, view: View) -> list[dict[str, Any]]:
    """The session's jobs of one kind, oldest first, without results."""
    return [job_to_json(job, view) for job in services.jobs.of_session(sid, view.kind)]


async def submitted(
    services: Services,
    sid: str,
    view: View,
    key: str | None,
    asked: Callable[[], str],
    spec: Callable[[], Mapping[str, Any]],
) -> dict[str, Any]:
    """The job kept under a request's key whatever has changed since, else a new one.

    asked : gives what stands for the request;  spec : everything that the job needs, checked
    """

    def found_or_queued() -> dict[str, Any]:
        request = asked()
        job = services.jobs.known(sid, key, request)
        if job is None:
            job = services.jobs.submit(sid, view.kind, {**spec(), "asked": request}, key)
        return job_to_json(job, view)

    return await services.interactive.run(sid, found_or_queued)


def job_router(name: str, view: View) -> APIRouter:
    """Routes to the jobs of one kind, below the session's `name`."""
    router = APIRouter(prefix=f"/api/sessions/{{sid}}/{name}", tags=[name], route_class=StrictRoute)

    @router.get("")
    def all_of_session(sid: SessionId, services: Shared) -> list[dict[str, Any]]:
        """All of the session's, oldest first, without results."""
        return all_to_json(services, sid, view)

    def of_kind(sid: SessionId, jid: str, services: Shared) -> Job:
        return services.jobs.get(sid, jid, view.kind)

    @router.get("/{jid}")
    def one(known: Annotated[Job, Depends(of_kind)]) -> dict[str, Any]:
        """One of them, with its `result` once it is done."""
        return job_to_json(known, view, with_result=True)

    async def watching(sid: SessionId, services: Shared) -> AsyncIterator[None]:
        # For each the database is asked every second whether it may.
        with services.event_streams.one_more(sid):
            yield

    @router.get(
        "/{jid}/events", response_class=EventSourceResponse, dependencies=[Depends(watching)]
    )
    async def events(
        request: Request,
        sid: SessionId,
        services: Shared,
        known: Annotated[Job, Depends(of_kind)],
    ) -> AsyncIterator[ServerSentEvent]:
        """The job's state now, then every change of state and progress, until its final state."""
        state, progress = None, known.progress
        try:
            theirs = partial(session_of, request, sid)
            async for job in services.jobs.follow(sid, known.id, theirs):
                if job.progress != progress and job.progress:
                    progress = job.progress
                    yield ServerSentEvent(event="progress", data=clean(progress))
                if job.state != state:
                    state = job.state
                    yield ServerSentEvent(event="state", data=job_to_json(job, view))
        except NotFound:
            # Deleted, or not theirs any more, while somebody watched.
            return

    @router.post("/{jid}/cancel", status_code=202)
    def cancel(
        sid: SessionId, known: Annotated[Job, Depends(of_kind)], services: Shared
    ) -> dict[str, Any]:
        """Ask the job to stop; it does within a fraction of a second."""
        return job_to_json(services.jobs.cancel(sid, known.id), view)

    @router.delete("/{jid}", status_code=204)
    def delete(sid: SessionId, known: Annotated[Job, Depends(of_kind)], services: Shared) -> None:
        """Remove the job and its result, cancelled first if need be."""
        services.jobs.delete(sid, known.id)

    return router
