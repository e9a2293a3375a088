"""What is under the wheels: their X, the road there, and the posts."""

from ..jit import inlined
from .buffer import CONTACT, GIVEN, WHEEL_ROWS, corner_of, stage_state
from .direct import chassis_attitude
from .kinematics import arm_pose, wheel_motion
from .road import road_under
from .vec3 import dot


@inlined
def _contact(corner, chassis, state, angle, rate):
    """X of a wheel centre (m) and its rate (m/s)."""
    arm = arm_pose(angle, rate)
    wheel = wheel_motion(corner, chassis, arm, state.z, state.x_rate, state.z_rate)
    return state.x + dot(chassis.e_X, wheel.centre), wheel.velocity_X


@inlined
def find_contacts(buffer, LANES):
    """Where the four wheels are, for every lane."""
    for j in range(LANES):
        state = stage_state(buffer, LANES, j)
        chassis = chassis_attitude(state)
        fl = _contact(corner_of(buffer, 0, LANES, j), chassis, state, state.fl, state.fl_rate)
        fr = _contact(corner_of(buffer, 1, LANES, j), chassis, state, state.fr, state.fr_rate)
        rl = _contact(corner_of(buffer, 2, LANES, j), chassis, state, state.rl, state.rl_rate)
        rr = _contact(corner_of(buffer, 3, LANES, j), chassis, state, state.rr, state.rr_rate)
        buffer[(CONTACT + 0) * LANES + j], buffer[(CONTACT + 1) * LANES + j] = fl
        buffer[(CONTACT + 2) * LANES + j], buffer[(CONTACT + 3) * LANES + j] = fr
        buffer[(CONTACT + 4) * LANES + j], buffer[(CONTACT + 5) * LANES + j] = rl
        buffer[(CONTACT + 6) * LANES + j], buffer[(CONTACT + 7) * LANES + j] = rr


@inlined
def read_road(buffer, LANES, inputs, road, start, spacing):
    """What is under each wheel and acts on it: the road at its X, on top of the post.

    A loop of its own, since a table look-up cannot become vector code.
    """
    for j in range(LANES):
        for corner in range(4):
            X = buffer[(CONTACT + 2 * corner) * LANES + j]
            X_rate = buffer[(CONTACT + 2 * corner + 1) * LANES + j]
            height, slope = road_under(road[corner % 2], start, spacing, X)
            first = GIVEN + WHEEL_ROWS * corner
            buffer[first * LANES + j] = inputs[corner] + height
            buffer[(first + 1) * LANES + j] = inputs[4 + corner] + slope * X_rate
            buffer[(first + 2) * LANES + j] = inputs[8 + corner]
            buffer[(first + 3) * LANES + j] = inputs[12 + corner]
