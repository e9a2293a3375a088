"""Rows of the lanes' buffer: where a group of cars keeps states, inputs and its own numbers.

A quantity of the car has one row, row r of lane j at buffer[r * LANES + j]. A quantity of the
wheels has four rows one after the other, for fl, fr, rl and rr, so that with WHEELS = 4 LANES and
wheel i = corner * LANES + j it is at buffer[r / 4 * WHEELS + i]: the four wheels of a single car
lie side by side like lanes.
"""

from ..jit import inlined
from .constrained import Linear, RimRest
from .direct import ArmRest
from .equations import ChassisMass, Quad
from .kinematics import Turn, attitude, turn_by
from .lanes import loader, storer
from .records import Body, Corner, RimInput, State, WheelInput

STATES = len(State._fields)
BODY_ROWS = len(Body._fields)
CORNER_ROWS = len(Corner._fields)
CAR_ROWS = BODY_ROWS + 4 * CORNER_ROWS
"""Numbers that describe one car to the kernels: body, then corners fl, fr, rl, rr."""

NOW = 0
"""State at the beginning of the step."""
STAGE = NOW + STATES
"""State of the stage being evaluated."""
SLOPE = STAGE + STATES
"""Its derivative."""
SUM = SLOPE + STATES
"""Weighted derivatives of the step so far."""

GIVEN = SUM + STATES
"""A WheelInput for each wheel; on rims a RimInput for those of a single car."""
CONTACT = GIVEN + 4 * len(WheelInput._fields)
"""X of each wheel centre, then its rate."""
ARM_TURNS = CONTACT + 4 * 2
"""Sine and cosine of each arm's angle at the stage."""
ARM_RATES = ARM_TURNS + 4 * len(Turn._fields)
REACHES = ARM_RATES + 4
"""Single car on rims: how far each arm is from its end."""
TRAVELS = REACHES + 4
"""Of the four struts at the stage, m."""
LOADS = TRAVELS + 4
"""Of the four tyres, N."""

CORNERS = LOADS + 4

TURNS = CORNERS + 4 * CORNER_ROWS
"""Sine and cosine of pitch, then of roll at the stage."""
TRACTION = TURNS + 2 * len(Turn._fields)
REACH = TRACTION + 1
"""Least reach of an arm and least clearance of a mount since the beginning."""
BODY = REACH + 1

BARS = (BODY + BODY_ROWS + 3) // 4 * 4
"""Single car: torque of the stabilizer bar on each arm, N m."""
MASSES = BARS + 4
"""Single free car: the FreeShare of each wheel."""
FORCES = MASSES + 4 * len(ChassisMass._fields)
COUPLINGS = FORCES + 4 * len(Quad._fields)
RESTS = COUPLINGS + 4 * len(Quad._fields)
SHARES = RESTS + 4 * len(ArmRest._fields)
"""Single car on rims: the RimShare of each wheel, five of Linear first."""
LINEAR_ROWS = 4 * (len(Quad._fields) + 2)
RIM_RESTS = SHARES + 5 * LINEAR_ROWS
ROWS = RIM_RESTS + 4 * len(RimRest._fields)
"""Rows of the equations of motion; those of `weighing.py` and `tally.py` follow."""

_load_body, _load_corner = loader(Body), loader(Corner)
_load_given, _load_rim = loader(WheelInput), loader(RimInput)
_load_state = loader(State)
load_turn, store_turn = loader(Turn), storer(Turn)
load_mass, store_mass = loader(ChassisMass), storer(ChassisMass)
load_quad, store_quad = loader(Quad), storer(Quad)
load_rest, store_rest = loader(ArmRest), storer(ArmRest)
load_rim_rest, store_rim_rest = loader(RimRest), storer(RimRest)


@inlined
def body_of(buffer, LANES, lane):
    """Sprung mass and bars of a lane's car."""
    return _load_body(buffer, BODY, LANES, lane)


@inlined
def corner_of(buffer, WHEELS, wheel):
    """The corner of a wheel."""
    return _load_corner(buffer, CORNERS // 4, WHEELS, wheel)


@inlined
def given_to(buffer, WHEELS, wheel):
    """What acts on a wheel."""
    return _load_given(buffer, GIVEN // 4, WHEELS, wheel)


@inlined
def rim_at(buffer, wheel):
    """Prescribed motion of a single car's wheel centre."""
    return _load_rim(buffer, GIVEN // 4, 4, wheel)


@inlined
def of_wheel(row, WHEELS, wheel):
    """Where a quantity of the wheels is for one of them."""
    return row // 4 * WHEELS + wheel


@inlined
def keep_linear(buffer, row, wheel, value):
    """Store an affine function that belongs to a single car's wheel."""
    store_quad(buffer, row // 4, 4, wheel, value.on)
    buffer[row + 16 + wheel] = value.traction
    buffer[row + 20 + wheel] = value.constant


@inlined
def linear_at(buffer, row, wheel):
    """The same loaded."""
    on = load_quad(buffer, row // 4, 4, wheel)
    return Linear(on, buffer[row + 16 + wheel], buffer[row + 20 + wheel])


@inlined
def turn_chassis(buffer, LANES, lane):
    """Find sine and cosine of a lane's pitch and roll; returns state and attitude at the stage."""
    state = stage_state(buffer, LANES, lane)
    pitch, roll = turn_by(state.pitch), turn_by(state.roll)
    store_turn(buffer, TURNS, LANES, lane, pitch)
    store_turn(buffer, TURNS + 2, LANES, lane, roll)
    return state, attitude(pitch, roll, state.pitch_rate, state.roll_rate)


@inlined
def chassis_at(buffer, LANES, lane):
    """State and attitude of a lane's chassis at the stage, its turns found."""
    state = stage_state(buffer, LANES, lane)
    pitch = load_turn(buffer, TURNS, LANES, lane)
    roll = load_turn(buffer, TURNS + 2, LANES, lane)
    return state, attitude(pitch, roll, state.pitch_rate, state.roll_rate)


@inlined
def keep_bars(buffer, torques):
    """Store the bars' torques, front and rear, on the arms of a single car."""
    front, rear = torques
    buffer[BARS + 0], buffer[BARS + 1] = -front, front
    buffer[BARS + 2], buffer[BARS + 3] = -rear, rear


@inlined
def keep_chassis_slope(buffer, LANES, lane, state, acceleration, least):
    """Store the derivative of the chassis's part of a lane's state.

    least : reach or clearance at the stage
    """
    buffer[(SLOPE + 0) * LANES + lane] = state.x_rate
    buffer[(SLOPE + 1) * LANES + lane] = state.z_rate
    buffer[(SLOPE + 2) * LANES + lane] = state.pitch_rate
    buffer[(SLOPE + 3) * LANES + lane] = state.roll_rate
    store_quad(buffer, SLOPE + 8, LANES, lane, acceleration)
    buffer[REACH * LANES + lane] = min(buffer[REACH * LANES + lane], least)


@inlined
def four(given):
    """The wheels of a single car, from the length of a row of stage inputs: a four that the
    compiler knew would make it write the loop out instead of working on all at once.
    """
    return (given.shape[0] + 1) // 4


@inlined
def stage_state(buffer, LANES, lane):
    """State of a lane's car at the stage."""
    return _load_state(buffer, STAGE, LANES, lane)


@inlined
def slope_at(buffer, LANES, lane):
    """Derivative of a lane's state at the stage."""
    return _load_state(buffer, SLOPE, LANES, lane)


@inlined
def take_car(buffer, LANES, lane, car):
    """Give a lane its car (CAR_ROWS,)."""
    for row in range(BODY_ROWS):
        buffer[(BODY + row) * LANES + lane] = car[row]
    for corner in range(4):
        for field in range(CORNER_ROWS):
            value = car[BODY_ROWS + corner * CORNER_ROWS + field]
            buffer[(CORNERS + 4 * field + corner) * LANES + lane] = value
