"""Which job runs when: claims jobs in the database and sends their units.

One thread owns all of this state; what the cluster, the leases and the visitors tell comes to it
through a queue, in order. Jobs of the highest priority go first, then those of the session that has
the least under way, then the oldest; as many units run at a time as the cluster is wide, so that
what is more urgent waits for one unit at most.

A job is at least once: what is not ended by the process that claimed it is claimed by the next, and
begins with the parts that are kept of it.
"""

import logging
import queue
import secrets
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

from ..errors import NotFound, Unavailable
from ..storage.disk_errors import trouble_of
from ..storage.job_leases import Beat
from ..storage.store import Store
from .active_job import LAST, ActiveJob, chosen, task_of
from .cluster import Cluster
from .gatherer import Gatherer
from .jobs_under_way import Closing, JobsUnderWay
from .kinds import PROMPT, Kind, Progress
from .lease_keeper import LeaseKeeper
from .sent_unit import SentUnit

log = logging.getLogger(__name__)

GRACE = 2.0
"""Time that a task which is cancelled has to stop before its worker is killed, s."""

LOOK_EVERY = 1.0
"""Time between two looks at what waits in the database, s."""

RETRY_AFTER = 2.0
"""Time after which a cluster or a database that is away is tried again, s."""

AHEAD = 2
"""Jobs claimed for each task that runs at a time, as many of those that a person waits for, and as
many of sessions that have none among them.
"""


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
        self._ready, self._taking = ready, taking
        self._runner = secrets.token_hex(8)
        self._looked = self._away_until = 0.0
        self._width = 1
        self._news: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._jobs = JobsUnderWay(
            store,
            self._runner,
            self._news.put,
            stop=self._stop,
            changed=changed,
            room=self._look,
            closing=self._closing,
        )
        self._gatherer = Gatherer(self._jobs, self._news.put)
        self._leases = LeaseKeeper(
            store.leases, self._runner, lambda: self._jobs.active, self._heed
        )
        self._canceller = ThreadPoolExecutor(1, "job-canceller")
        self._thread = threading.Thread(target=self._work, name="job-dispatcher", daemon=True)

    def start(self) -> None:
        """Begin to claim jobs."""
        self._thread.start()

    def close(self) -> None:
        """Stop, and hand on what is under way."""
        self._closing.set()
        self.look()
        self._gatherer.close()
        self._canceller.shutdown(cancel_futures=True)
        self._cluster.close()
        if self._thread.is_alive():
            self._thread.join()
        self._leases.close()
        with suppress(Unavailable):
            self._store.leases.release(self._runner)

    def look(self) -> None:
        """There may be a job to claim."""
        self._news.put(self._look)

    def cancel(self, job: str) -> None:
        """Stop a job that is asked to, if it is under way here."""
        self._news.put(lambda: self._jobs.cancel(job))

    def progress(self, job: str) -> Progress | None:
        """How far a job under way here is."""
        return self._jobs.progress(job)

    def _heed(self, beat: Beat, known: frozenset[str]) -> None:
        self._news.put(lambda: self._jobs.heed(beat, known))

    def _stop(self, task: str) -> None:
        with suppress(RuntimeError):  # none is called while the service ends
            self._canceller.submit(self._cluster.cancel, task, GRACE)

    # The dispatcher's thread

    def _work(self) -> None:
        if not self._ready():
            return
        self._leases.start()
        while not self._closing.is_set():
            try:
                with suppress(queue.Empty):
                    self._news.get(timeout=LOOK_EVERY)()
                    while True:
                        self._news.get_nowait()()
                if self._taking():
                    self._claim()
                    self._gatherer.gather(self._jobs.active.values())
                    self._send_all()
                self._jobs.record_progress()
            except Closing:
                return
            except Unavailable as away:
                log.warning("jobs wait: %s", away)
                self._closing.wait(RETRY_AFTER)
            except Exception:
                log.exception("jobs wait")
                self._closing.wait(RETRY_AFTER)

    def _look(self) -> None:
        self._looked = 0.0

    def _claim(self) -> None:
        """Take as many jobs as keep the cluster busy, and have their payloads gathered."""
        now, share = time.monotonic(), AHEAD * self._width
        if now - self._looked < LOOK_EVERY:
            return
        self._looked = now
        if len(self._jobs.active) < share:
            self._claim_up_to(share)
            return
        self._claim_up_to(2 * share, least_priority=PROMPT)
        running = {active.job.session for active in self._jobs.active.values()}
        self._claim_up_to(3 * share, other_than=running)

    def _claim_up_to(self, most: int, **of: Any) -> None:
        if (room := most - len(self._jobs.active)) <= 0:
            return
        known = tuple(self._jobs.active)
        for job in self._store.leases.claim(
            self._runner, room, kinds=self._kinds.keys(), known=known, **of
        ):
            active = self._jobs.active[job.id] = ActiveJob(job, self._kinds[job.kind])
            if active.kind.division is None:
                active.lost[LAST] = job.attempts
            if job.cancel_asked:
                self._jobs.cancel(job.id)

    def _send_all(self) -> None:
        """Send units while there is room; nothing while the workers cannot be reached."""
        if time.monotonic() < self._away_until or not any(
            one.next is not None for one in self._jobs.active.values()
        ):
            return
        try:
            self._width = self._cluster.width()
            while not self._closing.is_set():
                if (active := chosen(self._jobs.active.values(), self._width)) is None:
                    return
                self._send(active)
        except Unavailable:
            self._away_until = time.monotonic() + RETRY_AFTER

    def _send(self, active: ActiveJob) -> None:
        """Send the next unit of a job; one that cannot be sent fails alone, and one whose parts
        cannot be read just now waits alone, unless it is the database or the cluster that is away:
        then all wait.
        """
        try:
            self._give(active)
        except NotFound:
            # It has ended elsewhere, and its parts went with it; or it is ours still, a part is
            # lost, and it is claimed again with the others.
            self._jobs.let_go(active)
        except Unavailable:
            raise
        except Exception as error:
            if isinstance(error, OSError) and trouble_of(error) is not None:
                raise
            self._jobs.fail_unforeseen(active, error)

    def _give(self, active: ActiveJob) -> None:
        unit, job, kind = active.next, active.job, active.kind
        assert unit is not None
        task, payload, kept = kind.task, active.payload, {}
        if unit == LAST:
            try:
                kept = self._jobs.parts(active)
            except Unavailable as away:
                log.warning("job %s waits for its parts: %s", job.id, away)
                active.send_at = time.monotonic() + RETRY_AFTER
                return
        else:
            assert kind.division is not None
            task, payload = kind.division.unit, {**payload, "unit": unit}
        sent = SentUnit(active, unit, self._jobs)
        self._cluster.submit(
            task_of(job.id, unit), task, payload, sent, kept=kept, priority=job.priority
        )
        if unit != LAST:
            active.waiting.popleft()
        active.running[unit] = sent
