"""The jobs that one process has claimed, and what becomes of them.

For the dispatcher's thread, which writes to the database before it goes on, again and again while
that is away, so that nothing which was told is lost.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import Any

from .. import logs
from ..errors import Unavailable, unforeseen
from ..storage.job_leases import Beat
from ..storage.store import Store
from .active_job import LAST, ActiveJob, task_of
from .kinds import Progress
from .sent_unit import SentUnit
from .worker import Ending

log = logging.getLogger(__name__)

MOST_ATTEMPTS = 3
RECORD_EVERY = 1.0
"""Time between two records of how far a job is, s."""

REWRITE_AFTER = 2.0
"""Time after which what the database did not take is written again, s."""


class Closing(Exception):
    """The service ends; what is not written yet is done again by the next."""


class JobsUnderWay:
    """Those of one runner."""

    def __init__(
        self,
        store: Store,
        runner: str,
        say: Callable[[Callable[[], None]], None],
        *,
        stop: Callable[[str], None],
        changed: Callable[[str], None],
        room: Callable[[], None],
        closing: threading.Event,
    ):
        """say : has something called in the dispatcher's thread

        stop : stops a task on the cluster;  changed : hears of each job that has news
        room : hears that another job can be claimed
        closing : set once nothing is written any more
        """
        self._store, self._runner, self._say = store, runner, say
        self._stop_task, self._changed, self._room = stop, changed, room
        self._closing = closing
        self.active: dict[str, ActiveJob] = {}
        """By id."""
        self._progress: dict[str, Progress] = {}
        self._saved: dict[str, Progress] = {}
        self._recorded = 0.0

    def progress(self, job: str) -> Progress | None:
        """How far one is; in any thread."""
        return self._progress.get(job)

    def parts(self, active: ActiveJob) -> dict[str, bytes]:
        """What is kept of one, by the names that its units and its task gave; NotFound where some
        of it is no more.
        """
        return {name: self._store.part(active.job.id, _KEPT_BY + name) for name in active.kept}

    def hear(self, sent: SentUnit, then: Callable[[], None]) -> None:
        """Put what is told of a unit into the queue."""
        active = sent.active

        def heard() -> None:
            if active.running.get(sent.unit) is not sent or not self._has(active):
                return
            try:
                then()
            except Closing:
                raise
            except Exception as error:
                self.fail_unforeseen(active, error)
            self._changed(active.job.id)

        self._say(heard)

    def _has(self, active: ActiveJob) -> bool:
        """Whether a job is still this process's as it was claimed."""
        return self.active.get(active.job.id) is active

    def gathered(self, active: ActiveJob, payload: Any, units: Sequence[str], slow: bool) -> None:
        """Have a job begin with its payload and the units that are not kept yet."""
        if not self._has(active):
            return
        try:
            self._begin(active, payload, units, slow)
        except Closing:
            raise
        except Exception as error:
            self.fail_unforeseen(active, error)

    def _begin(self, active: ActiveJob, payload: Any, units: Sequence[str], slow: bool) -> None:
        for name, progress in self._written(lambda: self._store.parts(active.job.id)).items():
            if name.startswith(_KEPT_BY):
                active.kept.add(name.removeprefix(_KEPT_BY))
                active.progress[name.removeprefix(_KEPT_BY)] = progress
        if not active.cancelled:
            active.waiting = deque(name for name in units if name not in active.kept)
        active.payload, active.slow = payload, slow
        self._conclude(active)

    def started(self, sent: SentUnit) -> None:
        """Mark the job as running."""
        active = sent.active
        if not active.started:
            active.started = True
            self._written(lambda: self._store.leases.start(active.job.id, self._runner))

    def told(self, sent: SentUnit, progress: Progress) -> None:
        """Remember how far the unit is."""
        self._tell(sent.active, sent.unit, progress)

    def _tell(self, active: ActiveJob, unit: str, progress: Progress) -> None:
        active.progress[unit] = progress
        division = active.kind.division
        if division is not None:
            if unit == LAST:
                return
            progress = division.progress(active.job.spec, active.progress, len(active.running))
        self._progress[active.job.id] = progress

    def kept(self, sent: SentUnit, part: str, data: bytes) -> None:
        """Keep a part that a task made on its way."""
        self._keep(sent.active, part, data, {})

    def _keep(self, active: ActiveJob, part: str, data: bytes, progress: Progress) -> None:
        name = _KEPT_BY + part
        if self._written(lambda: self._store.keep_part(active.job.id, name, data, progress)):
            active.kept.add(part)

    def ended(self, sent: SentUnit, ending: Ending) -> None:
        """Keep the part or the result."""
        active, unit = sent.active, sent.unit
        del active.running[unit]
        if ending["state"] == "cancelled" and not active.cancelled:
            # Nobody asked it to stop, as long as the job is ours.
            if unit != LAST:
                active.waiting.appendleft(unit)
        elif unit == LAST:
            self._finish(
                active,
                ending["state"],
                result=ending["result"],
                error=ending["error"],
                progress=ending["progress"] or self._progress.get(active.job.id),
                file=ending.get("file"),
            )
        elif ending["state"] == "failed":
            self._finish(active, "failed", error=ending["error"])
        elif ending["state"] == "done":
            progress = ending["result"] or {}
            self._keep(active, unit, ending.get("file", b""), progress)
            self._tell(active, unit, progress)
        self._conclude(active)

    def lost(self, sent: SentUnit, *, with_worker: bool) -> None:
        """Send the unit again, but not for ever where it may be the reason."""
        active, unit = sent.active, sent.unit
        del active.running[unit]
        if active.cancelled:
            self._conclude(active)
            return
        if unit != LAST:
            active.waiting.appendleft(unit)
        if with_worker:
            active.lost[unit] += 1
            if active.lost[unit] >= MOST_ATTEMPTS:
                detail = "The job's workers were lost each time it was tried."
                self.fail(active, "worker-lost", detail)
                return
            self._written(lambda: self._store.leases.requeue(active.job.id, self._runner))
            active.started = False

    def cancel(self, job: str) -> None:
        """Stop one that is asked to."""
        active = self.active.get(job)
        if active is None or active.cancelled:
            return
        active.cancelled = True
        active.waiting.clear()
        if not (active.cut_short and LAST in active.running):
            self._stop(active)
        self._conclude(active)

    def _conclude(self, active: ActiveJob) -> None:
        """End a job that is cancelled once nothing of it runs, and it is known that no result is
        made of its parts.
        """
        if not active.cancelled or active.running or active.job.id not in self.active:
            return
        if not active.cut_short or active.payload is not None and not active.kept:
            self._finish(active, "cancelled", progress=self._progress.get(active.job.id))

    def fail(self, active: ActiveJob, code: str, detail: str) -> None:
        """End a job of which nothing comes."""
        self._finish(active, "failed", error={"code": code, "detail": detail})

    def fail_unforeseen(self, active: ActiveJob, error: Exception) -> None:
        """End a job, and none beside it, by a fault of ours."""
        with logs.about(job=active.job.id):
            log.error("job %s failed unexpectedly", active.job.id, exc_info=error)
        self.fail(active, **unforeseen(error))

    def _finish(self, active: ActiveJob, state: str, **found: Any) -> None:
        job = active.job.id
        if self._has(active):
            self._written(lambda: self._store.finish_job(job, state, runner=self._runner, **found))
            self.let_go(active)

    def let_go(self, active: ActiveJob) -> None:
        """Forget a job, and stop what still runs of it."""
        del self.active[active.job.id]
        for known in (self._progress, self._saved):
            known.pop(active.job.id, None)
        self._room()
        self._stop(active)
        self._changed(active.job.id)

    def _stop(self, active: ActiveJob) -> None:
        for unit in active.running:
            self._stop_task(task_of(active.job.id, unit))

    def record_progress(self) -> None:
        """Keep how far each is, once in a while."""
        now = time.monotonic()
        if now - self._recorded < RECORD_EVERY:
            return
        self._recorded = now
        for job, progress in self._progress.items():
            if self._saved.get(job) is not progress:
                self._store.leases.save_progress(job, self._runner, progress)
                self._saved[job] = progress

    def _written(self, write: Callable[[], Any]) -> Any:
        """What a write gives, as soon as the database takes it."""
        while not self._closing.is_set():
            try:
                return write()
            except Unavailable as away:
                log.warning("what became of a job waits to be kept: %s", away)
                self._closing.wait(REWRITE_AFTER)
        raise Closing

    def heed(self, beat: Beat, known: frozenset[str]) -> None:
        """Stop what others asked to stop, and what is another's by now or has ended."""
        for job in beat.cancel_asked:
            self.cancel(job)
        for job in known - beat.jobs:
            if (active := self.active.get(job)) is not None:
                self.let_go(active)


_KEPT_BY = f"{version('ridetune')}/"
"""What the names of parts begin with: another version may make them in another way."""
