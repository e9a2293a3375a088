"""Where chassis and wheels are and how fast they move.

Attitude R = Ry(pitch) Rx(roll). The inertial axes expressed in B are the rows of R:

    e_X = (cos p, sin p sin r, sin p cos r)
    e_Y = (0, cos r, -sin r)
    e_Z = (-sin p, cos p sin r, cos p cos r)

so that the pitch rate turns the chassis about e_Y and the roll rate about B's x axis:

    w = (roll', pitch' cos r, -pitch' sin r)                        (eq. 2 of docs/model.md)

`w_rate` is the part of dw/dt left when all second derivatives are zero, pitch' roll' (0, -sin r,
-cos r). Zeros are left out of products: 0 x is not 0 where x may be infinite, so that the compiler
would have to multiply.
"""

from typing import NamedTuple

from ..jit import inlined
from .elementary import cosine, sine
from .vec3 import add, cross, cross_xz, dot, scale, times, y_cross


class Turn(NamedTuple):
    """Sine and cosine of an angle."""

    sine: float
    cosine: float


class Attitude(NamedTuple):
    """Orientation and angular velocity of the chassis, expressed in B."""

    e_X: tuple[float, float, float]
    e_Y: tuple[float, float, float]
    e_Z: tuple[float, float, float]
    w: tuple[float, float, float]
    w_rate: tuple[float, float, float]
    turning: tuple[
        tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]
    ]
    """T with T c = w_rate x c + w x (w x c) for every c."""


class ArmPose(NamedTuple):
    """Angle of a trailing arm with its sine, cosine and rate."""

    angle: float
    sine: float
    cosine: float
    rate: float


class WheelMotion(NamedTuple):
    """Wheel centre: from the pivot, from the chassis CG (both in B), and its inertial motion."""

    arm: tuple[float, float, float]
    centre: tuple[float, float, float]
    ahead: float
    """e_X . centre"""
    above: float
    """e_Z . centre"""
    velocity_X: float
    rise: float
    """Vertical displacement from rest."""
    rise_rate: float


@inlined
def turn_by(angle):
    """Sine and cosine of an angle, rad."""
    return Turn(sine(angle), cosine(angle))


@inlined
def attitude(pitch, roll, pitch_rate, roll_rate):
    """Attitude of the chassis from its two turns and their rates (rad/s)."""
    sp, cp, sr, cr = pitch.sine, pitch.cosine, roll.sine, roll.cosine
    product = pitch_rate * roll_rate
    a, b, c = roll_rate, pitch_rate * cr, -pitch_rate * sr
    b_rate, c_rate = -product * sr, -product * cr
    return Attitude(
        (cp, sp * sr, sp * cr),
        (0.0, cr, -sr),
        (-sp, cp * sr, cp * cr),
        (a, b, c),
        (0.0, b_rate, c_rate),
        (
            (-b * b - c * c, a * b - c_rate, a * c + b_rate),
            (a * b + c_rate, -a * a - c * c, b * c),
            (a * c - b_rate, b * c, -a * a - b * b),
        ),
    )


@inlined
def arm_pose(angle, turn, rate):
    """Pose of an arm whose angle is a coordinate of its own."""
    return ArmPose(angle, turn.sine, turn.cosine, rate)


@inlined
def turned(x, y, z, arm):
    """Point (x, y, z), given from the pivot at rest, after the arm has turned about y."""
    return (x * arm.cosine + z * arm.sine, y, z * arm.cosine - x * arm.sine)


@inlined
def pivot(corner):
    """Pivot from the chassis CG, B."""
    return (corner.pivot_x, corner.pivot_y, corner.pivot_z)


@inlined
def wheel_motion(corner, chassis, arm, z, x_rate, z_rate):
    """Motion of a wheel centre.

    velocity = (x', 0, z') + R (w x centre + arm' (e_y x p)),  p = wheel centre from the pivot
    """
    p = turned(corner.arm_x, 0.0, corner.arm_z, arm)
    centre = add(pivot(corner), p)
    relative = add(cross(chassis.w, centre), scale(arm.rate, y_cross(p)))
    rest = corner.pivot_z + corner.arm_z
    above = dot(chassis.e_Z, centre)
    return WheelMotion(
        p,
        centre,
        dot(chassis.e_X, centre),
        above,
        x_rate + dot(chassis.e_X, relative),
        z + above - rest,
        z_rate + dot(chassis.e_Z, relative),
    )


@inlined
def convective_acceleration(chassis, arm, from_cg, from_pivot):
    """Acceleration of a point of the arm when all second derivatives are zero, in B.

    w' x c + w x (w x c) + 2 w x (arm' e_y x p) + arm'^2 e_y x (e_y x p),
    the last product being -(p_x, 0, p_z)
    """
    x, _, z = from_pivot
    turning = times(chassis.turning, from_cg)
    coriolis = scale(2.0 * arm.rate, cross_xz(chassis.w, z, -x))
    inwards = arm.rate * arm.rate
    return (
        turning[0] + coriolis[0] - inwards * x,
        turning[1] + coriolis[1],
        turning[2] + coriolis[2] - inwards * z,
    )
