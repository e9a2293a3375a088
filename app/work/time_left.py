"""How long the searches of a fit from many starts still take, where that can be told."""

import time
from collections.abc import Callable

from ...engine.identification.fit import Progress, Stage

FIRST_OTHER = 2
"""Number of the first search that does not begin at the told start: it may be cut short, and only
what such took tells how long the others take."""


class SearchClock:
    """Looks at the progress of one fit, and estimates from the searches that have ended.

    noise_follows : whether noise is to be found after them, nobody knows in how many evaluations
    """

    def __init__(self, *, noise_follows: bool, now: Callable[[], float] = time.monotonic):
        self._noise_follows = noise_follows
        self._now = now
        self._began: dict[int, float] = {}

    def left(self, progress: Progress) -> float | None:
        """Seconds until the last search has ended, if each still to come takes as long as those
        from other starts did on the average; None before one of them has ended, and once the
        one under way has outlasted them.
        """
        if progress.stage != Stage.SEARCHING or self._noise_follows:
            return None
        now = self._now()
        began = self._began.setdefault(progress.search, now)
        ended = progress.search - FIRST_OTHER
        if ended < 1:
            return None
        each = (began - self._began[FIRST_OTHER]) / ended
        rest = each - (now - began)
        return each * (progress.searches - progress.search) + rest if rest >= 0.0 else None
