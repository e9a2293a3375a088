"""One corner's share of the equations of motion, and of the chassis's own.

Unknowns are the accelerations (x'', z'', pitch'', roll'') of the chassis, below called c, and
a'' of each arm. An arm couples to the chassis only:

    M_cc c'' + sum_i m_i a_i'' + h_c = Q_c,      m_i . c'' + M_i a_i'' + h_i = Q_i

h holds centrifugal, Coriolis and gravity terms, found
as the inertia forces at zero second derivatives with gravity as an upward acceleration g e_Z.
"""

from typing import NamedTuple

from ..frames import GRAVITY
from ..jit import inlined
from .kinematics import convective_acceleration, pivot, turned
from .vec3 import add, cross, cross_xz, dot, scale


class ChassisMass(NamedTuple):
    """The ten different elements of the mass matrix of (x, z, pitch, roll)."""

    xx: float
    xz: float
    zz: float
    xp: float
    xr: float
    zp: float
    zr: float
    pp: float
    pr: float
    rr: float


class Quad(NamedTuple):
    """One number for each chassis coordinate: a force, a coupling column or an acceleration."""

    x: float
    z: float
    pitch: float
    roll: float


class ArmEquation(NamedTuple):
    """m, M and h of one arm with what it adds to the chassis."""

    coupling: Quad
    inertia: float
    bias: float
    chassis_mass: ChassisMass
    chassis_bias: Quad


@inlined
def quad_add(a, b):
    """Sum."""
    return Quad(a.x + b.x, a.z + b.z, a.pitch + b.pitch, a.roll + b.roll)


@inlined
def quad_scale(factor, a):
    """Product with a number."""
    return Quad(factor * a.x, factor * a.z, factor * a.pitch, factor * a.roll)


@inlined
def quad_dot(a, b):
    """Inner product."""
    return a.x * b.x + a.z * b.z + a.pitch * b.pitch + a.roll * b.roll


@inlined
def mass_add(a, b):
    """Sum."""
    return ChassisMass(
        a.xx + b.xx,
        a.xz + b.xz,
        a.zz + b.zz,
        a.xp + b.xp,
        a.xr + b.xr,
        a.zp + b.zp,
        a.zr + b.zr,
        a.pp + b.pp,
        a.pr + b.pr,
        a.rr + b.rr,
    )


@inlined
def outer_product(factor, a, b):
    """factor a b^T of two parallel Quads, symmetric."""
    return ChassisMass(
        factor * a.x * b.x,
        factor * a.x * b.z,
        factor * a.z * b.z,
        factor * a.x * b.pitch,
        factor * a.x * b.roll,
        factor * a.z * b.pitch,
        factor * a.z * b.roll,
        factor * a.pitch * b.pitch,
        factor * a.pitch * b.roll,
        factor * a.roll * b.roll,
    )


@inlined
def generalized_force(chassis, force_B, moment_B):
    """Virtual work of a force at the chassis CG and a moment, both in B.

    x and z move along e_X and e_Z, pitch turns about e_Y, roll about B's x axis.
    """
    return Quad(
        dot(chassis.e_X, force_B),
        dot(chassis.e_Z, force_B),
        about_pitch_axis(chassis, moment_B),
        moment_B[0],
    )


@inlined
def about_pitch_axis(chassis, moment_B):
    """e_Y . moment; e_Y has no x."""
    return chassis.e_Y[1] * moment_B[1] + chassis.e_Y[2] * moment_B[2]


@inlined
def about_roll_axis(arm, force):
    """x of arm x force, both in B."""
    return arm[1] * force[2] - arm[2] * force[1]


@inlined
def inertia_moment(xx, yy, zz, xz, w, w_rate):
    """I w' + w x I w of a body whose products of inertia are xz only."""
    spin = (xx * w[0] + xz * w[2], yy * w[1], xz * w[0] + zz * w[2])
    change = (xx * w_rate[0] + xz * w_rate[2], yy * w_rate[1], xz * w_rate[0] + zz * w_rate[2])
    return add(change, cross(w, spin))


@inlined
def rotational_mass(chassis, xx, yy, zz, xy, yz, xz):
    """Elements pp, pr, rr of the mass matrix from an inertia tensor about the chassis CG, B."""
    _, cr, sr_negative = chassis.e_Y
    pp = cr * cr * yy + 2.0 * cr * sr_negative * yz + sr_negative * sr_negative * zz
    pr = cr * xy + sr_negative * xz
    return pp, pr, xx


@inlined
def sprung_mass(body, chassis):
    """Mass matrix and bias of the sprung mass alone; its CG is the reference point."""
    pp, pr, rr = rotational_mass(chassis, body.xx, body.yy, body.zz, 0.0, 0.0, body.xz)
    moment = inertia_moment(body.xx, body.yy, body.zz, body.xz, chassis.w, chassis.w_rate)
    return (
        ChassisMass(body.mass, 0.0, body.mass, 0.0, 0.0, 0.0, 0.0, pp, pr, rr),
        Quad(0.0, body.mass * GRAVITY, about_pitch_axis(chassis, moment), moment[0]),
    )


@inlined
def arm_equation(corner, chassis, arm):
    """Inertia of wheel and arm, one rigid body hinged to the chassis about y at the pivot.

    Its centre of gravity c moves by e_Y x c per unit of pitch and by e_x x c per unit of roll, so
    that e_X . (e_Y x c) = e_Z . c and e_Z . (e_Y x c) = -e_X . c.
    """
    p = turned(corner.cg_x, corner.cg_y, corner.cg_z, arm)
    c = add(pivot(corner), p)
    mass = corner.mass

    # Inertia tensor in B: principal axes turned by the arm, then moved to the chassis CG.
    ss, cc, sc = arm.sine * arm.sine, arm.cosine * arm.cosine, arm.sine * arm.cosine
    xx = cc * corner.xx + ss * corner.zz
    zz = ss * corner.xx + cc * corner.zz
    xz = sc * (corner.zz - corner.xx)
    pp, pr, rr = rotational_mass(
        chassis,
        xx + mass * (c[1] * c[1] + c[2] * c[2]),
        corner.yy + mass * (c[0] * c[0] + c[2] * c[2]),
        zz + mass * (c[0] * c[0] + c[1] * c[1]),
        -mass * c[0] * c[1],
        -mass * c[1] * c[2],
        xz - mass * c[0] * c[2],
    )
    chassis_mass = ChassisMass(
        mass,
        0.0,
        mass,
        mass * dot(chassis.e_Z, c),
        mass * about_roll_axis(c, chassis.e_X),
        -mass * dot(chassis.e_X, c),
        mass * about_roll_axis(c, chassis.e_Z),
        pp,
        pr,
        rr,
    )

    # Momentum and spin per unit of the arm's rate; c moves along e_y x p = (p_z, 0, -p_x).
    x_momentum, z_momentum = mass * p[2], -mass * p[0]
    spin = add(cross_xz(c, x_momentum, z_momentum), (0.0, corner.yy, 0.0))
    coupling = Quad(
        chassis.e_X[0] * x_momentum + chassis.e_X[2] * z_momentum,
        chassis.e_Z[0] * x_momentum + chassis.e_Z[2] * z_momentum,
        about_pitch_axis(chassis, spin),
        spin[0],
    )
    inertia = corner.yy + mass * (p[0] * p[0] + p[2] * p[2])

    upward = scale(GRAVITY, chassis.e_Z)
    force = scale(mass, add(convective_acceleration(chassis, arm, c, p), upward))
    w = add(chassis.w, (0.0, arm.rate, 0.0))
    w_rate = add(chassis.w_rate, (-arm.rate * chassis.w[2], 0.0, arm.rate * chassis.w[0]))
    moment = inertia_moment(xx, corner.yy, zz, xz, w, w_rate)
    chassis_bias = generalized_force(chassis, force, add(cross(c, force), moment))
    bias = moment[1] + p[2] * force[0] - p[0] * force[2]
    return ArmEquation(coupling, inertia, bias, chassis_mass, chassis_bias)


@inlined
def wheel_force_effect(chassis, wheel, force_X, force_Z, radius):
    """Generalized forces of a longitudinal and a vertical force on a wheel.

    The vertical force's line of action passes through the wheel centre C; the longitudinal one
    acts r below it along inertial Z, which adds the moment -r Fx about e_Y. About e_Y the arms of
    the two are e_Y . (C x e_X) = e_Z . C and e_Y . (C x e_Z) = -e_X . C.
    Returns the chassis's Quad and the arm's moment about its pivot.
    """
    force = add(scale(force_X, chassis.e_X), scale(force_Z, chassis.e_Z))
    on_chassis = Quad(
        force_X,
        force_Z,
        force_X * (wheel.above - radius) - force_Z * wheel.ahead,
        about_roll_axis(wheel.centre, force),
    )
    p, below = wheel.arm, -radius * force_X * chassis.e_Y[1]
    return on_chassis, p[2] * force[0] - p[0] * force[2] + below
