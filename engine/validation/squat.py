"""How far a car squats: the step of its pitch from rest to late in the longest push."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..run import Run
from ..simulation.metrics import pushes

Array = NDArray[np.float64]

REST_BEFORE = 2.0
REST_GAP = 0.5
"""Pitch before a push is the mean over so many seconds, which end so many before it."""

LEAST_REST = 0.5
"""Shortest time before a push that is called one, s."""


@dataclass(frozen=True, slots=True)
class SquatWindow:
    """Where the squat of a run is read, (begin, end) in s: at rest, and late in the push."""

    rest: tuple[float, float]
    late: tuple[float, float]

    def step(self, run: Run) -> float:
        """Mean pitch late in the push less that before it, rad; negative with the nose up."""
        time, pitch = run.time, run["chassis.pitch"]
        before, during = (
            float(np.mean(pitch[(time >= begin) & (time <= end)]))
            for begin, end in (self.rest, self.late)
        )
        return during - before


def squat_window(run: Run) -> SquatWindow | None:
    """The later half of the longest time in which the car accelerates, and the rest before it."""
    during = pushes(run).get("squat")
    if during is None or "chassis.pitch" not in run:
        return None
    begin, end = _longest(run.time, during)
    rest_end = begin - REST_GAP
    rest_begin = max(float(run.time[0]), rest_end - REST_BEFORE)
    if rest_end - rest_begin < LEAST_REST:
        return None
    return SquatWindow((rest_begin, rest_end), (0.5 * (begin + end), end))


def _longest(time: Array, during: NDArray[np.bool_]) -> tuple[float, float]:
    """First and last instant of the longest stretch of samples that are true, of one at least."""
    edges = np.flatnonzero(np.diff(during.astype(np.int8), prepend=0, append=0))
    first, last = time[edges[::2]], time[edges[1::2] - 1]
    longest = np.argmax(last - first)
    return float(first[longest]), float(last[longest])
