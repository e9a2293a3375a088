"""Rows of the lanes' buffer: where a group of cars keeps states, inputs and its own numbers."""

from ..jit import inlined
from .kinematics import Turn
from .lanes import loader, storer
from .records import Body, Corner, State, WheelInput

STATES = len(State._fields)
BODY_ROWS = len(Body._fields)
CORNER_ROWS = len(Corner._fields)
CAR_ROWS = BODY_ROWS + 4 * CORNER_ROWS
"""Numbers that describe one car to the kernels: body, then corners fl, fr, rl, rr."""
WHEEL_ROWS = len(WheelInput._fields)

NOW = 0
"""State at the beginning of the step."""
STAGE = NOW + STATES
"""State of the stage being evaluated."""
SLOPE = STAGE + STATES
"""Its derivative."""
SUM = SLOPE + STATES
"""Weighted derivatives of the step so far."""
GIVEN = SUM + STATES
"""A WheelInput for each corner."""
CONTACT = GIVEN + 4 * WHEEL_ROWS
"""X of each wheel centre and its rate."""
TURNS = CONTACT + 8
"""Sine and cosine of pitch, roll and the arms' angles at the stage."""
TURN_ROWS = len(Turn._fields)
REACH = TURNS + 6 * TURN_ROWS
"""Least reach of an arm and least clearance of a mount since the beginning."""
TRAVELS = REACH + 1
"""Of the four struts at the stage, m."""
LOADS = TRAVELS + 4
"""Of the four tyres, N."""
CAR = LOADS + 4
ROWS = CAR + CAR_ROWS
"""Rows of the equations of motion; those of `weighing.py` and `tally.py` follow."""

_load_body, _load_corner, _load_given = loader(Body), loader(Corner), loader(WheelInput)
_load_state, _store_state = loader(State), storer(State)
_load_turn, _store_turn = loader(Turn), storer(Turn)


@inlined
def body_of(buffer, LANES, lane):
    """Sprung mass and bars of a lane's car."""
    return _load_body(buffer, CAR, LANES, lane)


@inlined
def corner_of(buffer, index, LANES, lane):
    """One corner of a lane's car."""
    return _load_corner(buffer, CAR + BODY_ROWS + index * CORNER_ROWS, LANES, lane)


@inlined
def given_to(buffer, index, LANES, lane):
    """What acts on one wheel of a lane's car."""
    return _load_given(buffer, GIVEN + index * WHEEL_ROWS, LANES, lane)


@inlined
def turn_of(buffer, index, LANES, lane):
    """Sine and cosine of one of a lane's angles: pitch, roll, arms."""
    return _load_turn(buffer, TURNS + index * TURN_ROWS, LANES, lane)


@inlined
def keep_turn(buffer, index, LANES, lane, turn):
    """Store sine and cosine of one of a lane's angles."""
    _store_turn(buffer, TURNS + index * TURN_ROWS, LANES, lane, turn)


@inlined
def stage_state(buffer, LANES, lane):
    """State of a lane's car at the stage."""
    return _load_state(buffer, STAGE, LANES, lane)


@inlined
def slope_at(buffer, LANES, lane):
    """Derivative of a lane's state at the stage."""
    return _load_state(buffer, SLOPE, LANES, lane)


@inlined
def keep_wheels(buffer, LANES, lane, travels, loads):
    """Store what is tallied of a lane's four wheels."""
    for corner in range(4):
        buffer[(TRAVELS + corner) * LANES + lane] = travels[corner]
        buffer[(LOADS + corner) * LANES + lane] = loads[corner]


@inlined
def keep_slope(buffer, LANES, lane, slope):
    """Store the derivative of a lane's state."""
    _store_state(buffer, SLOPE, LANES, lane, slope)
