"""Classical Runge-Kutta of order 4 over a batch of cars, for the free car and for given rims.

Each step k has its own length and three sets of inputs: at its beginning, middle and end, seen
from inside the step, so that a jump of the torque between two steps costs no order. Only the
states asked for are kept.
"""

import numpy as np

from ..jit import compiled, inlined
from .buffer import (
    CAR,
    CAR_ROWS,
    NOW,
    REACH,
    ROWS,
    SLOPE,
    STAGE,
    STATES,
    SUM,
    body_of,
    corner_of,
    given_to,
    keep_slope,
    stage_state,
    turn_of,
)
from .constrained import rim_accelerations, rim_corner
from .contact import find_contacts, read_road
from .direct import accelerations, free_corner
from .forces import direction_of_travel
from .kinematics import arm_pose, attitude, turn_by
from .records import RimInput, State

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
    chassis = attitude(pitch, roll, state.pitch_rate, state.roll_rate)
    z, z_rate = state.z, state.z_rate
    fl = rim_corner(corner_of(buffer, 0, LANES, j), chassis, z, z_rate, rims[0], way, b)
    fr = rim_corner(corner_of(buffer, 1, LANES, j), chassis, z, z_rate, rims[1], way, b)
    rl = rim_corner(corner_of(buffer, 2, LANES, j), chassis, z, z_rate, rims[2], way, b)
    rr = rim_corner(corner_of(buffer, 3, LANES, j), chassis, z, z_rate, rims[3], way, b)
    a = rim_accelerations(body_of(buffer, LANES, j), chassis, fl, fr, rl, rr, a_x, exact)
    return chassis, fl, fr, rl, rr, a


@inlined
def _free_slopes(buffer, LANES):
    """Derivative of every lane's stage state, free car."""
    for j in range(LANES):
        _, fl, fr, rl, rr, a = free_car(buffer, LANES, j)
        clearance = min(min(fl.clearance, fr.clearance), min(rl.clearance, rr.clearance))
        buffer[REACH * LANES + j] = min(buffer[REACH * LANES + j], clearance)
        slope = slope_of(stage_state(buffer, LANES, j), a.chassis, a.fl, a.fr, a.rl, a.rr)
        keep_slope(buffer, LANES, j, slope)


@inlined
def _rim_slopes(buffer, LANES, u, exact):
    """Derivative of every lane's stage state, prescribed rims; u : one row of stage inputs."""
    # Read before the loop: a second array inside it might alias the buffer.
    rims = rims_at(u)
    a_x, way, b = u[12], direction_of_travel(u[13]), u[14]
    for j in range(LANES):
        _, fl, fr, rl, rr, a = car_on_rims(buffer, LANES, j, rims, a_x, way, b, exact)
        reach = min(min(fl.reach, fr.reach), min(rl.reach, rr.reach))
        clearance = min(min(fl.clearance, fr.clearance), min(rl.clearance, rr.clearance))
        buffer[REACH * LANES + j] = min(buffer[REACH * LANES + j], min(reach, clearance))
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
def _keep(buffer, LANES, states_out, failed, reach, first, sample):
    """Write the lanes' states as a sample; note the cars that have left the model's range.

    Returns whether any car is still sound.
    """
    sound_left = False
    for j in range(LANES):
        car = first + j
        if car < states_out.shape[0]:
            sound = abs(buffer[1 * LANES + j]) < _HEIGHT_LIMIT and buffer[REACH * LANES + j] >= 0.0
            for row in range(2, 8):
                sound = sound and abs(buffer[row * LANES + j]) < _ANGLE_LIMIT
            if not sound and failed[car] < 0:
                failed[car] = sample
                reach[car] = buffer[REACH * LANES + j]
            sound_left = sound_left or sound
            for row in range(STATES):
                states_out[car, sample, row] = buffer[row * LANES + j]
    return sound_left


@inlined
def _stages(inputs):
    """Stages of a step, four. Read from an array's shape, so that the compiler does not know it:
    it would write the accelerations out four times, and the code would leave the cache.
    """
    return inputs.shape[1] + 1


@compiled
def integrate_free(
    lanes, cars, states, inputs, steps, samples, road, start, spacing, out, failed, reach
):
    """Road and posts modes.

    lanes : tuple, its length is the number of cars side by side
    cars (C, CAR_ROWS) : records of `car_rows.car_row`
    states (C, 16) : at the first instant
    inputs (n, 3, 16) : post heights (4), their rates (4), drive torques (4), brake torques (4)
        at the beginning, middle and end of each step
    steps (n,) : step lengths, s
    samples (n + 1,) : index into `out` of the state before step k, or -1
    road (2, cells, 4), start, spacing : cubics of `road.Road`, left and right
    out (C, S, 16) : states at the samples
    failed (C,) : set to the first sample at which a car left the model's range, else left alone
    reach (C,) : likewise to the least reach of its arms and clearance of its mounts until then
    """
    LANES = len(lanes)
    buffer = np.zeros(ROWS * LANES)
    for first in range(0, cars.shape[0], LANES):
        _begin(buffer, LANES, cars, states, first)
        if samples[0] >= 0:
            _keep(buffer, LANES, out, failed, reach, first, samples[0])
        for k in range(steps.shape[0]):
            _set_out(buffer, LANES)
            for stage in range(_stages(inputs)):
                given = inputs[k, (stage + 1) // 2]
                find_contacts(buffer, LANES)
                read_road(buffer, LANES, given, road, start, spacing)
                _free_slopes(buffer, LANES)
                _advance(buffer, LANES, stage, steps[k])
            sample = samples[k + 1]
            if sample >= 0 and not _keep(buffer, LANES, out, failed, reach, first, sample):
                break


@compiled
def integrate_rims(lanes, cars, states, inputs, steps, samples, exact, out, failed, reach):
    """Rims mode; arguments as in `integrate_free`, but

    inputs (n, 3, 15) : u (4), u' (4), u'' (4), a_x, v_x and the braking weight b
    exact : 1.0 for the exact traction, 0.0 for the paper's
    out : x, z, pitch, roll and their rates are valid; the arms follow from them
    """
    LANES = len(lanes)
    buffer = np.zeros(ROWS * LANES)
    for first in range(0, cars.shape[0], LANES):
        _begin(buffer, LANES, cars, states, first)
        if samples[0] >= 0:
            _keep(buffer, LANES, out, failed, reach, first, samples[0])
        for k in range(steps.shape[0]):
            _set_out(buffer, LANES)
            for stage in range(_stages(inputs)):
                _rim_slopes(buffer, LANES, inputs[k, (stage + 1) // 2], exact)
                _advance(buffer, LANES, stage, steps[k])
            sample = samples[k + 1]
            if sample >= 0 and not _keep(buffer, LANES, out, failed, reach, first, sample):
                break
