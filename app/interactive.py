"""Interactive simulations: a thread pool as wide as the cores, and a short queue before it.

A wider pool would not compute faster, it would only take the event loop's share of Python's lock.
A session that drags a slider keeps one or two simulations under way; more than its share is refused
at once so that nobody else waits.
"""

import asyncio
import os
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from .errors import Busy, Unavailable
from .settings import Limits

T = TypeVar("T")


class Interactive:
    """Runs short functions for sessions; used from the event loop only."""

    def __init__(self, limits: Limits, width: int | None = None):
        self._limits = limits
        self._pool = ThreadPoolExecutor(width or os.cpu_count() or 1, "interactive")
        self._under_way: Counter[str] = Counter()

    async def run(self, session: str, work: Callable[[], T]) -> T:
        """Result of `work`, run for a session; `Busy` or `Unavailable` where too much waits."""
        if self._under_way[session] >= self._limits.session_simulations:
            raise Busy(
                f"The session already has {self._under_way[session]} simulations under way; wait "
                "for one of them.",
                retry_after=1,
            )
        if self._under_way.total() >= self._limits.waiting_simulations:
            raise Unavailable("The service is busy; try again in a moment.", retry_after=1)
        self._under_way[session] += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(self._pool, work)
        finally:
            self._under_way[session] -= 1
            if not self._under_way[session]:
                del self._under_way[session]

    def close(self) -> None:
        """Wait for what runs, forget what waits."""
        self._pool.shutdown(cancel_futures=True)
