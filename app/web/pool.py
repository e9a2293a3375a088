"""Work of requests that must not be done all at once: a thread pool, and a short queue before it.

A session has its share of what is under way; more than that is refused at once so that nobody else
waits, and what would wait too long is refused with the time after which to try again. Whoever waits
holds no thread.
"""

import asyncio
import math
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from contextvars import copy_context
from typing import TypeVar

from ..errors import Busy, Unavailable

T = TypeVar("T")

RECENT = 0.2
"""Weight of the last function in how long one usually takes."""


class Pool:
    """Runs functions for sessions; used from the event loop only."""

    def __init__(
        self,
        what: str,
        width: int,
        *,
        share: int,
        most: int,
        at_once: int,
        retry_after: int = 1,
        worked: Callable[[float, float], None] = lambda waited, ran: None,
        clock: Callable[[], float] = time.perf_counter,
    ):
        """Keyword arguments are numbers of functions, but for the last three.

        what : what is done, for sentences
        width : run at once;  most : under way, waiting ones included
        share, at_once : of one session, under way and running
        retry_after : s after which who is refused may try again, at least
        worked : hears how long each function waited and ran, s
        """
        self._what = what
        self._width = width
        self._share, self._most, self._at_once = share, most, at_once
        self._retry_after = retry_after
        self._worked, self._clock = worked, clock
        self._lock = threading.Lock()
        self._usual = 0.0
        self.running = 0
        """How many functions run."""
        self._pool = ThreadPoolExecutor(width, what.replace(" ", "-"))
        self._under_way: Counter[str] = Counter()
        self._turns: dict[str, asyncio.Semaphore] = {}

    @property
    def under_way(self) -> int:
        """How many functions run or wait."""
        return self._under_way.total()

    async def run(self, session: str, work: Callable[[], T]) -> T:
        """Result of `work`, run for a session; `Busy` or `Unavailable` where too much waits."""
        if self._under_way[session] >= self._share:
            raise Busy(
                f"The session already has {self._under_way[session]} {self._what} under way; wait "
                "for one of them.",
                retry_after=self._time_for(1),
            )
        if self.under_way >= self._most:
            raise Unavailable(
                f"The service is busy with {self.under_way} {self._what}; try again in a moment.",
                retry_after=self._time_for(self.under_way),
            )
        asked = self._clock()
        self._under_way[session] += 1
        turn = self._turns.setdefault(session, asyncio.Semaphore(self._at_once))
        with ExitStack() as whole:
            whole.callback(self._over, session)
            await turn.acquire()
            whole.callback(turn.release)
            # What its log records are about goes along.
            known = copy_context()
            begun = self._pool.submit(self._timed, asked, lambda: known.run(work))
            ended, over = asyncio.wrap_future(begun), whole.pop_all()
        ended.add_done_callback(lambda _: over.close())
        try:
            return await asyncio.shield(ended)
        except asyncio.CancelledError:
            # What runs already cannot be stopped, and is under way for as long as it takes.
            begun.cancel()
            raise

    def _over(self, session: str) -> None:
        self._under_way[session] -= 1
        if not self._under_way[session]:
            del self._under_way[session], self._turns[session]

    def _timed(self, asked: float, work: Callable[[], T]) -> T:
        """On a thread of the pool."""
        began = self._clock()
        with self._lock:
            self.running += 1
        try:
            return work()
        finally:
            ran = self._clock() - began
            with self._lock:
                self.running -= 1
                self._usual += RECENT * (ran - self._usual)
            self._worked(began - asked, ran)

    def _time_for(self, functions: int) -> int:
        """Whole seconds in which so many are done, going by the recent ones."""
        return max(self._retry_after, math.ceil(self._usual * functions / self._width))

    def close(self) -> None:
        """Wait for what runs, forget what waits."""
        self._pool.shutdown(cancel_futures=True)
