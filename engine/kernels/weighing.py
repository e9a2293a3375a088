"""Acceleration of a point of the chassis at the stages of a step, and its weighting's filters."""

from ..jit import inlined
from .buffer import ROWS, chassis_at, slope_at
from .vec3 import add, cross, dot, times

VERTICAL, HORIZONTAL = 8, 6
"""States of the filters Wk and Wd, two for each of their modes."""
FILTER_TERMS = 5
"""Of a state at the end of a step: both of its mode, and the acceleration at three instants."""

IN_HORIZONTAL = ROWS
"""`WeightingFilter.step` and C of both filters, the same in every lane."""
IN_VERTICAL = IN_HORIZONTAL + HORIZONTAL * FILTER_TERMS
IN_HORIZONTAL_OUTPUT = IN_VERTICAL + VERTICAL * FILTER_TERMS
IN_VERTICAL_OUTPUT = IN_HORIZONTAL_OUTPUT + HORIZONTAL
POINT = IN_VERTICAL_OUTPUT + VERTICAL
"""Acceleration along X, Y and Z at the begin, the same at the middle and the end of the step."""
NOTED = POINT + 9
"""The same at the stage."""
FILTERS = NOTED + 3
"""States of the filters of X, Y and Z."""
NEXT = FILTERS + 2 * HORIZONTAL + VERTICAL
"""The same at the end of the step."""
FILTERS_END = NEXT + 2 * HORIZONTAL + VERTICAL

X_FILTER, Y_FILTER, Z_FILTER = 0, HORIZONTAL, 2 * HORIZONTAL


@inlined
def point_acceleration(chassis, point, x_dd, z_dd, pitch_dd, roll_dd):
    """Inertial acceleration of a chassis point along X, Y and Z, m/s2, gravity excluded.

    (x'', 0, z'') + R (T p + (roll'' e_x + pitch'' e_Y) x p)
    """
    angular = (roll_dd, pitch_dd * chassis.e_Y[1], pitch_dd * chassis.e_Y[2])
    relative = add(times(chassis.turning, point), cross(angular, point))
    return (
        x_dd + dot(chassis.e_X, relative),
        dot(chassis.e_Y, relative),
        z_dd + dot(chassis.e_Z, relative),
    )


@inlined
def watch_point(buffer, LANES, stage, point):
    """Note every lane's acceleration at the stage; the middle's is the mean of two stages."""
    x, y, z = point[0], point[1], point[2]
    for j in range(LANES):
        _, chassis = chassis_at(buffer, LANES, j)
        c = slope_at(buffer, LANES, j)
        a_X, a_Y, a_Z = point_acceleration(
            chassis, (x, y, z), c.x_rate, c.z_rate, c.pitch_rate, c.roll_rate
        )
        buffer[(NOTED + 0) * LANES + j] = a_X
        buffer[(NOTED + 1) * LANES + j] = a_Y
        buffer[(NOTED + 2) * LANES + j] = a_Z
    # Rows that the compiler knows: it could not prove others apart.
    if stage == 0:
        _note(buffer, LANES, POINT, 0.0)
    elif stage == 1:
        _note(buffer, LANES, POINT + 3, 0.0)
    elif stage == 2:
        _note(buffer, LANES, POINT + 3, 0.5)
    else:
        _note(buffer, LANES, POINT + 6, 0.0)


@inlined
def _note(buffer, LANES, into, before):
    """Move three rows, mixed with a share of what is there."""
    for k in range(3 * LANES):
        new = (1.0 - before) * buffer[NOTED * LANES + k]
        buffer[into * LANES + k] = before * buffer[into * LANES + k] + new


@inlined
def set_filters(buffer, LANES, watch, kind):
    """Give every lane the filters of one length of step: numbers that do not depend on the lane
    would keep the loops over lanes scalar.
    """
    _spread(buffer, LANES, IN_HORIZONTAL, watch.horizontal[kind].ravel())
    _spread(buffer, LANES, IN_VERTICAL, watch.vertical[kind].ravel())
    _spread(buffer, LANES, IN_HORIZONTAL_OUTPUT, watch.horizontal_output)
    _spread(buffer, LANES, IN_VERTICAL_OUTPUT, watch.vertical_output)


@inlined
def _spread(buffer, LANES, row, values):
    for k in range(values.shape[0]):
        for j in range(LANES):
            buffer[(row + k) * LANES + j] = values[k]


@inlined
def weigh(buffer, LANES):
    """Move the filters of every lane over the step."""
    for j in range(LANES):
        _filter(buffer, LANES, j, X_FILTER, HORIZONTAL, 0, IN_HORIZONTAL)
        _filter(buffer, LANES, j, Y_FILTER, HORIZONTAL, 1, IN_HORIZONTAL)
        _filter(buffer, LANES, j, Z_FILTER, VERTICAL, 2, IN_VERTICAL)
    for k in range((2 * HORIZONTAL + VERTICAL) * LANES):
        buffer[FILTERS * LANES + k] = buffer[NEXT * LANES + k]


@inlined
def _filter(buffer, LANES, lane, first, size, axis, step):
    """`WeightingFilter.step`, in rows `step` on, of one lane and axis."""
    for row in range(size):
        mode, g = FILTERS + first + 2 * (row // 2), step + row * FILTER_TERMS
        value = buffer[g * LANES + lane] * buffer[mode * LANES + lane]
        value += buffer[(g + 1) * LANES + lane] * buffer[(mode + 1) * LANES + lane]
        value += buffer[(g + 2) * LANES + lane] * buffer[(POINT + axis) * LANES + lane]
        value += buffer[(g + 3) * LANES + lane] * buffer[(POINT + 3 + axis) * LANES + lane]
        value += buffer[(g + 4) * LANES + lane] * buffer[(POINT + 6 + axis) * LANES + lane]
        buffer[(NEXT + first + row) * LANES + lane] = value


@inlined
def weighted(buffer, LANES, lane, first, size, output):
    """Weighted acceleration of a lane along one axis, m/s2."""
    value = 0.0
    for k in range(size):
        value += buffer[(output + k) * LANES + lane] * buffer[(FILTERS + first + k) * LANES + lane]
    return value
