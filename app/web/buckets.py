"""Token buckets: so much at once, and so much a second after that."""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable

KEPT = 10_000


class Buckets:
    """One bucket for each key, full at first; may be used from any thread.

    Of keys that were not used for long the oldest are forgotten, which fills their buckets.
    """

    def __init__(
        self,
        rate: float,
        burst: float,
        *,
        kept: int = KEPT,
        clock: Callable[[], float] = time.monotonic,
    ):
        self._rate, self._burst, self._kept, self._clock = rate, burst, kept, clock
        self._levels: OrderedDict[Hashable, tuple[float, float]] = OrderedDict()
        self._lock = threading.Lock()

    def take(self, key: Hashable, tokens: float = 1.0) -> float:
        """Take tokens, at most a full bucket; 0, or the seconds until so many are there."""
        tokens = min(tokens, self._burst)
        with self._lock:
            now = self._clock()
            level, since = self._levels.pop(key, (self._burst, now))
            level = min(self._burst, level + self._rate * (now - since))
            lacking = max(0.0, tokens - level)
            self._levels[key] = (level if lacking else level - tokens, now)
            if len(self._levels) > self._kept:
                self._levels.popitem(last=False)
        return lacking / self._rate

    def put_back(self, key: Hashable, tokens: float = 1.0) -> None:
        """What was taken and not used after all."""
        with self._lock:
            if key in self._levels:
                level, since = self._levels[key]
                self._levels[key] = min(self._burst, level + min(tokens, self._burst)), since
