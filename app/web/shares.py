"""What has no end of its own, such as an event stream: a session has so many open at a time."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import Busy

RETRY_AFTER = 5


class Shares:
    """One session's share of something, and who has how much of it; for the event loop."""

    def __init__(self, most: int, refusal: str):
        """refusal : a sentence with {} for how many are open"""
        self._most, self._refusal = most, refusal
        self._open: Counter[str] = Counter()

    @contextmanager
    def one_more(self, session: str) -> Iterator[None]:
        """A block in which one more is open; Busy where that is too much."""
        if self._open[session] >= self._most:
            raise Busy(self._refusal.format(self._open[session]), retry_after=RETRY_AFTER)
        self._open[session] += 1
        try:
            yield
        finally:
            self._open[session] -= 1
            if not self._open[session]:
                del self._open[session]

    def of(self, session: str) -> int:
        """How many a session has open."""
        return self._open[session]
