"""Classical Runge-Kutta of order 4 over a batch of cars, for the free car and for given rims.

Each step k has its own length and three sets of inputs: at its beginning, middle and end, seen
from inside the step, so that a jump of the torque between two steps costs no order. Only the
states asked for are kept.
"""

import numpy as np

from ..jit import compiled, inlined
from .constrained import rim_accelerations, rim_corner
from .direct import accelerations, chassis_attitude, free_corner
from .forces import direction_of_travel
from .kinematics import arm_pose, wheel_motion
from .lanes import loader, storer
from .records import Body, Corner, RimInput, State, WheelInput
from .road import road_under

STATES = len(State._fields)
BODY_ROWS = len(Body._fields)
CORNER_ROWS = len(Corner._fields)
CAR_ROWS = BODY_ROWS + 4 * CORNER_ROWS

# Rows of the buffer.
_NOW = 0
_STAGE = _NOW + STATES
_SLOPE = _STAGE + STATES
_SUM = _SLOPE + STATES
_GIVEN = _SUM + STATES
_CONTACT = _GIVEN + 4 * len(WheelInput._fields)
_REACH = _CONTACT + 8
_CAR = _REACH + 1
_CORNERS = _CAR + BODY_ROWS
ROWS = _CAR + CAR_ROWS

_ANGLE_LIMIT = 1.5
"""rad: beyond it the polynomials of elementary.py lose accuracy and the car lies on its side."""
_HEIGHT_LIMIT = 10.0
"""m"""

load_body, load_corner, load_given = loader(Body), loader(Corner), loader(WheelInput)
load_state, store_state = loader(State), storer(State)


@inlined
def _corner(buffer, index, lanes, lane):
    return load_corner(buffer, _CORNERS + index * CORNER_ROWS, lanes, lane)


@inlined
def _given(buffer, index, lanes, lane):
    return load_given(buffer, _GIVEN + index * 4, lanes, lane)


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
def _contact(corner, chassis, state, angle, rate):
    """X of a wheel centre (m) and its rate (m/s)."""
    wheel = wheel_motion(
        corner, chassis, arm_pose(angle, rate), state.z, state.x_rate, state.z_rate
    )
    e, c = chassis.e_X, wheel.centre
    return state.x + e[0] * c[0] + e[1] * c[1] + e[2] * c[2], wheel.velocity_X


@inlined
def _find_contacts(buffer, LANES):
    """Where the four wheels are, for every lane."""
    for j in range(LANES):
        state = load_state(buffer, _STAGE, LANES, j)
        chassis = chassis_attitude(state)
        fl = _contact(_corner(buffer, 0, LANES, j), chassis, state, state.fl, state.fl_rate)
        fr = _contact(_corner(buffer, 1, LANES, j), chassis, state, state.fr, state.fr_rate)
        rl = _contact(_corner(buffer, 2, LANES, j), chassis, state, state.rl, state.rl_rate)
        rr = _contact(_corner(buffer, 3, LANES, j), chassis, state, state.rr, state.rr_rate)
        buffer[(_CONTACT + 0) * LANES + j], buffer[(_CONTACT + 1) * LANES + j] = fl
        buffer[(_CONTACT + 2) * LANES + j], buffer[(_CONTACT + 3) * LANES + j] = fr
        buffer[(_CONTACT + 4) * LANES + j], buffer[(_CONTACT + 5) * LANES + j] = rl
        buffer[(_CONTACT + 6) * LANES + j], buffer[(_CONTACT + 7) * LANES + j] = rr


@inlined
def _read_road(buffer, LANES, inputs, road, start, spacing):
    """What is under each wheel and acts on it: the road at its X, on top of the post."""
    for j in range(LANES):
        for corner in range(4):
            X = buffer[(_CONTACT + 2 * corner) * LANES + j]
            X_rate = buffer[(_CONTACT + 2 * corner + 1) * LANES + j]
            height, slope = road_under(road[corner % 2], start, spacing, X)
            first = _GIVEN + 4 * corner
            buffer[first * LANES + j] = inputs[corner] + height
            buffer[(first + 1) * LANES + j] = inputs[4 + corner] + slope * X_rate
            buffer[(first + 2) * LANES + j] = inputs[8 + corner]
            buffer[(first + 3) * LANES + j] = inputs[12 + corner]


@inlined
def _free_slopes(buffer, LANES):
    """Derivative of every lane's stage state, free car."""
    for j in range(LANES):
        body = load_body(buffer, _CAR, LANES, j)
        state = load_state(buffer, _STAGE, LANES, j)
        chassis = chassis_attitude(state)
        way = direction_of_travel(state.x_rate)
        fl = free_corner(
            _corner(buffer, 0, LANES, j),
            chassis,
            state,
            state.fl,
            state.fl_rate,
            _given(buffer, 0, LANES, j),
            way,
        )
        fr = free_corner(
            _corner(buffer, 1, LANES, j),
            chassis,
            state,
            state.fr,
            state.fr_rate,
            _given(buffer, 1, LANES, j),
            way,
        )
        rl = free_corner(
            _corner(buffer, 2, LANES, j),
            chassis,
            state,
            state.rl,
            state.rl_rate,
            _given(buffer, 2, LANES, j),
            way,
        )
        rr = free_corner(
            _corner(buffer, 3, LANES, j),
            chassis,
            state,
            state.rr,
            state.rr_rate,
            _given(buffer, 3, LANES, j),
            way,
        )
        a = accelerations(body, chassis, fl, fr, rl, rr)
        slope = slope_of(state, a.chassis, a.fl, a.fr, a.rl, a.rr)
        store_state(buffer, _SLOPE, LANES, j, slope)


@inlined
def _rim_slopes(buffer, LANES, u, exact):
    """Derivative of every lane's stage state, prescribed rims; u : one row of stage inputs."""
    # Read before the loop: a second array inside it might alias the buffer.
    rim_fl, rim_fr = RimInput(u[0], u[4], u[8]), RimInput(u[1], u[5], u[9])
    rim_rl, rim_rr = RimInput(u[2], u[6], u[10]), RimInput(u[3], u[7], u[11])
    a_x, way, b = u[12], direction_of_travel(u[13]), u[14]
    for j in range(LANES):
        body = load_body(buffer, _CAR, LANES, j)
        state = load_state(buffer, _STAGE, LANES, j)
        chassis = chassis_attitude(state)
        z, z_rate = state.z, state.z_rate
        fl = rim_corner(_corner(buffer, 0, LANES, j), chassis, z, z_rate, rim_fl, way, b)
        fr = rim_corner(_corner(buffer, 1, LANES, j), chassis, z, z_rate, rim_fr, way, b)
        rl = rim_corner(_corner(buffer, 2, LANES, j), chassis, z, z_rate, rim_rl, way, b)
        rr = rim_corner(_corner(buffer, 3, LANES, j), chassis, z, z_rate, rim_rr, way, b)
        reach = min(min(fl.reach, fr.reach), min(rl.reach, rr.reach))
        buffer[_REACH * LANES + j] = min(buffer[_REACH * LANES + j], reach)
        a = rim_accelerations(body, chassis, fl, fr, rl, rr, a_x, exact)
        # The arms follow from the chassis; their rows are not integrated.
        slope = slope_of(state, a.chassis, 0.0, 0.0, 0.0, 0.0)
        store_state(buffer, _SLOPE, LANES, j, slope)


@inlined
def _begin(buffer, LANES, cars, states, first):
    """Fill the lanes with cars from `first` on; lanes past the last car repeat it."""
    last = cars.shape[0] - 1
    for j in range(LANES):
        car = min(first + j, last)
        for row in range(CAR_ROWS):
            buffer[(_CAR + row) * LANES + j] = cars[car, row]
        for row in range(STATES):
            buffer[(_NOW + row) * LANES + j] = states[car, row]
        buffer[_REACH * LANES + j] = 1.0


@inlined
def _set_out(buffer, LANES):
    """First stage of a step: at its beginning."""
    for k in range(STATES * LANES):
        buffer[_STAGE * LANES + k] = buffer[_NOW * LANES + k]
        buffer[_SUM * LANES + k] = 0.0


@inlined
def _advance(buffer, LANES, stage, h):
    """Weigh the slope just found into the step and move to the next stage, or end the step."""
    weight = h / 3.0 if stage == 1 or stage == 2 else h / 6.0
    ahead = 0.5 * h if stage < 2 else h
    for k in range(STATES * LANES):
        slope = buffer[_SLOPE * LANES + k]
        total = buffer[_SUM * LANES + k] + weight * slope
        buffer[_SUM * LANES + k] = total
        now = buffer[_NOW * LANES + k]
        buffer[_STAGE * LANES + k] = now + ahead * slope
        buffer[_NOW * LANES + k] = now + total if stage == 3 else now


@inlined
def _keep(buffer, LANES, states_out, failed, first, sample):
    """Write the lanes' states as a sample; note the cars that have left the model's range.

    Returns whether any car is still sound.
    """
    sound_left = False
    for j in range(LANES):
        car = first + j
        if car < states_out.shape[0]:
            sound = abs(buffer[1 * LANES + j]) < _HEIGHT_LIMIT and buffer[_REACH * LANES + j] >= 0.0
            for row in range(2, 8):
                sound = sound and abs(buffer[row * LANES + j]) < _ANGLE_LIMIT
            if not sound and failed[car] < 0:
                failed[car] = sample
            sound_left = sound_left or sound
            for row in range(STATES):
                states_out[car, sample, row] = buffer[row * LANES + j]
    return sound_left


@compiled
def integrate_free(lanes, cars, states, inputs, steps, samples, road, start, spacing, out, failed):
    """Road and posts modes.

    lanes : tuple, its length is the number of cars side by side
    cars (C, CAR_ROWS) : records of `car_rows.car_row`
    states (C, 16) : at the first instant
    inputs (n, 3, 16) : post heights (4), their rates (4), drive torques (4), brake torques (4)
        at the beginning, middle and end of each step
    steps (n,) : step lengths, s
    samples (n + 1,) : index into `out` of the state before step k, or -1
    road (2, cells, 4), start, spacing : splines of `road.Road`, left and right
    out (C, S, 16) : states at the samples
    failed (C,) : set to the first sample at which a car left the model's range, else left alone
    """
    LANES = len(lanes)
    buffer = np.zeros(ROWS * LANES)
    for first in range(0, cars.shape[0], LANES):
        _begin(buffer, LANES, cars, states, first)
        if samples[0] >= 0:
            _keep(buffer, LANES, out, failed, first, samples[0])
        for k in range(steps.shape[0]):
            _set_out(buffer, LANES)
            for stage in range(4):
                given = inputs[k, (stage + 1) // 2]
                _find_contacts(buffer, LANES)
                _read_road(buffer, LANES, given, road, start, spacing)
                _free_slopes(buffer, LANES)
                _advance(buffer, LANES, stage, steps[k])
            sample = samples[k + 1]
            if sample >= 0 and not _keep(buffer, LANES, out, failed, first, sample):
                break


@compiled
def integrate_rims(lanes, cars, states, inputs, steps, samples, exact, out, failed):
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
            _keep(buffer, LANES, out, failed, first, samples[0])
        for k in range(steps.shape[0]):
            _set_out(buffer, LANES)
            for stage in range(4):
                _rim_slopes(buffer, LANES, inputs[k, (stage + 1) // 2], exact)
                _advance(buffer, LANES, stage, steps[k])
            sample = samples[k + 1]
            if sample >= 0 and not _keep(buffer, LANES, out, failed, first, sample):
                break
