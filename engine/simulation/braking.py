"""When a recorded car brakes: the intervals seen in a_x or marked, and the weight b(t) they give.

b is 1 inside an interval, 0 elsewhere, with linear ramps of 0.1 s outside its ends. It carries the
longitudinal force from the driven wheels to the braked ones.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import MeasurementError, VehicleError
from ..filters import smoothed
from ..frames import GRAVITY
from ..run import Run
from ..vehicle import Vehicle

Array = NDArray[np.float64]
Interval = tuple[float, float]

CUTOFF = 1.0
"""Low-pass under which a_x is looked at, Hz."""

MARGIN = 0.5
"""Deceleration beyond rolling resistance that means braking, m/s2."""

LASTS = 0.5
"""Shortest braking that is found, s."""

RAMP = 0.1


def braking_of(
    run: Run, slow_a_x: Array, vehicle: Vehicle, rolling: float
) -> tuple[list[Interval], list[str]]:
    """Where the run brakes, marked or else found in a_x, and warnings.

    slow_a_x : (samples,) of `slow_acceleration`, m/s2
    rolling : rolling resistance coefficient fr of the whole car

    Raises MeasurementError for marks that mean nothing in the run, VehicleError for marks on a
    vehicle without brakes. Braking that is found with such a vehicle is only told of.
    """
    intervals = find_braking(run.time, slow_a_x, rolling) if run.braking is None else _marked(run)
    if vehicle.brakes is not None or not intervals:
        return intervals, []
    if run.braking is not None:
        raise VehicleError(
            f"Braking is marked in run {run.name}, but the vehicle has no brakes; add "
            '"brakes": {"front_share": 0.65} with its own share to the vehicle.'
        )
    begin, end = intervals[0]
    return [], [
        f"Run {run.name} brakes from {begin:.1f} to {end:.1f} s, but the vehicle has no "
        "brakes, so the force is taken to act on the driven wheels; add "
        '"brakes": {"front_share": ...} to the vehicle.'
    ]


def _marked(run: Run) -> list[Interval]:
    """The marked intervals, cut to the record."""
    first, last = float(run.time[0]), float(run.time[-1])
    for begin, end in run.braking or ():
        if not begin < end:
            raise MeasurementError(
                f"Braking is marked in run {run.name} from {begin:g} to {end:g} s; give the "
                "begin first."
            )
        if end <= first or begin >= last:
            raise MeasurementError(
                f"Braking is marked in run {run.name} from {begin:g} to {end:g} s, but it lasts "
                f"from {first:g} to {last:g} s; mark a time in it."
            )
    return [(max(begin, first), min(end, last)) for begin, end in run.braking or ()]


def slow_acceleration(time: Array, a_x: Array) -> Array:
    """a_x (samples,) low-passed at 1 Hz, where braking shows."""
    return smoothed(time, a_x, CUTOFF)


def find_braking(time: Array, slow_a_x: Array, rolling: float) -> list[Interval]:
    """Where a_x, low-passed at 1 Hz, stays below -(fr g + 0.5 m/s2) for at least 0.5 s."""
    below = slow_a_x < -(rolling * GRAVITY + MARGIN)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], below, [False]]).astype(int)))
    spans = [(time[first], time[last - 1]) for first, last in edges.reshape(-1, 2)]
    return [(float(begin), float(end)) for begin, end in spans if end - begin >= LASTS]


def braking_weight(time: Array, intervals: Sequence[Interval]) -> Array:
    """b(t) of (begin, end) intervals, s."""
    weight = np.zeros_like(time)
    for begin, end in intervals:
        inside = 1.0 + np.minimum(time - begin, end - time) / RAMP
        weight = np.maximum(weight, np.clip(inside, 0.0, 1.0))
    return weight
