"""A process's leases of jobs, renewed as long as it lives."""

import logging
import threading
from collections.abc import Callable, Collection

from ..storage.job_leases import Beat, JobLeases

log = logging.getLogger(__name__)

BEAT_EVERY = 1.0
"""Time between two heartbeats, s."""


class LeaseKeeper:
    """A thread of its own, so that no work keeps it from renewing them."""

    def __init__(
        self,
        leases: JobLeases,
        runner: str,
        known: Callable[[], Collection[str]],
        heed: Callable[[Beat, frozenset[str]], None],
    ):
        """known : the jobs that the runner runs by what it knows

        heed : hears, in this thread, a beat that tells of one to stop or of one that is not the
            runner's any more, and what was known before it
        """
        self._leases, self._runner = leases, runner
        self._known, self._heed = known, heed
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="job-leases", daemon=True)

    def start(self) -> None:
        """Begin to renew them."""
        self._thread.start()

    def close(self) -> None:
        """Stop; they run out unless they are released."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def _beat(self) -> None:
        while not self._ended.wait(BEAT_EVERY):
            if not (known := frozenset(self._known())):
                continue
            try:
                beat = self._leases.heartbeat(self._runner)
            except Exception as error:
                log.warning("leases of jobs are not renewed: %s", error)
                continue
            if beat.cancel_asked or known - beat.jobs:
                self._heed(beat, known)
