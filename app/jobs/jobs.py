"""Background jobs: kept in the database, run on the cluster, followed by whoever is interested.

A job is at least once: after a restart of the service, or the loss of the cluster, what had not
ended is run again from its `spec` and the parts that are kept of it. Progress is in memory of the
process that runs it, and in the database once a second.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import aclosing
from dataclasses import replace
from typing import Any

from ..errors import NotFound, Unavailable
from ..storage.job_row import Job
from ..storage.store import Store
from .cluster import Cluster
from .dispatcher import Dispatcher
from .followers import Followers
from .kinds import Kind


class Jobs:
    """Submit, cancel, follow."""

    def __init__(
        self,
        store: Store,
        cluster: Cluster,
        kinds: Mapping[str, Kind],
        *,
        ready: Callable[[], bool] = lambda: True,
        taking: Callable[[], bool] = lambda: True,
    ):
        """Jobs are sent once `ready` returns, and only if it returns True, and while `taking`."""
        self._store = store
        self._kinds = kinds
        self._followers = Followers(store.jobs)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._dispatcher = Dispatcher(store, cluster, kinds, self._wake, ready, taking)

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Take up what a former run of the service left unfinished."""
        self._loop = loop
        self._dispatcher.start()

    def close(self) -> None:
        """Stop; what is under way is taken up by another process or the next start."""
        self._dispatcher.close()

    def submit(self, session: str, kind: str, spec: Mapping[str, Any], key: str | None) -> Job:
        """Keep a job durably, to be run in its turn; the same key gives the same job."""
        priority = self._kinds[kind].priority
        job, new = self._store.jobs.add(session, kind, spec, key, priority=priority)
        if new:
            self._dispatcher.look()
        return job

    def known(self, session: str, key: str | None, asked: str) -> Job | None:
        """The job kept under a key as it stands now, see `JobStore.known`."""
        job = self._store.jobs.known(session, key, asked)
        return None if job is None else self._with_progress(job)

    def get(self, session: str, job: str, kind: str | None = None) -> Job:
        """A job, of one kind if it is told, as it stands now."""
        return self._with_progress(self._store.jobs.get(session, job, kind))

    def of_session(self, session: str, kind: str) -> list[Job]:
        """All jobs of a session and kind as they stand now."""
        return [self._with_progress(job) for job in self._store.jobs.of_session(session, kind)]

    def cancel(self, session: str, job: str) -> Job:
        """Ask a job to stop; one that waits is cancelled at once, a final state stays."""
        found = self._store.jobs.get(session, job)
        if not found.ended:
            self._stop(found)
        return self.get(session, job)

    def delete(self, session: str, job: str) -> None:
        """Remove a job, cancelled first if need be."""
        found = self._store.jobs.get(session, job)
        if not found.ended:
            self._stop(found)
        self._store.delete_job(session, job)
        self._wake(job)

    def cancel_all(self, session: str) -> None:
        """Stop every job of a session that is about to go."""
        for job in self._store.jobs.unfinished(session):
            self._stop(job)

    async def follow(
        self, session: str, job: str, require: Callable[[], object] = lambda: None
    ) -> AsyncIterator[Job]:
        """The job as it stands, without its result, then again after each change, until its final
        state; nothing while the database is away. Each time `require` may refuse before.
        """

        async with aclosing(self._followers.looks(job)) as looks:
            async for found in looks:
                try:
                    await asyncio.to_thread(require)
                except Unavailable:
                    continue
                if found is None or found.session != session:
                    raise NotFound("There is no job with that id in this session.")
                yield self._with_progress(found)
                if found.ended:
                    return

    def _stop(self, job: Job) -> None:
        self._store.jobs.ask_to_cancel(job.session, job.id)
        self._wake(job.id)
        self._dispatcher.cancel(job.id)

    def _with_progress(self, job: Job) -> Job:
        live = self._dispatcher.progress(job.id)
        return job if live is None or job.ended else replace(job, progress=dict(live))

    def _wake(self, job: str) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._followers.wake, job)
