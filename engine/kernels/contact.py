"""What is under the wheels: their X, the road there, and the posts."""

from ..jit import inlined
from .buffer import CONTACT, GIVEN, WHEEL_ROWS, corner_of, keep_turn, stage_state
from .kinematics import arm_pose, attitude, turn_by, wheel_motion
from .road import road_under


@inlined
def _contact(corner, chassis, state, arm):
    """X of a wheel centre (m) and its rate (m/s)."""
    wheel = wheel_motion(corner, chassis, arm, state.z, state.x_rate, state.z_rate)
    return state.x + wheel.ahead, wheel.velocity_X


@inlined
def find_contacts(buffer, LANES):
    """Where the four wheels of every lane are; leaves the turns behind for the forces."""
    for j in range(LANES):
        state = stage_state(buffer, LANES, j)
        pitch, roll = turn_by(state.pitch), turn_by(state.roll)
        turns = turn_by(state.fl), turn_by(state.fr), turn_by(state.rl), turn_by(state.rr)
        chassis = attitude(pitch, roll, state.pitch_rate, state.roll_rate)
        arm = arm_pose(state.fl, turns[0], state.fl_rate)
        fl = _contact(corner_of(buffer, 0, LANES, j), chassis, state, arm)
        arm = arm_pose(state.fr, turns[1], state.fr_rate)
        fr = _contact(corner_of(buffer, 1, LANES, j), chassis, state, arm)
        arm = arm_pose(state.rl, turns[2], state.rl_rate)
        rl = _contact(corner_of(buffer, 2, LANES, j), chassis, state, arm)
        arm = arm_pose(state.rr, turns[3], state.rr_rate)
        rr = _contact(corner_of(buffer, 3, LANES, j), chassis, state, arm)
        buffer[(CONTACT + 0) * LANES + j], buffer[(CONTACT + 1) * LANES + j] = fl
        buffer[(CONTACT + 2) * LANES + j], buffer[(CONTACT + 3) * LANES + j] = fr
        buffer[(CONTACT + 4) * LANES + j], buffer[(CONTACT + 5) * LANES + j] = rl
        buffer[(CONTACT + 6) * LANES + j], buffer[(CONTACT + 7) * LANES + j] = rr
        keep_turn(buffer, 0, LANES, j, pitch)
        keep_turn(buffer, 1, LANES, j, roll)
        keep_turn(buffer, 2, LANES, j, turns[0])
        keep_turn(buffer, 3, LANES, j, turns[1])
        keep_turn(buffer, 4, LANES, j, turns[2])
        keep_turn(buffer, 5, LANES, j, turns[3])


@inlined
def read_road(buffer, LANES, inputs, road, start, spacing):
    """What is under each wheel and acts on it: the road at its X, on top of the post.

    A loop of its own, since a table look-up cannot become vector code.
    """
    per_metre = 1.0 / spacing
    for j in range(LANES):
        for corner in range(4):
            X = buffer[(CONTACT + 2 * corner) * LANES + j]
            X_rate = buffer[(CONTACT + 2 * corner + 1) * LANES + j]
            height, slope = road_under(road[corner % 2], start, per_metre, X)
            first = GIVEN + WHEEL_ROWS * corner
            buffer[first * LANES + j] = inputs[corner] + height
            buffer[(first + 1) * LANES + j] = inputs[4 + corner] + slope * X_rate
            buffer[(first + 2) * LANES + j] = inputs[8 + corner]
            buffer[(first + 3) * LANES + j] = inputs[12 + corner]
