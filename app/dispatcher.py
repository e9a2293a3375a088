"""Which job runs when: claims jobs in the database, sends their units, keeps what comes back.

One thread owns all of this state; what the cluster, the leases and the visitors tell comes to it
through a queue, in order. It writes to the database before it goes on, again and again while that
is away, so that nothing which was told is lost. Jobs of the highest priority go first, then those
of the session that has the least under way, then the oldest; as many units run at a time as the
cluster is wide, so that what is more urgent waits for one unit at most.

A job is at least once: what is not ended by the process that claimed it is claimed by the next, and
begins with the parts that are kept of it.
"""

import logging
import math
import queue
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from importlib.metadata import version
from typing import Any

from ..engine.errors import RideError
from . import logs
from .active_job import LAST, ActiveJob, chosen
from .cluster import Cluster
from .errors import NotFound, Unavailable
from .job_kinds import PROMPT, Kind, Progress
from .job_leases import Beat
from .sent_unit import SentUnit
from .store import Store
from .worker import Ending

log = logging.getLogger(__name__)

GRACE = 2.0
"""Time that a task which is cancelled has to stop before its worker is killed, s."""

MOST_ATTEMPTS = 3
LOOK_EVERY = 1.0
"""Time between two looks at what waits in the database, two heartbeats, and two records of how far
a job is, s."""

RETRY_AFTER = 2.0
"""Time after which a cluster or a database that is away is tried again, s."""

AHEAD = 2
"""Jobs claimed for each task that runs at a time, as many of those that a person waits for, and as
many of sessions that have none among them.
"""

GATHERERS = 2


class Closing(Exception):
    """The service ends; what is not written yet is done again by the next."""


class Dispatcher:
    """The jobs of one service process that are under way."""

    def __init__(
        self,
        store: Store,
        cluster: Cluster,
        kinds: Mapping[str, Kind],
        changed: Callable[[str], None],
        ready: Callable[[], bool],
        taking: Callable[[], bool] = lambda: True,
    ):
        """`changed` is told the id of each job that has news, in any thread.

        Jobs are claimed once `ready` returns, and only if it returns True; none is, and no unit is
        sent, while not `taking`.
        """
        self._store = store
        self._cluster = cluster
        self._kinds = kinds
        self._changed = changed
        self._ready, self._taking = ready, taking
        self._runner = secrets.token_hex(8)
        self._active: dict[str, ActiveJob] = {}
        self._progress: dict[str, Progress] = {}
        self._saved: dict[str, Progress] = {}
        self._looked = self._recorded = self._away_until = 0.0
        self._width = 1
        self._news: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._work, name="job-dispatcher", daemon=True)
        self._heart = threading.Thread(target=self._beat, name="job-leases", daemon=True)
        self._gatherers = ThreadPoolExecutor(GATHERERS, "job-gatherer")
        self._canceller = ThreadPoolExecutor(1, "job-canceller")

    def start(self) -> None:
        """Begin to claim jobs."""
        self._thread.start()

    def close(self) -> None:
        """Stop, and hand on what is under way."""
        self._closing.set()
        self.look()
        for executor in (self._gatherers, self._canceller):
            executor.shutdown(cancel_futures=True)
        self._cluster.close()
        for thread in (self._thread, self._heart):
            if thread.is_alive():
                thread.join()
        with suppress(Unavailable):
            self._store.leases.release(self._runner)

    def look(self) -> None:
        """There may be a job to claim."""
        self._news.put(self._look)

    def cancel(self, job: str) -> None:
        """Stop a job that is asked to, if it is under way here."""
        self._news.put(lambda: self._cancel(job))

    def progress(self, job: str) -> Progress | None:
        """How far a job under way here is."""
        return self._progress.get(job)

    # The dispatcher's thread

    def _work(self) -> None:
        if not self._ready():
            return
        self._heart.start()
        while not self._closing.is_set():
            try:
                with suppress(queue.Empty):
                    self._news.get(timeout=LOOK_EVERY)()
                    while True:
                        self._news.get_nowait()()
                if self._taking():
                    self._claim()
                    self._gather_all()
                    self._send_all()
                self._record_progress()
            except Closing:
                return
            except Unavailable as away:
                log.warning("jobs wait: %s", away)
                self._closing.wait(RETRY_AFTER)
            except Exception:
                log.exception("jobs wait")
                self._closing.wait(RETRY_AFTER)

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
            except Exception:
                log.exception("cannot keep what became of job %s", active.job.id)
                self._fail(active, "internal", "The job failed; see the service's log.")
            self._changed(active.job.id)

        self._news.put(heard)

    def _has(self, active: ActiveJob) -> bool:
        """Whether a job is still this process's as it was claimed."""
        return self._active.get(active.job.id) is active

    def _look(self) -> None:
        self._looked = 0.0

    def _claim(self) -> None:
        """Take as many jobs as keep the cluster busy, and have their payloads gathered."""
        now, share = time.monotonic(), AHEAD * self._width
        if now - self._looked < LOOK_EVERY:
            return
        self._looked = now
        if len(self._active) < share:
            self._claim_up_to(share)
            return
        self._claim_up_to(2 * share, least_priority=PROMPT)
        running = {active.job.session for active in self._active.values()}
        self._claim_up_to(3 * share, other_than=running)

    def _claim_up_to(self, most: int, **of: Any) -> None:
        if (room := most - len(self._active)) <= 0:
            return
        known = tuple(self._active)
        for job in self._store.leases.claim(
            self._runner, room, kinds=self._kinds.keys(), known=known, **of
        ):
            active = self._active[job.id] = ActiveJob(job, self._kinds[job.kind])
            if active.kind.division is None:
                active.lost[LAST] = job.attempts
            if job.cancel_asked:
                self._cancel(job.id)

    def _gather_all(self) -> None:
        """Begin to gather what is to be gathered by now."""
        for active in self._active.values():
            if active.gather_at <= time.monotonic():
                active.gather_at = math.inf
                self._gatherers.submit(self._gather, active)

    def _gather(self, active: ActiveJob) -> None:
        """In a thread of its own, because files may have to be read."""
        job, division = active.job, active.kind.division
        try:
            with logs.about(job=job.id):
                payload = active.kind.payload(job)
                units = () if division is None else tuple(division.names(job.spec))
                slow = division is not None and division.slow(job.spec)
        except Unavailable as away:
            log.warning("job %s waits to be gathered: %s", job.id, away)
            self._news.put(lambda: self._gather_later(active))
        except RideError as error:
            code, detail = error.code, str(error)
            self._news.put(lambda: self._fail(active, code, detail))
        except Exception:
            log.exception("cannot gather job %s", job.id)
            detail = "The job could not be started; see the service's log."
            self._news.put(lambda: self._fail(active, "internal", detail))
        else:
            self._news.put(lambda: self._gathered(active, payload, units, slow))

    def _gather_later(self, active: ActiveJob) -> None:
        active.gather_at = time.monotonic() + RETRY_AFTER

    def _gathered(self, active: ActiveJob, payload: Any, units: Sequence[str], slow: bool) -> None:
        if not self._has(active):
            return
        for name, progress in self._written(lambda: self._store.parts(active.job.id)).items():
            if name.startswith(_KEPT_BY):
                active.kept.add(name.removeprefix(_KEPT_BY))
                active.progress[name.removeprefix(_KEPT_BY)] = progress
        if not active.cancelled:
            active.waiting = deque(name for name in units if name not in active.kept)
        active.payload, active.slow = payload, slow
        self._conclude(active)

    def _send_all(self) -> None:
        """Send units while there is room; nothing while the workers cannot be reached."""
        if time.monotonic() < self._away_until or not any(
            one.next is not None for one in self._active.values()
        ):
            return
        try:
            self._width = self._cluster.width()
            while not self._closing.is_set() and (active := self._chosen()) is not None:
                self._send(active)
        except Unavailable:
            self._away_until = time.monotonic() + RETRY_AFTER

    def _chosen(self) -> ActiveJob | None:
        return chosen(self._active.values(), self._width)

    def _send(self, active: ActiveJob) -> None:
        unit, job, kind = active.next, active.job, active.kind
        assert unit is not None
        task, payload, kept = kind.task, active.payload, {}
        try:
            if unit == LAST:
                kept = {name: self._store.part(job.id, _KEPT_BY + name) for name in active.kept}
            else:
                assert kind.division is not None
                task, payload = kind.division.unit, {**payload, "unit": unit}
        except NotFound:
            # It has ended elsewhere, and its parts went with it; or it is ours still, a part is
            # lost, and it is claimed again with the others.
            self._let_go(active)
            return
        sent = SentUnit(active, unit, self)
        self._cluster.submit(
            _task(job.id, unit), task, payload, sent, kept=kept, priority=job.priority
        )
        if unit != LAST:
            active.waiting.popleft()
        active.running[unit] = sent

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
                self._fail(active, "worker-lost", detail)
                return
            self._written(lambda: self._store.leases.requeue(active.job.id, self._runner))
            active.started = False

    def _cancel(self, job: str) -> None:
        active = self._active.get(job)
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
        if not active.cancelled or active.running or active.job.id not in self._active:
            return
        if not active.cut_short or active.payload is not None and not active.kept:
            self._finish(active, "cancelled", progress=self._progress.get(active.job.id))

    def _fail(self, active: ActiveJob, code: str, detail: str) -> None:
        self._finish(active, "failed", error={"code": code, "detail": detail})

    def _finish(self, active: ActiveJob, state: str, **found: Any) -> None:
        job = active.job.id
        if self._has(active):
            self._written(lambda: self._store.finish_job(job, state, runner=self._runner, **found))
            self._let_go(active)

    def _let_go(self, active: ActiveJob) -> None:
        """Forget a job, and stop what still runs of it."""
        del self._active[active.job.id]
        for known in (self._progress, self._saved):
            known.pop(active.job.id, None)
        self._look()
        self._stop(active)
        self._changed(active.job.id)

    def _stop(self, active: ActiveJob) -> None:
        for unit in active.running:
            with suppress(RuntimeError):  # none is called while the service ends
                task = _task(active.job.id, unit)
                self._canceller.submit(self._cluster.cancel, task, GRACE)

    def _record_progress(self) -> None:
        now = time.monotonic()
        if now - self._recorded < LOOK_EVERY:
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
                self._closing.wait(RETRY_AFTER)
        raise Closing

    # The leases' thread

    def _beat(self) -> None:
        while not self._closing.wait(LOOK_EVERY):
            if not (known := frozenset(self._active)):
                continue
            try:
                beat = self._store.leases.heartbeat(self._runner)
            except Exception as error:
                log.warning("leases of jobs are not renewed: %s", error)
                continue
            if beat.cancel_asked or known - beat.jobs:
                self._news.put(lambda beat=beat, known=known: self._heed(beat, known))

    def _heed(self, beat: Beat, known: frozenset[str]) -> None:
        """Stop what others asked to stop, and what is another's by now or has ended."""
        for job in beat.cancel_asked:
            self._cancel(job)
        for job in known - beat.jobs:
            if (active := self._active.get(job)) is not None:
                self._let_go(active)


def _task(job: str, unit: str) -> str:
    """What the cluster calls a unit of a job."""
    return f"{job}/{unit}" if unit else job


_KEPT_BY = f"{version('ridetune')}/"
"""What the names of parts begin with: another version may make them in another way."""
