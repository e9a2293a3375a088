"""Background jobs: kept in the database, run on the cluster, followed by whoever is interested.

A job is at least once: after a restart of the service, or the loss of the cluster, what had not
ended is run again from its `spec`. Progress is in memory, and in the database once a second.
"""

import asyncio
import contextlib
import hashlib
import json
import logging
import secrets
import time
from collections.abc import AsyncIterator, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

from ..engine.errors import RideError
from .cluster import Cluster
from .errors import Unavailable
from .job_store import Job
from .schemas import WireForm
from .store import Store
from .worker import Ending, Task

log = logging.getLogger(__name__)

GRACE = 2.0
MOST_ATTEMPTS = 3
MOST_CLAIMED = 100
SAVE_EVERY = 1.0


def digest(form: Mapping[str, Any]) -> str:
    """What stands for a request in the form of JSON."""
    return hashlib.sha256(json.dumps(form, sort_keys=True).encode()).hexdigest()


def as_asked(request: WireForm) -> str:
    """What stands for a request of one spelling: the same whenever it is sent."""
    return digest(request.model_dump(mode="json", exclude={"key"}))


@dataclass(frozen=True)
class Kind:
    """What a job of one kind does: `payload` gathers here what `task` needs on a worker.

    grace : how long a task that is cancelled may take to stop before its worker is killed, s
    """

    task: Task
    payload: Callable[[Job], Any]
    grace: float = GRACE


class Jobs:
    """Submit, cancel, follow."""

    def __init__(
        self,
        store: Store,
        cluster: Cluster,
        kinds: Mapping[str, Kind],
        *,
        ready: Callable[[], bool] = lambda: True,
    ):
        """Jobs are sent once `ready` returns, and only if it returns True."""
        self._store = store
        self._owner = secrets.token_hex(8)
        self._ready = ready
        self._cluster = cluster
        self._kinds = kinds
        self._progress: dict[str, Mapping[str, Any]] = {}
        self._saved: dict[str, float] = {}
        self._cancelled: set[str] = set()
        self._followers: dict[str, set[asyncio.Event]] = {}
        self._loop: asyncio.AbstractEventLoop | None = None
        # One thread hands jobs over, in their order; it waits while the cluster starts.
        self._sender = ThreadPoolExecutor(1, "job-sender")
        self._canceller = ThreadPoolExecutor(1, "job-canceller")
        # News go to the database in their order, without holding up the cluster.
        self._recorder = ThreadPoolExecutor(1, "job-recorder")

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Take up what a former run of the service left unfinished."""
        self._loop = loop
        self._take_up()

    def close(self) -> None:
        """Stop; what is under way is taken up again by the next start."""
        for executor in (self._sender, self._canceller):
            executor.shutdown(cancel_futures=True)
        self._cluster.close()
        self._recorder.shutdown()
        # Where it cannot be told, the lease runs out.
        with contextlib.suppress(Unavailable):
            self._store.jobs.release(self._owner)

    def submit(self, session: str, kind: str, spec: Mapping[str, Any], key: str | None) -> Job:
        """Keep a job durably, then send it off; the same key gives the same job."""
        job, new = self._store.jobs.add(session, kind, spec, key)
        if new:
            self._take_up()
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
        self._forget(job)

    def cancel_all(self, session: str) -> None:
        """Stop every job of a session that is about to go."""
        for job in self._store.jobs.unfinished(session):
            self._stop(job)

    async def follow(self, session: str, job: str) -> AsyncIterator[Job]:
        """The job as it stands, then again after each change, until its final state."""
        changed = asyncio.Event()
        self._followers.setdefault(job, set()).add(changed)
        try:
            while True:
                changed.clear()
                now = await asyncio.to_thread(self.get, session, job)
                yield now
                if now.ended:
                    return
                await changed.wait()
        finally:
            followers = self._followers[job]
            followers.discard(changed)
            if not followers:
                del self._followers[job]

    # What the cluster tells

    def task_started(self, task: str) -> None:
        """Mark the job as running."""
        self._record(self._store.jobs.start, task, self._owner)

    def task_progressed(self, task: str, progress: Mapping[str, Any]) -> None:
        """Remember how far it is; durably once a second."""
        self._progress[task] = progress
        now = time.monotonic()
        if now - self._saved.get(task, 0.0) >= SAVE_EVERY:
            self._saved[task] = now
            self._record(self._store.jobs.save_progress, task, self._owner, progress)
        self._wake(task)

    def task_ended(self, task: str, ending: Ending) -> None:
        """Keep the result together with the final state."""
        self._record(
            self._finish,
            task,
            ending["state"],
            result=ending["result"],
            error=ending["error"],
            progress=ending["progress"] or self._progress.get(task),
            file=ending.get("file"),
        )

    def task_lost(self, task: str) -> None:
        """Send the job again, but not for ever."""
        self._record(self._send_again, task)

    # Inside

    def _take_up(self) -> None:
        """Claim what nobody runs, and send it."""
        while taken := self._store.jobs.claim(self._owner, MOST_CLAIMED):
            for job in taken:
                self._sender.submit(self._send, job)

    def _send(self, job: Job) -> None:
        if not self._ready():
            return
        kind = self._kinds[job.kind]
        try:
            payload = kind.payload(job)
            if job.id not in self._cancelled:
                self._cluster.submit(job.id, kind.task, payload, self)
            if job.id in self._cancelled:
                # Perhaps only since: what was cancelled before it was there goes now.
                self._cluster.cancel(job.id, kind.grace)
        except RideError as error:
            self._fail(job.id, error.code, str(error))
        except Exception:
            log.exception("cannot send job %s", job.id)
            self._fail(job.id, "internal", "The job could not be started; see the service's log.")

    def _stop(self, job: Job) -> None:
        if job.state == "queued":
            self._cancelled.add(job.id)
            self._store.finish_job(job.id, "cancelled")
            self._wake(job.id)
        self._canceller.submit(self._cluster.cancel, job.id, self._kinds[job.kind].grace)

    def _fail(self, job: str, code: str, detail: str) -> None:
        self._finish(job, "failed", error={"code": code, "detail": detail})

    def _finish(self, job: str, state: str, **found: Any) -> None:
        self._store.finish_job(job, state, **found)
        self._forget(job)

    def _send_again(self, task: str) -> None:
        job = next((job for job in self._store.jobs.unfinished() if job.id == task), None)
        if job is None:
            return
        if job.attempts + 1 >= MOST_ATTEMPTS:
            self._fail(task, "worker-lost", "The job's workers were lost each time it was tried.")
        elif self._store.jobs.requeue(task, self._owner):
            self._sender.submit(self._send, replace(job, attempts=job.attempts + 1))

    def _record(self, write: Callable[..., Any], task: str, *values: Any, **named: Any) -> None:
        def recorded() -> None:
            try:
                write(task, *values, **named)
            except Exception:
                log.exception("cannot record what became of job %s", task)
            self._wake(task)

        # After `close` nothing is recorded any more: the job is taken up by the next start.
        with contextlib.suppress(RuntimeError):
            self._recorder.submit(recorded)

    def _with_progress(self, job: Job) -> Job:
        live = self._progress.get(job.id)
        return job if live is None or job.ended else replace(job, progress=dict(live))

    def _forget(self, job: str) -> None:
        self._progress.pop(job, None)
        self._saved.pop(job, None)
        self._wake(job)

    def _wake(self, job: str) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._set, job)

    def _set(self, job: str) -> None:
        for follower in self._followers.get(job, ()):
            follower.set()
