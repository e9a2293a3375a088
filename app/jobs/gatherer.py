"""What jobs need is gathered in threads, because files may have to be read."""

import logging
import math
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol

from ...engine.errors import RideError
from .. import logs
from ..errors import Unavailable
from .active_job import ActiveJob

log = logging.getLogger(__name__)

GATHER_AGAIN_AFTER = 2.0
"""Time after which what could not be had is looked for again, s."""

THREADS = 2


class Gathering(Protocol):
    """Who is told what was gathered."""

    def gathered(self, active: ActiveJob, payload: Any, units: Sequence[str], slow: bool) -> None:
        """A job's payload, the names of its units and whether they are slow."""

    def fail(self, active: ActiveJob, code: str, detail: str) -> None:
        """It cannot be gathered."""

    def fail_unforeseen(self, active: ActiveJob, error: Exception) -> None:
        """It cannot be gathered, and the log has to say why."""


class Gatherer:
    """Gathers what a job is sent with, and says so in the dispatcher's thread."""

    def __init__(self, gathering: Gathering, say: Callable[[Callable[[], None]], None]):
        """say : has something called in the dispatcher's thread"""
        self._gathering, self._say = gathering, say
        self._threads = ThreadPoolExecutor(THREADS, "job-gatherer")

    def gather(self, jobs: Iterable[ActiveJob]) -> None:
        """Begin with those whose time has come."""
        for active in jobs:
            if active.gather_at <= time.monotonic():
                active.gather_at = math.inf
                self._threads.submit(self._gather, active)

    def close(self) -> None:
        """Wait for what is being gathered."""
        self._threads.shutdown(cancel_futures=True)

    def _gather(self, active: ActiveJob) -> None:
        job, division = active.job, active.kind.division
        try:
            with logs.about(job=job.id):
                payload = active.kind.payload(job)
                units = () if division is None else tuple(division.names(job.spec))
                slow = division is not None and division.slow(job.spec)
        except Unavailable as away:
            log.warning("job %s waits to be gathered: %s", job.id, away)
            self._say(lambda: self._later(active))
        except RideError as error:
            code, detail = error.code, str(error)
            self._say(lambda: self._gathering.fail(active, code, detail))
        except Exception as error:
            found = error
            self._say(lambda: self._gathering.fail_unforeseen(active, found))
        else:
            self._say(lambda: self._gathering.gathered(active, payload, units, slow))

    def _later(self, active: ActiveJob) -> None:
        active.gather_at = time.monotonic() + GATHER_AGAIN_AFTER
