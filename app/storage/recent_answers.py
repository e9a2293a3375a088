"""Who was let in a moment ago, so that one who asks a hundred times a second is looked up once.

Only that somebody may is remembered, never that they may not. What this service takes away, it
forgets at once; what another process takes away goes on for `SECONDS` at most.
"""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable

SECONDS = 1.0
MOST = 10_000


class RecentAnswers:
    """Answers by question, the oldest first; may be used from any thread."""

    def __init__(self, *, most: int = MOST, clock: Callable[[], float] = time.monotonic):
        self._most, self._clock = most, clock
        self._kept: OrderedDict[Hashable, tuple[str, float]] = OrderedDict()
        self._forgotten = 0
        self._lock = threading.Lock()

    def recall(self, question: Hashable) -> str | None:
        """An answer of less than `SECONDS` ago, or None."""
        with self._lock:
            answer, since = self._kept.get(question, (None, 0.0))
            return answer if self._clock() < since + SECONDS else None

    def ask(self, question: Hashable, look: Callable[[], str]) -> str:
        """What `look` answers, remembered from when it was asked; what it raises is not."""
        began, forgotten = self._clock(), self._forgotten
        answer = look()
        with self._lock:
            # It may have looked before that was taken away which `forget` stands for.
            if forgotten == self._forgotten:
                self._kept[question] = answer, began
                self._kept.move_to_end(question)
                self._let_go(began)
        return answer

    def forget(self) -> None:
        """Ask anew whatever is asked, since some of it was taken away."""
        with self._lock:
            self._forgotten += 1
            self._kept.clear()

    def _let_go(self, now: float) -> None:
        while self._kept:
            oldest, (_, since) = next(iter(self._kept.items()))
            if len(self._kept) <= self._most and now < since + SECONDS:
                return
            del self._kept[oldest]
