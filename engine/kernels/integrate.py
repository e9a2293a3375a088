"""Classical Runge-Kutta of order 4 over a batch of cars, for the free car and for given rims.

Each step k has its own length and three sets of inputs: at its beginning, middle and end, seen
from inside the step, so that a jump of the torque between two steps costs no order. States are
kept at the samples, or tallied there, or both.
"""

import numpy as np

from ..jit import compiled, inlined
from .buffer import (
    CAR,
    CAR_ROWS,
    NOW,
    REACH,
    SLOPE,
    STAGE,
    STATES,
    SUM,
    body_of,
    corner_of,
    given_to,
    keep_slope,
    keep_turn,
    keep_wheels,
    stage_state,
    turn_of,
)
from .constrained import rim_accelerations, rim_corner
from .contact import find_contacts, read_road
from .direct import accelerations, free_corner
from .forces import direction_of_travel
from .histogram import BINS, QUANTITIES, percentiles
from .kinematics import arm_pose, attitude, turn_by
from .records import RimInput, State
from .tally import TALLY_END, TALLY_ROWS, clear_tally, keep_tally, tally
from .weighing import set_filters, watch_point, weigh

_ANGLE_LIMIT = 1.5
"""rad: beyond it the polynomials of elementary.py lose accuracy and the car lies on its side."""
_HEIGHT_LIMIT = 10.0
"""m"""


@inlined
def slope_of(state, c, fl, fr, rl, rr):
    """Time derivative of a state with the given accelerations."""
    return State(
        state.x_rate,
        state.z_rate,
        state.pitch_rate,
        state.roll_rate,
        state.fl_rate,
        state.fr_rate,
        state.rl_rate,
        state.rr_rate,
        c.x,
        c.z,
        c.pitch,
        c.roll,
        fl,
        fr,
        rl,
        rr,
    )


@inlined
def free_car(buffer, LANES, j):
    """Attitude, corners and accelerations of a lane's free car at the stage, its contacts found."""
    state = stage_state(buffer, LANES, j)
    pitch, roll = turn_of(buffer, 0, LANES, j), turn_of(buffer, 1, LANES, j)
    chassis = attitude(pitch, roll, state.pitch_rate, state.roll_rate)
    way = direction_of_travel(state.x_rate)
    arm = arm_pose(state.fl, turn_of(buffer, 2, LANES, j), state.fl_rate)
    corner, given = corner_of(buffer, 0, LANES, j), given_to(buffer, 0, LANES, j)
    fl = free_corner(corner, chassis, state, arm, given, way)
    arm = arm_pose(state.fr, turn_of(buffer, 3, LANES, j), state.fr_rate)
    corner, given = corner_of(buffer, 1, LANES, j), given_to(buffer, 1, LANES, j)
    fr = free_corner(corner, chassis, state, arm, given, way)
    arm = arm_pose(state.rl, turn_of(buffer, 4, LANES, j), state.rl_rate)
    corner, given = corner_of(buffer, 2, LANES, j), given_to(buffer, 2, LANES, j)
    rl = free_corner(corner, chassis, state, arm, given, way)
    arm = arm_pose(state.rr, turn_of(buffer, 5, LANES, j), state.rr_rate)
    corner, given = corner_of(buffer, 3, LANES, j), given_to(buffer, 3, LANES, j)
    rr = free_corner(corner, chassis, state, arm, given, way)
    a = accelerations(body_of(buffer, LANES, j), chassis, fl, fr, rl, rr)
    return chassis, fl, fr, rl, rr, a


@inlined
def rims_at(u):
    """Prescribed motions of the four wheel centres in a row of stage inputs."""
    fl, fr = RimInput(u[0], u[4], u[8]), RimInput(u[1], u[5], u[9])
    rl, rr = RimInput(u[2], u[6], u[10]), RimInput(u[3], u[7], u[11])
    return fl, fr, rl, rr


@inlined
def car_on_rims(buffer, LANES, j, rims, a_x, way, b, exact):
    """Attitude, corners and accelerations of a lane's car on its rims at the stage."""
    state = stage_state(buffer, LANES, j)
    pitch, roll = turn_by(state.pitch), turn_by(state.roll)
    keep_turn(buffer, 0, LANES, j, pitch)
    keep_turn(buffer, 1, LANES, j, roll)
    chassis = attitude(pitch, roll, state.pitch_rate, state.roll_rate)
    z, z_rate = state.z, state.z_rate
    fl = rim_corner(corner_of(buffer, 0, LANES, j), chassis, z, z_rate, rims[0], way, b)
    fr = rim_corner(corner_of(buffer, 1, LANES, j), chassis, z, z_rate, rims[1], way, b)
    rl = rim_corner(corner_of(buffer, 2, LANES, j), chassis, z, z_rate, rims[2], way, b)
    rr = rim_corner(corner_of(buffer, 3, LANES, j), chassis, z, z_rate, rims[3], way, b)
    a = rim_accelerations(body_of(buffer, LANES, j), chassis, fl, fr, rl, rr, a_x, exact)
    return chassis, fl, fr, rl, rr, a


@inlined
def _free_slopes(buffer, LANES, given, driven):
    """Derivative of every lane's stage state, free car.

    given (16,) : row of stage inputs; driven : road, its start and spacing
    """
    road, start, spacing = driven
    find_contacts(buffer, LANES)
    read_road(buffer, LANES, given, road, start, spacing)
    for j in range(LANES):
        _, fl, fr, rl, rr, a = free_car(buffer, LANES, j)
        clearance = min(min(fl.clearance, fr.clearance), min(rl.clearance, rr.clearance))
        buffer[REACH * LANES + j] = min(buffer[REACH * LANES + j], clearance)
        travels = (fl.travel, fr.travel, rl.travel, rr.travel)
        keep_wheels(buffer, LANES, j, travels, (fl.load, fr.load, rl.load, rr.load))
        slope = slope_of(stage_state(buffer, LANES, j), a.chassis, a.fl, a.fr, a.rl, a.rr)
        keep_slope(buffer, LANES, j, slope)


@inlined
def _rim_slopes(buffer, LANES, given, driven):
    """Derivative of every lane's stage state, prescribed rims.

    given (15,) : row of stage inputs; driven : exact, 1.0 or 0.0
    """
    # Read before the loop: a second array inside it might alias the buffer.
    rims = rims_at(given)
    a_x, way, b = given[12], direction_of_travel(given[13]), given[14]
    for j in range(LANES):
        _, fl, fr, rl, rr, a = car_on_rims(buffer, LANES, j, rims, a_x, way, b, driven[0])
        reach = min(min(fl.reach, fr.reach), min(rl.reach, rr.reach))
        clearance = min(min(fl.clearance, fr.clearance), min(rl.clearance, rr.clearance))
        buffer[REACH * LANES + j] = min(buffer[REACH * LANES + j], min(reach, clearance))
        travels = (fl.travel, fr.travel, rl.travel, rr.travel)
        keep_wheels(buffer, LANES, j, travels, (a.fl_load, a.fr_load, a.rl_load, a.rr_load))
        # The arms follow from the chassis; their rows are not integrated.
        slope = slope_of(stage_state(buffer, LANES, j), a.chassis, 0.0, 0.0, 0.0, 0.0)
        keep_slope(buffer, LANES, j, slope)


@inlined
def _begin(buffer, LANES, cars, states, first):
    """Fill the lanes with cars from `first` on; lanes past the last car repeat it."""
    last = cars.shape[0] - 1
    for j in range(LANES):
        car = min(first + j, last)
        for row in range(CAR_ROWS):
            buffer[(CAR + row) * LANES + j] = cars[car, row]
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
def _integrate(
    slopes, driven, lanes, cars, states, inputs, steps, samples, watch, out, failed, reach, tallies
):
    """Drive every car; slopes (buffer, LANES, row of stage inputs, driven) finds derivatives."""
    LANES = len(lanes)
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
def integrate_free(
    lanes,
    cars,
    states,
    inputs,
    steps,
    samples,
    road,
    start,
    spacing,
    watch,
    out,
    failed,
    reach,
    tallies,
):
    """Road and posts modes.

    lanes : tuple, its length is the number of cars side by side
    cars (C, CAR_ROWS) : records of `car_rows.car_row`
    states (C, 16) : at the first instant
    inputs (n, 3, 16) : post heights (4), their rates (4), drive torques (4), brake torques (4)
        at the beginning, middle and end of each step
    steps (n,) : step lengths, s
    samples (n + 1,) : index of the sample before step k, or -1
    road (2, cells, 4), start, spacing : cubics of `road.Road`, left and right
    watch : `Watch` of what is tallied
    out (C, S, 16) : states at the samples, or (C, 0, 16) where they are not kept
    failed (C,) : set to the first sample at which a car left the model's range, else left alone
    reach (C,) : likewise to the least reach of its arms and clearance of its mounts until then
    tallies (C, TALLY_ROWS + QUANTITIES P) : rows of `tally.py` and percentiles, or (C, 0)
    """
    driven = (road, start, spacing)
    _integrate(
        _free_slopes,
        driven,
        lanes,
        cars,
        states,
        inputs,
        steps,
        samples,
        watch,
        out,
        failed,
        reach,
        tallies,
    )


@compiled
def integrate_rims(
    lanes, cars, states, inputs, steps, samples, exact, watch, out, failed, reach, tallies
):
    """Rims mode; arguments as in `integrate_free`, but

    inputs (n, 3, 15) : u (4), u' (4), u'' (4), a_x, v_x and the braking weight b
    exact : 1.0 for the exact traction, 0.0 for the paper's
    out : x, z, pitch, roll and their rates are valid; the arms follow from them
    """
    driven = (exact,)
    _integrate(
        _rim_slopes,
        driven,
        lanes,
        cars,
        states,
        inputs,
        steps,
        samples,
        watch,
        out,
        failed,
        reach,
        tallies,
    )
