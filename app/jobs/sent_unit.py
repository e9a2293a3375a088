"""A unit of a job that was given to the cluster, and what that tells of it."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from .active_job import ActiveJob
from .worker import Ending


class Hearer(Protocol):
    """Who hears what becomes of units, one after the other, in a thread of its own."""

    def hear(self, sent: "SentUnit", then: Callable[[], None]) -> None:
        """Have `then` called in its turn, unless the unit does not run here any more by then."""

    def started(self, sent: "SentUnit") -> None:
        """A worker has taken it up."""

    def told(self, sent: "SentUnit", progress: Mapping[str, Any]) -> None:
        """How far it has come."""

    def kept(self, sent: "SentUnit", part: str, data: bytes) -> None:
        """A part that it made on its way."""

    def ended(self, sent: "SentUnit", ending: Ending) -> None:
        """It is done, has failed or has stopped."""

    def lost(self, sent: "SentUnit", *, with_worker: bool) -> None:
        """It may be sent again."""


class SentUnit:
    """One attempt at a unit: what is told of an earlier one is not of it.

    Everything told waits to be heard, in order, but of progress only the latest: while the
    database is away, hours of it would fill the memory.
    """

    def __init__(self, active: ActiveJob, unit: str, hearer: Hearer):
        self.active, self.unit = active, unit
        self._hearer = hearer
        self._progress: Mapping[str, Any] = {}
        self._progress_waits = False

    def task_started(self, task: str) -> None:
        """As the cluster tells it, in any thread, like all that follow."""
        self._hearer.hear(self, lambda: self._hearer.started(self))

    def task_progressed(self, task: str, progress: Mapping[str, Any]) -> None:
        """Take the place of progress that nobody has heard of yet."""
        self._progress = progress
        if not self._progress_waits:
            self._progress_waits = True
            self._hearer.hear(self, self._tell_latest)

    def task_kept(self, task: str, part: str, data: bytes) -> None:
        """Hand on a part."""
        self._hearer.hear(self, lambda: self._hearer.kept(self, part, data))

    def task_ended(self, task: str, ending: Ending) -> None:
        """Hand on the end."""
        self._hearer.hear(self, lambda: self._hearer.ended(self, ending))

    def task_lost(self, task: str, *, with_worker: bool) -> None:
        """Hand on that there is none."""
        self._hearer.hear(self, lambda: self._hearer.lost(self, with_worker=with_worker))

    def _tell_latest(self) -> None:
        # In this order: what is told in between is heard now, and perhaps once more.
        self._progress_waits = False
        self._hearer.told(self, self._progress)
