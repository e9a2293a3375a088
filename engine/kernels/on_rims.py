"""The car on its rims in the lanes: derivative of the stage's state in the rims mode.

Passes over the wheels as in `free.py`: which pose of its arm each rim demands, what its corner adds
to the chassis's equations and, once these are solved, its load.
"""

from ..jit import inlined
from .buffer import (
    ARM_RATES,
    ARM_TURNS,
    BARS,
    GIVEN,
    LINEAR_ROWS,
    LOADS,
    REACHES,
    RIM_RESTS,
    SHARES,
    TRACTION,
    TRAVELS,
    body_of,
    corner_of,
    four,
    keep_bars,
    keep_chassis_slope,
    keep_linear,
    linear_at,
    load_rim_rest,
    load_turn,
    of_wheel,
    rim_at,
    store_rim_rest,
    store_turn,
    turn_chassis,
)
from .constrained import (
    RimShare,
    reached_arm,
    rim_bar_torques,
    rim_corner,
    rim_share,
    rims_solution,
    value,
)
from .elementary import angle_of
from .forces import direction_of_travel
from .kinematics import ArmPose, Turn
from .records import RimInput


@inlined
def rims_at(given):
    """Prescribed motions of the four wheel centres in a row of stage inputs."""
    fl, fr = RimInput(given[0], given[4], given[8]), RimInput(given[1], given[5], given[9])
    rl, rr = RimInput(given[2], given[6], given[10]), RimInput(given[3], given[7], given[11])
    return fl, fr, rl, rr


@inlined
def _reach(buffer, WHEELS, wheel, rim, state, chassis):
    """Pose of the arm whose wheel centre is told where to be, and how far it is from its end."""
    corner = corner_of(buffer, WHEELS, wheel)
    return reached_arm(corner, chassis, state.z, state.z_rate, rim)


@inlined
def rim_corner_at(buffer, WHEELS, wheel, rim, arm, state, chassis, way, braking):
    """Inertia and unit-force effects of a wheel's corner, its arm found."""
    corner = corner_of(buffer, WHEELS, wheel)
    return rim_corner(corner, chassis, arm, state.z, state.z_rate, rim, way, braking)


@inlined
def _share(buffer, WHEELS, wheel, rim, found, state, chassis, way, braking, bar):
    """Share of a wheel in the chassis's equations; found : of `_reach`, bar : torque on its arm."""
    arm, reach = found
    corner = rim_corner_at(buffer, WHEELS, wheel, rim, arm, state, chassis, way, braking)
    return rim_share(corner, corner.moment + bar, reach)


@inlined
def _keep_arm(buffer, wheel, arm, reach):
    """Store the pose of a single car's arm."""
    store_turn(buffer, ARM_TURNS // 4, 4, wheel, Turn(arm.sine, arm.cosine))
    buffer[ARM_RATES + wheel] = arm.rate
    buffer[REACHES + wheel] = reach


@inlined
def rim_arm_at(buffer, wheel):
    """The same loaded."""
    turn = load_turn(buffer, ARM_TURNS // 4, 4, wheel)
    angle, rate = angle_of(turn.sine, turn.cosine), buffer[ARM_RATES + wheel]
    return ArmPose(angle, turn.sine, turn.cosine, rate), buffer[REACHES + wheel]


@inlined
def _keep_share(buffer, wheel, share):
    """Store the share of a single car's wheel."""
    keep_linear(buffer, SHARES, wheel, share.z)
    keep_linear(buffer, SHARES + LINEAR_ROWS, wheel, share.pitch)
    keep_linear(buffer, SHARES + 2 * LINEAR_ROWS, wheel, share.roll)
    keep_linear(buffer, SHARES + 3 * LINEAR_ROWS, wheel, share.x)
    keep_linear(buffer, SHARES + 4 * LINEAR_ROWS, wheel, share.load)
    store_rim_rest(buffer, RIM_RESTS // 4, 4, wheel, share.rest)


@inlined
def _share_at(buffer, wheel):
    """The same loaded."""
    return RimShare(
        linear_at(buffer, SHARES, wheel),
        linear_at(buffer, SHARES + LINEAR_ROWS, wheel),
        linear_at(buffer, SHARES + 2 * LINEAR_ROWS, wheel),
        linear_at(buffer, SHARES + 3 * LINEAR_ROWS, wheel),
        linear_at(buffer, SHARES + 4 * LINEAR_ROWS, wheel),
        load_rim_rest(buffer, RIM_RESTS // 4, 4, wheel),
    )


@inlined
def _accelerate_chassis(buffer, LANES, lane, state, chassis, fl, fr, rl, rr, a_x, exact):
    """Solve for the chassis of a lane from its wheels' shares; returns c'' and the traction."""
    body = body_of(buffer, LANES, lane)
    acceleration, traction = rims_solution(body, chassis, fl, fr, rl, rr, a_x, exact)
    least = min(min(fl.rest.least, fr.rest.least), min(rl.rest.least, rr.rest.least))
    keep_chassis_slope(buffer, LANES, lane, state, acceleration, least)
    buffer[TRACTION * LANES + lane] = traction
    return acceleration, traction


@inlined
def _finish_wheel(buffer, WHEELS, wheel, share, acceleration, traction):
    """What is tallied of a wheel, once the chassis is known."""
    buffer[of_wheel(TRAVELS, WHEELS, wheel)] = share.rest.travel
    buffer[of_wheel(LOADS, WHEELS, wheel)] = value(share.load, acceleration, traction)


@inlined
def rim_slopes(buffer, LANES, given, driven):
    """Derivative of every lane's stage state; that of the arms, which follow, stays zero.

    given (15,) : row of stage inputs; driven : exact, 1.0 or 0.0
    """
    # Read before the loops: a second array inside them might alias the buffer.
    a_x, way, braking = given[12], direction_of_travel(given[13]), given[14]
    if LANES == 1:
        _accelerate_one(buffer, given, a_x, way, braking, driven[0])
    else:
        _accelerate(buffer, LANES, rims_at(given), a_x, way, braking, driven[0])


@inlined
def _accelerate_one(buffer, given, a_x, way, braking, exact):
    """Wheels side by side."""
    for row in range(12):
        buffer[GIVEN + row] = given[row]
    state, chassis = turn_chassis(buffer, 1, 0)
    for wheel in range(four(given)):
        arm, reach = _reach(buffer, 4, wheel, rim_at(buffer, wheel), state, chassis)
        _keep_arm(buffer, wheel, arm, reach)
    fl, fr = rim_arm_at(buffer, 0)[0], rim_arm_at(buffer, 1)[0]
    rl, rr = rim_arm_at(buffer, 2)[0], rim_arm_at(buffer, 3)[0]
    keep_bars(buffer, rim_bar_torques(body_of(buffer, 1, 0), fl, fr, rl, rr))
    for wheel in range(four(given)):
        found, bar, rim = rim_arm_at(buffer, wheel), buffer[BARS + wheel], rim_at(buffer, wheel)
        share = _share(buffer, 4, wheel, rim, found, state, chassis, way, braking, bar)
        _keep_share(buffer, wheel, share)
    acceleration, traction = _accelerate_chassis(
        buffer,
        1,
        0,
        state,
        chassis,
        _share_at(buffer, 0),
        _share_at(buffer, 1),
        _share_at(buffer, 2),
        _share_at(buffer, 3),
        a_x,
        exact,
    )
    for wheel in range(four(given)):
        _finish_wheel(buffer, 4, wheel, _share_at(buffer, wheel), acceleration, traction)


@inlined
def _reached_corner(buffer, WHEELS, wheel, rim, state, chassis, way, braking):
    """Corner and reach of a wheel."""
    arm, reach = _reach(buffer, WHEELS, wheel, rim, state, chassis)
    corner = rim_corner_at(buffer, WHEELS, wheel, rim, arm, state, chassis, way, braking)
    return corner, reach


@inlined
def _accelerate(buffer, LANES, rims, a_x, way, braking, exact):
    """Lanes side by side."""
    WHEELS = 4 * LANES
    for j in range(LANES):
        state, chassis = turn_chassis(buffer, LANES, j)
        how = state, chassis, way, braking
        fl, fl_reach = _reached_corner(buffer, WHEELS, j, rims[0], *how)
        fr, fr_reach = _reached_corner(buffer, WHEELS, LANES + j, rims[1], *how)
        rl, rl_reach = _reached_corner(buffer, WHEELS, 2 * LANES + j, rims[2], *how)
        rr, rr_reach = _reached_corner(buffer, WHEELS, 3 * LANES + j, rims[3], *how)
        body = body_of(buffer, LANES, j)
        front, rear = rim_bar_torques(body, fl.arm, fr.arm, rl.arm, rr.arm)
        fl_share = rim_share(fl, fl.moment - front, fl_reach)
        fr_share = rim_share(fr, fr.moment + front, fr_reach)
        rl_share = rim_share(rl, rl.moment - rear, rl_reach)
        rr_share = rim_share(rr, rr.moment + rear, rr_reach)
        acceleration, traction = _accelerate_chassis(
            buffer, LANES, j, state, chassis, fl_share, fr_share, rl_share, rr_share, a_x, exact
        )
        _finish_wheel(buffer, WHEELS, j, fl_share, acceleration, traction)
        _finish_wheel(buffer, WHEELS, LANES + j, fr_share, acceleration, traction)
        _finish_wheel(buffer, WHEELS, 2 * LANES + j, rl_share, acceleration, traction)
        _finish_wheel(buffer, WHEELS, 3 * LANES + j, rr_share, acceleration, traction)
