"""How long something takes: median and minimum of repetitions, on one core unless told."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from statistics import median
from typing import Any

Clock = Callable[[], float]


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds that something took, each repetition by itself."""

    repetitions: tuple[float, ...]

    @property
    def median(self) -> float:
        """Median, s."""
        return median(self.repetitions)

    @property
    def fastest(self) -> float:
        """Minimum, s."""
        return min(self.repetitions)


@dataclass(frozen=True, slots=True)
class Pace:
    """How often to repeat: at least `fewest` times, and for at least `seconds` in all."""

    fewest: int = 5
    seconds: float = 1.0

    def measure(self, work: Callable[[], Any], clock: Clock = time.process_time) -> Timing:
        """Time some work after one go that does not count.

        clock : the process's own time on its cores; `time.perf_counter` where several work at once
        """
        return self.alternate(work, clock=clock)[0]

    def alternate(
        self, *works: Callable[[], Any], clock: Clock = time.process_time
    ) -> tuple[Timing, ...]:
        """Time several works in turn, so that what else the machine does meets all alike."""
        for work in works:
            work()
        taken: list[list[float]] = [[] for _ in works]
        while len(taken[0]) < self.fewest or sum(map(sum, taken)) < self.seconds:
            for work, repetitions in zip(works, taken, strict=True):
                began = clock()
                work()
                repetitions.append(clock() - began)
        return tuple(Timing(tuple(repetitions)) for repetitions in taken)


THOROUGH, QUICK = Pace(), Pace(fewest=2, seconds=0.0)


def ratio(one: Timing, other: Timing) -> float:
    """How many times longer one takes than the other, the median over turns taken together."""
    return median(a / b for a, b in zip(one.repetitions, other.repetitions, strict=True))


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process on one of its cores; the engine then works in one thread."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)
