"""The free car in the lanes: derivative of the stage's state in the road and posts modes.

Three passes over the wheels: where they are, what acts on them and what is left of their arms once
the chassis's acceleration is known. In a batch the lanes are side by side, in a single car its four
wheels are.
"""

from ..jit import inlined
from .buffer import (
    ARM_TURNS,
    BARS,
    CONTACT,
    COUPLINGS,
    FORCES,
    GIVEN,
    LOADS,
    MASSES,
    RESTS,
    SLOPE,
    STAGE,
    TRAVELS,
    body_of,
    chassis_at,
    corner_of,
    four,
    given_to,
    keep_bars,
    keep_chassis_slope,
    load_mass,
    load_quad,
    load_rest,
    load_turn,
    of_wheel,
    store_mass,
    store_quad,
    store_rest,
    store_turn,
    turn_chassis,
)
from .direct import (
    FreeShare,
    arm_acceleration,
    bar_torques,
    chassis_acceleration,
    free_corner,
    free_share,
)
from .forces import direction_of_travel
from .kinematics import arm_pose, turn_by, wheel_motion
from .road import road_under


@inlined
def arm_at(buffer, WHEELS, wheel):
    """Pose of a wheel's arm at the stage, its turn known."""
    angle = buffer[of_wheel(STAGE + 4, WHEELS, wheel)]
    rate = buffer[of_wheel(STAGE + 12, WHEELS, wheel)]
    return arm_pose(angle, load_turn(buffer, ARM_TURNS // 4, WHEELS, wheel), rate)


@inlined
def _find_contact(buffer, WHEELS, wheel, state, chassis):
    """X of a wheel centre and its rate."""
    angle = buffer[of_wheel(STAGE + 4, WHEELS, wheel)]
    turn = turn_by(angle)
    store_turn(buffer, ARM_TURNS // 4, WHEELS, wheel, turn)
    arm = arm_pose(angle, turn, buffer[of_wheel(STAGE + 12, WHEELS, wheel)])
    corner = corner_of(buffer, WHEELS, wheel)
    motion = wheel_motion(corner, chassis, arm, state.z, state.x_rate, state.z_rate)
    buffer[of_wheel(CONTACT, WHEELS, wheel)] = state.x + motion.ahead
    buffer[of_wheel(CONTACT + 4, WHEELS, wheel)] = motion.velocity_X


@inlined
def _read_road(buffer, LANES, inputs, road, start, spacing):
    """What is under each wheel and acts on it: the road at its X, on top of the post.

    A loop of its own, since a table look-up cannot become vector code.
    """
    per_metre = 1.0 / spacing
    for corner in range(4):
        for j in range(LANES):
            X = buffer[(CONTACT + corner) * LANES + j]
            X_rate = buffer[(CONTACT + 4 + corner) * LANES + j]
            height, slope = road_under(road[corner % 2], start, per_metre, X)
            buffer[(GIVEN + corner) * LANES + j] = inputs[corner] + height
            buffer[(GIVEN + 4 + corner) * LANES + j] = inputs[4 + corner] + slope * X_rate
            buffer[(GIVEN + 8 + corner) * LANES + j] = inputs[8 + corner]
            buffer[(GIVEN + 12 + corner) * LANES + j] = inputs[12 + corner]


@inlined
def corner_at(buffer, WHEELS, wheel, state, chassis, way):
    """Forces and inertia of a wheel's corner."""
    corner, given = corner_of(buffer, WHEELS, wheel), given_to(buffer, WHEELS, wheel)
    return free_corner(corner, chassis, state, arm_at(buffer, WHEELS, wheel), given, way)


@inlined
def _share(buffer, WHEELS, wheel, state, chassis, way, bar):
    """Share of a wheel in the chassis's equations; bar : torque of its bar on its arm."""
    corner = corner_at(buffer, WHEELS, wheel, state, chassis, way)
    return free_share(corner, corner.moment + bar)


@inlined
def _keep_share(buffer, wheel, share):
    """Store the share of a single car's wheel."""
    store_mass(buffer, MASSES // 4, 4, wheel, share.mass)
    store_quad(buffer, FORCES // 4, 4, wheel, share.force)
    store_quad(buffer, COUPLINGS // 4, 4, wheel, share.coupling)
    store_rest(buffer, RESTS // 4, 4, wheel, share.rest)


@inlined
def _share_at(buffer, wheel):
    """The same loaded."""
    return FreeShare(
        load_mass(buffer, MASSES // 4, 4, wheel),
        load_quad(buffer, FORCES // 4, 4, wheel),
        load_quad(buffer, COUPLINGS // 4, 4, wheel),
        load_rest(buffer, RESTS // 4, 4, wheel),
    )


@inlined
def _accelerate_chassis(buffer, LANES, lane, state, chassis, fl, fr, rl, rr):
    """Solve for the chassis of a lane from its wheels' shares; returns its acceleration."""
    acceleration = chassis_acceleration(body_of(buffer, LANES, lane), chassis, fl, fr, rl, rr)
    least = min(
        min(fl.rest.clearance, fr.rest.clearance), min(rl.rest.clearance, rr.rest.clearance)
    )
    keep_chassis_slope(buffer, LANES, lane, state, acceleration, least)
    return acceleration


@inlined
def _finish_wheel(buffer, WHEELS, wheel, share, acceleration):
    """Slope of an arm and what is tallied of a wheel, once the chassis is known."""
    buffer[of_wheel(SLOPE + 4, WHEELS, wheel)] = buffer[of_wheel(STAGE + 12, WHEELS, wheel)]
    buffer[of_wheel(SLOPE + 12, WHEELS, wheel)] = arm_acceleration(share, acceleration)
    buffer[of_wheel(TRAVELS, WHEELS, wheel)] = share.rest.travel
    buffer[of_wheel(LOADS, WHEELS, wheel)] = share.rest.load


@inlined
def free_slopes(buffer, LANES, given, driven):
    """Derivative of every lane's stage state.

    given (16,) : row of stage inputs; driven : road, its start and spacing
    """
    road, start, spacing = driven
    if LANES == 1:
        _find_contacts_of_one(buffer, given)
        _read_road(buffer, LANES, given, road, start, spacing)
        _accelerate_one(buffer, given)
    else:
        _find_contacts(buffer, LANES)
        _read_road(buffer, LANES, given, road, start, spacing)
        _accelerate(buffer, LANES)


@inlined
def _find_contacts_of_one(buffer, given):
    """Wheels side by side."""
    state, chassis = turn_chassis(buffer, 1, 0)
    for wheel in range(four(given)):
        _find_contact(buffer, 4, wheel, state, chassis)


@inlined
def _accelerate_one(buffer, given):
    """Wheels side by side."""
    state, chassis = chassis_at(buffer, 1, 0)
    keep_bars(buffer, bar_torques(body_of(buffer, 1, 0), state))
    way = direction_of_travel(state.x_rate)
    for wheel in range(four(given)):
        share = _share(buffer, 4, wheel, state, chassis, way, buffer[BARS + wheel])
        _keep_share(buffer, wheel, share)
    fl, fr, rl, rr = (
        _share_at(buffer, 0),
        _share_at(buffer, 1),
        _share_at(buffer, 2),
        _share_at(buffer, 3),
    )
    acceleration = _accelerate_chassis(buffer, 1, 0, state, chassis, fl, fr, rl, rr)
    for wheel in range(four(given)):
        _finish_wheel(buffer, 4, wheel, _share_at(buffer, wheel), acceleration)


@inlined
def _find_contacts(buffer, LANES):
    """Lanes side by side."""
    WHEELS = 4 * LANES
    for j in range(LANES):
        state, chassis = turn_chassis(buffer, LANES, j)
        _find_contact(buffer, WHEELS, j, state, chassis)
        _find_contact(buffer, WHEELS, LANES + j, state, chassis)
        _find_contact(buffer, WHEELS, 2 * LANES + j, state, chassis)
        _find_contact(buffer, WHEELS, 3 * LANES + j, state, chassis)


@inlined
def _accelerate(buffer, LANES):
    """Lanes side by side."""
    WHEELS = 4 * LANES
    for j in range(LANES):
        state, chassis = chassis_at(buffer, LANES, j)
        front, rear = bar_torques(body_of(buffer, LANES, j), state)
        way = direction_of_travel(state.x_rate)
        fl = _share(buffer, WHEELS, j, state, chassis, way, -front)
        fr = _share(buffer, WHEELS, LANES + j, state, chassis, way, front)
        rl = _share(buffer, WHEELS, 2 * LANES + j, state, chassis, way, -rear)
        rr = _share(buffer, WHEELS, 3 * LANES + j, state, chassis, way, rear)
        acceleration = _accelerate_chassis(buffer, LANES, j, state, chassis, fl, fr, rl, rr)
        _finish_wheel(buffer, WHEELS, j, fl, acceleration)
        _finish_wheel(buffer, WHEELS, LANES + j, fr, acceleration)
        _finish_wheel(buffer, WHEELS, 2 * LANES + j, rl, acceleration)
        _finish_wheel(buffer, WHEELS, 3 * LANES + j, rr, acceleration)
