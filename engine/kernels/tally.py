"""Sums and extremes of each car, kept while it drives: memory grows with neither time nor cars.

At every sample a lane's quantities enter its tally: weighted accelerations of a point, the motion
of the body, travels and tyre loads. `reductions.py` makes figures of them.
"""

from typing import NamedTuple

from ..jit import inlined
from .buffer import LOADS, TRAVELS, corner_of, stage_state
from .histogram import LOAD_FROM, LOAD_TO, TRAVEL_FROM, TRAVEL_TO, bin_of, count
from .lanes import loader, storer
from .weighing import (
    FILTERS_END,
    HORIZONTAL,
    IN_HORIZONTAL_OUTPUT,
    IN_VERTICAL_OUTPUT,
    POINT,
    VERTICAL,
    X_FILTER,
    Y_FILTER,
    Z_FILTER,
    weighted,
)

FAR = 1e300
"""Beyond every extreme."""


class PointTally(NamedTuple):
    """Weighted accelerations, m/s2: sums over the samples, the fourth power a mean over time."""

    x_square: float
    y_square: float
    z_square: float
    z_fourth: float
    z_running: float
    """Sum of the squares of the last second."""
    z_worst: float
    """Greatest of those."""


class BodyTally(NamedTuple):
    """Means over time of the body's motion and of its squares, and extremes of the pitch; SI."""

    z: float
    z_square: float
    pitch: float
    pitch_square: float
    roll: float
    roll_square: float
    pitch_most: float
    pitch_least: float
    pushed_pitch: float
    """Mean while the car accelerates."""
    braked_pitch: float
    """Mean while it brakes."""


class WheelTally(NamedTuple):
    """The same of travel and tyre load at one wheel; SI."""

    travel: float
    travel_square: float
    travel_most: float
    travel_least: float
    load: float
    load_square: float
    load_most: float
    load_least: float
    lifted: float
    """Samples without load."""


SQUARE = FILTERS_END
"""Weighted acceleration's square that leaves the last second, then the one that enters it."""
IN_BINS = SQUARE + 1
"""Bin of each wheel's travel and load."""
POINT_TALLY = IN_BINS + 8
BODY_TALLY = POINT_TALLY + len(PointTally._fields)
WHEEL_TALLY = BODY_TALLY + len(BodyTally._fields)
WHEEL_TALLY_ROWS = len(WheelTally._fields)
TALLY_END = WHEEL_TALLY + 4 * WHEEL_TALLY_ROWS
TALLY_ROWS = TALLY_END - POINT_TALLY

_load_point, _store_point = loader(PointTally), storer(PointTally)
_load_body, _store_body = loader(BodyTally), storer(BodyTally)
_load_wheel, _store_wheel = loader(WheelTally), storer(WheelTally)


@inlined
def clear_tally(buffer, LANES):
    """Begin anew: filters and sums at 0, extremes far off."""
    for k in range(LANES * POINT, LANES * TALLY_END):
        buffer[k] = 0.0
    for j in range(LANES):
        zero = 0.0
        body = BodyTally(zero, zero, zero, zero, zero, zero, -FAR, FAR, zero, zero)
        wheel = WheelTally(zero, zero, -FAR, FAR, zero, zero, -FAR, FAR, zero)
        _store_body(buffer, BODY_TALLY, LANES, j, body)
        for corner in range(4):
            _store_wheel(buffer, WHEEL_TALLY + corner * WHEEL_TALLY_ROWS, LANES, j, wheel)


@inlined
def tally(buffer, LANES, watch, sample, ring, counts):
    """Add a sample of every lane.

    ring (window, LANES) : squares of the last second; counts : see `count`
    """
    weight = watch.weights[sample, 0]
    leaving = ring[sample % watch.window]
    for j in range(LANES):
        buffer[SQUARE * LANES + j] = leaving[j]
    _tally_point(buffer, LANES, weight)
    for j in range(LANES):
        leaving[j] = buffer[SQUARE * LANES + j]
    _tally_body(buffer, LANES, weight, watch.weights[sample, 1], watch.weights[sample, 2])
    _tally_wheels(buffer, LANES, weight)
    count(buffer, LANES, IN_BINS, counts)


@inlined
def keep_tally(buffer, LANES, lane, out):
    """Write a lane's tally (TALLY_ROWS,)."""
    for row in range(TALLY_ROWS):
        out[row] = buffer[(POINT_TALLY + row) * LANES + lane]


@inlined
def _tally_point(buffer, LANES, weight):
    """Add the weighted accelerations."""
    for j in range(LANES):
        x = weighted(buffer, LANES, j, X_FILTER, HORIZONTAL, IN_HORIZONTAL_OUTPUT)
        y = weighted(buffer, LANES, j, Y_FILTER, HORIZONTAL, IN_HORIZONTAL_OUTPUT)
        z = weighted(buffer, LANES, j, Z_FILTER, VERTICAL, IN_VERTICAL_OUTPUT)
        square = z * z
        t = _load_point(buffer, POINT_TALLY, LANES, j)
        running = t.z_running + square - buffer[SQUARE * LANES + j]
        buffer[SQUARE * LANES + j] = square
        new = PointTally(
            t.x_square + x * x,
            t.y_square + y * y,
            t.z_square + square,
            t.z_fourth + weight * square * square,
            running,
            max(t.z_worst, running),
        )
        _store_point(buffer, POINT_TALLY, LANES, j, new)


@inlined
def _tally_body(buffer, LANES, weight, pushed, braked):
    """Add bounce, pitch and roll."""
    for j in range(LANES):
        state = stage_state(buffer, LANES, j)
        z, pitch, roll = state.z, state.pitch, state.roll
        t = _load_body(buffer, BODY_TALLY, LANES, j)
        new = BodyTally(
            t.z + weight * z,
            t.z_square + weight * z * z,
            t.pitch + weight * pitch,
            t.pitch_square + weight * pitch * pitch,
            t.roll + weight * roll,
            t.roll_square + weight * roll * roll,
            max(t.pitch_most, pitch),
            min(t.pitch_least, pitch),
            t.pushed_pitch + pushed * pitch,
            t.braked_pitch + braked * pitch,
        )
        _store_body(buffer, BODY_TALLY, LANES, j, new)


@inlined
def _tally_wheels(buffer, LANES, weight):
    """Add travels and tyre loads."""
    for corner in range(4):
        first = WHEEL_TALLY + corner * WHEEL_TALLY_ROWS
        for j in range(LANES):
            travel = buffer[(TRAVELS + corner) * LANES + j]
            load = buffer[(LOADS + corner) * LANES + j]
            t = _load_wheel(buffer, first, LANES, j)
            new = WheelTally(
                t.travel + weight * travel,
                t.travel_square + weight * travel * travel,
                max(t.travel_most, travel),
                min(t.travel_least, travel),
                t.load + weight * load,
                t.load_square + weight * load * load,
                max(t.load_most, load),
                min(t.load_least, load),
                t.lifted + (1.0 if load <= 0.0 else 0.0),
            )
            _store_wheel(buffer, first, LANES, j, new)
            car = corner_of(buffer, 4 * LANES, corner * LANES + j)
            place = bin_of(travel / car.rest_length, TRAVEL_FROM, TRAVEL_TO)
            buffer[(IN_BINS + 2 * corner) * LANES + j] = place
            place = bin_of(load / car.static_load, LOAD_FROM, LOAD_TO)
            buffer[(IN_BINS + 2 * corner + 1) * LANES + j] = place
