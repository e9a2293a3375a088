"""Forces of springs, dampers, bars and tyres."""

from math import sqrt
from typing import NamedTuple

from ..frames import CREEP_SPEED
from ..jit import inlined
from .elementary import hyperbolic_tangent


class Strut(NamedTuple):
    """Spring-damper element: its state and forces, N, compression positive."""

    travel: float
    """L0 - L, jounce positive, m."""
    spring: float
    damper: float
    axis_x: float
    """Unit vector from wheel centre to mount, B (it has no y)."""
    axis_z: float
    moment: float
    """On the arm about its pivot, N m."""
    clearance: float
    """Height of the mount above the wheel centre, m; at 0 the wheel passes it."""


@inlined
def direction_of_travel(x_rate):
    """tanh(v / v0), v the chassis's x rate: +1 forward, -1 backward, 0 at rest."""
    return hyperbolic_tangent(x_rate / CREEP_SPEED)


@inlined
def damper_slope(corner, jounce_rate):
    """Force of a damper over the rate j at which it shortens, N s/m (eq. 9 of docs/model.md).

    That of a linear damper is its damping, to the last bit.
    """
    slope = corner.jounce_damping if jounce_rate > 0.0 else corner.rebound_damping
    return slope / (1.0 + abs(jounce_rate) * corner.per_knee)


@inlined
def strut(corner, p, arm):
    """Spring-damper between the wheel centre p (from the pivot, B) and the mount.

    F = F0 + K (L0 - L) + D j, j = -dL/dt, on the mount along the element, minus that on the wheel
    (eq. 9 of docs/model.md). Only the arm's rotation changes L.
    """
    x, z = corner.mount_x - p[0], corner.mount_z - p[2]
    length = sqrt(x * x + z * z)
    axis_x, axis_z = x / length, z / length
    lever = axis_x * p[2] - axis_z * p[0]
    jounce_rate = arm.rate * lever
    travel = corner.rest_length - length
    spring = corner.preload + corner.stiffness * travel
    damper = damper_slope(corner, jounce_rate) * jounce_rate
    moment = -(spring + damper) * lever
    return Strut(travel, spring, damper, axis_x, axis_z, moment, z)


@inlined
def bar_torque(stiffness, damping, twist, twist_rate):
    """Torque of a stabilizer bar: minus this on the left arm, plus this on the right one.

    twist : angle of the left arm less that of the right one, rad
    """
    return stiffness * twist + damping * twist_rate


@inlined
def tyre_load(corner, wheel, road, road_rate):
    """W = W0 + Kt (road - rise) + Ct (road' - rise'), not below the load floor, N."""
    load = (
        corner.static_load
        + corner.tyre_stiffness * (road - wheel.rise)
        + corner.tyre_damping * (road_rate - wheel.rise_rate)
    )
    return max(load, corner.load_floor)


@inlined
def road_wheel_force(corner, load, given, direction):
    """Longitudinal force at r below the wheel centre, and the torque of its cause on the arm.

    Fx = T / r - (B / r + fr W) tanh(v / v0). Torque that the chassis exerts on the arm: +T and
    -B tanh where the reaction is on the chassis, nothing where it stays inside the arm.
    """
    braking = given.brake * direction
    force = (given.drive - braking) / corner.radius - corner.rolling_resistance * load * direction
    torque = corner.drive_reaction * given.drive - corner.brake_reaction * braking
    return force, torque
