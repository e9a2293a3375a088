"""Classical Runge-Kutta of order 4 over a batch of cars, for the free car and for given rims.

Each step k has its own length and three sets of inputs: at its beginning, middle and end, seen
from inside the step, so that a jump of the torque between two steps costs no order. States are
kept at the samples, or tallied there, or both.
"""

from typing import NamedTuple

import numpy as np

from ..jit import compiled, inlined
from .buffer import NOW, REACH, SLOPE, STAGE, STATES, SUM, take_car
from .free import free_slopes
from .histogram import BINS, QUANTITIES, percentiles
from .on_rims import rim_slopes
from .tally import TALLY_END, TALLY_ROWS, clear_tally, keep_tally, tally
from .watch import Watch
from .weighing import set_filters, watch_point, weigh

_ANGLE_LIMIT = 1.5
"""rad: beyond it the polynomials of elementary.py lose accuracy and the car lies on its side."""
_HEIGHT_LIMIT = 10.0
"""m"""


class Course(NamedTuple):
    """What all cars are driven by.

    inputs (n, 3, 16 or 15) : stage inputs at the beginning, middle and end of each step
    steps (n,) : step lengths, s
    samples (n + 1,) : index of the sample before step k, or -1
    """

    inputs: np.ndarray
    steps: np.ndarray
    samples: np.ndarray


class Batch(NamedTuple):
    """Cars that are driven, and where is written what becomes of them.

    cars (C, CAR_ROWS) : records of `car_rows.car_row`
    states (C, 16) : at the first instant
    watch : what is tallied
    out (C, S, 16) : states at the samples, or (C, 0, 16) where they are not kept
    failed (C,) : set to the first sample at which a car left the model's range, else left alone
    reach (C,) : likewise to the least reach of its arms and clearance of its mounts until then
    tallies (C, TALLY_ROWS + QUANTITIES P) : rows of `tally.py` and percentiles, or (C, 0)
    """

    cars: np.ndarray
    states: np.ndarray
    watch: Watch
    out: np.ndarray
    failed: np.ndarray
    reach: np.ndarray
    tallies: np.ndarray


@inlined
def _begin(buffer, LANES, cars, states, first):
    """Fill the lanes with cars from `first` on; lanes past the last car repeat it."""
    last = cars.shape[0] - 1
    for j in range(LANES):
        car = min(first + j, last)
        take_car(buffer, LANES, j, cars[car])
        for row in range(STATES):
            buffer[(NOW + row) * LANES + j] = states[car, row]
        buffer[REACH * LANES + j] = 1.0


@inlined
def _set_out(buffer, LANES):
    """First stage of a step: at its beginning."""
    for k in range(STATES * LANES):
        buffer[STAGE * LANES + k] = buffer[NOW * LANES + k]
        buffer[SUM * LANES + k] = 0.0


@inlined
def _advance(buffer, LANES, stage, h):
    """Weigh the slope just found into the step and move to the next stage, or end the step."""
    weight = h / 3.0 if stage == 1 or stage == 2 else h / 6.0
    ahead = 0.5 * h if stage < 2 else h
    for k in range(STATES * LANES):
        slope = buffer[SLOPE * LANES + k]
        total = buffer[SUM * LANES + k] + weight * slope
        buffer[SUM * LANES + k] = total
        now = buffer[NOW * LANES + k]
        buffer[STAGE * LANES + k] = now + ahead * slope
        buffer[NOW * LANES + k] = now + total if stage == 3 else now


@inlined
def _check(buffer, LANES, failed, reach, first, sample):
    """Note the cars that have left the model's range; returns whether any is still sound."""
    sound_left = False
    for j in range(LANES):
        car = first + j
        if car < failed.shape[0]:
            sound = abs(buffer[1 * LANES + j]) < _HEIGHT_LIMIT and buffer[REACH * LANES + j] >= 0.0
            for row in range(2, 8):
                sound = sound and abs(buffer[row * LANES + j]) < _ANGLE_LIMIT
            if not sound and failed[car] < 0:
                failed[car] = sample
                reach[car] = buffer[REACH * LANES + j]
            sound_left = sound_left or sound
    return sound_left


@inlined
def _keep(buffer, LANES, out, first, sample):
    """Write the lanes' states as a sample."""
    for j in range(LANES):
        car = first + j
        if car < out.shape[0]:
            for row in range(STATES):
                out[car, sample, row] = buffer[row * LANES + j]


@inlined
def _stages(inputs):
    """Stages of a step, four. Read from an array's shape, so that the compiler does not know it:
    it would write the accelerations out four times, and the code would leave the cache.
    """
    return inputs.shape[1] + 1


@inlined
def _integrate(slopes, driven, lanes, course, batch):
    """Drive every car; slopes (buffer, LANES, row of stage inputs, driven) finds derivatives."""
    LANES = len(lanes)
    inputs, steps, samples = course
    cars, states, watch, out, failed, reach, tallies = batch
    buffer = np.zeros(TALLY_END * LANES)
    # A car by itself is not tallied, which spares compiling it.
    keeping, tallying = out.shape[1] > 0, LANES > 1 and tallies.shape[1] > 0
    ring = np.zeros((watch.window, LANES))
    counts = np.zeros((QUANTITIES, BINS if tallying else 0, LANES), dtype=np.int32)
    last, kind = steps.shape[0], -1
    for first in range(0, cars.shape[0], LANES):
        _begin(buffer, LANES, cars, states, first)
        if tallying:
            ring[:] = 0.0
            counts[:] = 0
            clear_tally(buffer, LANES)
        for k in range(last + 1):
            sample = samples[k]
            if sample >= 0:
                if not _check(buffer, LANES, failed, reach, first, sample):
                    break
                if keeping:
                    _keep(buffer, LANES, out, first, sample)
            if k == last and not tallying:
                break
            _set_out(buffer, LANES)
            if tallying and k < last and watch.kinds[k] != kind:
                kind = watch.kinds[k]
                set_filters(buffer, LANES, watch, kind)
            # The last sample's accelerations take one more stage.
            step, stages = (k, _stages(inputs)) if k < last else (k - 1, 1)
            for stage in range(stages):
                given = inputs[step, (stage + 1) // 2 if k < last else 2]
                slopes(buffer, LANES, given, driven)
                if tallying:
                    watch_point(buffer, LANES, stage, watch.point)
                    if stage == 0 and sample >= 0:
                        tally(buffer, LANES, watch, sample, ring, counts)
                _advance(buffer, LANES, stage, steps[step])
            if tallying:
                weigh(buffer, LANES)
        if tallying:
            for j in range(min(LANES, cars.shape[0] - first)):
                keep_tally(buffer, LANES, j, tallies[first + j])
                percentiles(buffer, LANES, j, counts, watch.shares, tallies[first + j, TALLY_ROWS:])


@compiled
def integrate_free(lanes, course, batch, road, start, spacing):
    """Road and posts modes.

    lanes : tuple, its length is the number of cars side by side
    course : a `Course` of post heights (4), their rates (4), drive torques (4), brake torques (4)
    batch : a `Batch`
    road (2, cells, 4), start, spacing : cubics of `road.Road`, left and right
    """
    _integrate(free_slopes, (road, start, spacing), lanes, course, batch)


@compiled
def integrate_rims(lanes, course, batch, exact):
    """Rims mode; arguments as in `integrate_free`, but

    course : of u (4), u' (4), u'' (4), a_x, v_x and the braking weight b
    exact : 1.0 for the exact traction, 0.0 for the paper's

    Of the states written x, z, pitch, roll and their rates are valid; the arms follow from them.
    """
    _integrate(rim_slopes, (exact,), lanes, course, batch)
