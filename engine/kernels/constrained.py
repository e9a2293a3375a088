"""Accelerations of the car on prescribed rims: the identification mode.

The wheel centres' heights are given, so each arm's angle, rate and acceleration follow from the
chassis and the unknown vertical force N_i at the wheel follows from the arm's equation:

    a_i''  = (u'' - k_i - V_i . c'') / g_i                                       (eq. 13)
    N_i    = (m_i . c'' + M_i a_i'' + h_i - S_i - s_i D_i F) / (g_i - e_i X_i)   (eq. 14)

V_i, g_i : what a unit vertical force at the wheel centre does to chassis and arm; X_i, X_ci: the
same for a unit longitudinal force r below; D_i, D_ci: for a unit of traction with its torque;
k_i : vertical acceleration of the wheel centre at zero second derivatives; e_i = fr tanh(v/v0), so
that rolling resistance is e_i N_i; S_i : spring-damper and bar; s_i : the wheel's share of the
traction F. Put into the chassis's equations these leave five linear equations for (c'', F), the
fifth being either x'' = a_x (exact) or F = M a_x + sum e_i N_i (paper).
"""

from math import sqrt
from typing import NamedTuple

from ..jit import inlined
from .elementary import angle_of
from .equations import (
    ArmEquation,
    Quad,
    arm_equation,
    quad_add,
    quad_scale,
    sprung_mass,
    wheel_force_effect,
)
from .forces import bar_torque, strut
from .kinematics import ArmPose, WheelMotion, convective_acceleration, pivot, wheel_motion
from .vec3 import dot


class RimCorner(NamedTuple):
    """One corner on its prescribed rim at one instant, before its bar is known."""

    arm: ArmPose
    wheel: WheelMotion
    equation: ArmEquation
    lever: float
    """g: rise of the wheel centre per unit of arm angle, m/rad."""
    vertical: Quad
    """V"""
    free_rise: float
    """u'' - k"""
    resistance: float
    """e"""
    rolling: Quad
    """X_c"""
    rolling_arm: float
    """X"""
    traction: Quad
    """s D_c"""
    traction_arm: float
    """s D"""
    moment: float
    """S without the bar"""
    reach: float
    """Positive while the wheel centre can reach its prescribed height."""
    clearance: float
    """Of the spring-damper's mount."""


class Linear(NamedTuple):
    """An affine function of the five unknowns: constant + on . c'' + traction F."""

    on: Quad
    traction: float
    constant: float


class RimAccelerations(NamedTuple):
    """Second derivatives of all coordinates, the traction and the four vertical forces."""

    chassis: Quad
    traction: float
    fl: float
    fr: float
    rl: float
    rr: float
    fl_load: float
    fr_load: float
    rl_load: float
    rr_load: float


@inlined
def reached_arm(corner, chassis, z, z_rate, rim):
    """Arm pose that puts the wheel centre at its prescribed height and rise rate.

    e_Z . (pivot + Ry(a) p) = rest + u - z is P cos a + Q sin a = D; of the two solutions the one
    around a = 0. Returns the pose and 1 - D^2 / (P^2 + Q^2), negative out of reach.
    """
    e = chassis.e_Z
    P = e[0] * corner.arm_x + e[2] * corner.arm_z
    Q = e[0] * corner.arm_z - e[2] * corner.arm_x
    rest = corner.pivot_z + corner.arm_z
    D = rest + rim.u - z - dot(e, pivot(corner))
    square = P * P + Q * Q
    reach = 1.0 - D * D / square
    k = sqrt(square * max(reach, 0.0))
    signed = k if Q >= 0.0 else -k
    cosine_a = (P * D + Q * signed) / square
    sine_a = (Q * D - P * signed) / square
    angle = angle_of(sine_a, cosine_a)
    at_rest = ArmPose(angle, sine_a, cosine_a, 0.0)
    carried = wheel_motion(corner, chassis, at_rest, z, 0.0, z_rate)
    rate = (rim.u_rate - carried.rise_rate) / rise_per_angle(chassis, carried)
    return ArmPose(angle, sine_a, cosine_a, rate), reach


@inlined
def rise_per_angle(chassis, wheel):
    """g = e_Z . (e_y x p), m/rad: positive lever for the rear, negative for the front."""
    return chassis.e_Z[0] * wheel.arm[2] - chassis.e_Z[2] * wheel.arm[0]


@inlined
def rim_corner(corner, chassis, z, z_rate, rim, direction, braking):
    """Geometry, inertia and unit-force effects of one corner on its rim.

    direction : tanh(v/v0); braking : weight b between driving (0) and braking (1)
    """
    arm, reach = reached_arm(corner, chassis, z, z_rate, rim)
    wheel = wheel_motion(corner, chassis, arm, z, 0.0, z_rate)
    equation = arm_equation(corner, chassis, arm)
    vertical, lever = wheel_force_effect(chassis, wheel, 0.0, 1.0, corner.radius)
    rolling, rolling_arm = wheel_force_effect(chassis, wheel, 1.0, 0.0, corner.radius)
    convective = convective_acceleration(chassis, arm, wheel.centre, wheel.arm)
    driven = (1.0 - braking) * corner.drive_share
    braked = braking * corner.brake_share
    torque = corner.radius * (driven * corner.drive_reaction + braked * corner.brake_reaction)
    share = driven + braked
    element = strut(corner, wheel.arm, arm)
    return RimCorner(
        arm,
        wheel,
        equation,
        lever,
        vertical,
        rim.u_acceleration - dot(chassis.e_Z, convective),
        corner.rolling_resistance * direction,
        rolling,
        rolling_arm,
        quad_scale(share, rolling),
        share * rolling_arm + torque,
        element.moment,
        reach,
        element.clearance,
    )


@inlined
def arm_acceleration(corner):
    """Affine a'' (eq. 13)."""
    inverse = 1.0 / corner.lever
    return Linear(quad_scale(-inverse, corner.vertical), 0.0, inverse * corner.free_rise)


@inlined
def wheel_load(corner, moment):
    """Affine N (eq. 14); moment : S with the bar, N m."""
    equation = corner.equation
    bend = arm_acceleration(corner)
    inverse = 1.0 / (corner.lever - corner.resistance * corner.rolling_arm)
    on = quad_add(equation.coupling, quad_scale(equation.inertia, bend.on))
    constant = equation.inertia * bend.constant + equation.bias - moment
    return Linear(quad_scale(inverse, on), -inverse * corner.traction_arm, inverse * constant)


@inlined
def row(mass_row, coupling, force, traction, bend, load):
    """One chassis equation's share from one corner, everything on the left-hand side.

    mass_row . c'' + coupling a'' - force N - traction F
    """
    on = quad_add(quad_add(mass_row, quad_scale(coupling, bend.on)), quad_scale(-force, load.on))
    return Linear(
        on,
        -traction - force * load.traction,
        coupling * bend.constant - force * load.constant,
    )


@inlined
def linear_add(a, b):
    """Sum."""
    return Linear(quad_add(a.on, b.on), a.traction + b.traction, a.constant + b.constant)


@inlined
def corner_rows(corner, moment):
    """Shares of one corner in the chassis's equations z, pitch, roll and x, and its load."""
    equation = corner.equation
    bend = arm_acceleration(corner)
    load = wheel_load(corner, moment)
    mass, m, bias = equation.chassis_mass, equation.coupling, equation.chassis_bias
    up, back, e = corner.vertical, corner.rolling, corner.resistance
    pull = corner.traction
    z = row(Quad(mass.xz, mass.zz, mass.zp, mass.zr), m.z, up.z - e * back.z, pull.z, bend, load)
    pitch = row(
        Quad(mass.xp, mass.zp, mass.pp, mass.pr),
        m.pitch,
        up.pitch - e * back.pitch,
        pull.pitch,
        bend,
        load,
    )
    roll = row(
        Quad(mass.xr, mass.zr, mass.pr, mass.rr),
        m.roll,
        up.roll - e * back.roll,
        pull.roll,
        bend,
        load,
    )
    x = row(Quad(mass.xx, mass.xz, mass.xp, mass.xr), m.x, up.x - e * back.x, pull.x, bend, load)
    return (
        Linear(z.on, z.traction, z.constant + bias.z),
        Linear(pitch.on, pitch.traction, pitch.constant + bias.pitch),
        Linear(roll.on, roll.traction, roll.constant + bias.roll),
        Linear(x.on, x.traction, x.constant + bias.x),
        load,
    )


@inlined
def without_z(equation, pivot_row):
    """Equation with z'' eliminated through the pivot row."""
    factor = -equation.on.z / pivot_row.on.z
    return eliminated(equation, pivot_row, factor)


@inlined
def without_pitch(equation, pivot_row):
    """Equation with pitch'' eliminated through the pivot row."""
    factor = -equation.on.pitch / pivot_row.on.pitch
    return eliminated(equation, pivot_row, factor)


@inlined
def without_roll(equation, pivot_row):
    """Equation with roll'' eliminated through the pivot row."""
    factor = -equation.on.roll / pivot_row.on.roll
    return eliminated(equation, pivot_row, factor)


@inlined
def eliminated(equation, pivot_row, factor):
    """Equation plus factor times the pivot row."""
    return Linear(
        quad_add(equation.on, quad_scale(factor, pivot_row.on)),
        equation.traction + factor * pivot_row.traction,
        equation.constant + factor * pivot_row.constant,
    )


@inlined
def solve(z, pitch, roll, x, closing):
    """Unknowns that make the five affine functions zero.

    z, pitch, roll have a positive definite block of their own (but for rolling resistance) and
    need no pivoting; x'' and the traction remain in two equations solved by Cramer's rule.
    """
    pitch, roll = without_z(pitch, z), without_z(roll, z)
    x, closing = without_z(x, z), without_z(closing, z)
    roll = without_pitch(roll, pitch)
    x, closing = without_pitch(x, pitch), without_pitch(closing, pitch)
    x, closing = without_roll(x, roll), without_roll(closing, roll)
    determinant = x.on.x * closing.traction - x.traction * closing.on.x
    x_dd = (x.traction * closing.constant - x.constant * closing.traction) / determinant
    traction = (closing.on.x * x.constant - x.on.x * closing.constant) / determinant
    roll_dd = -(roll.on.x * x_dd + roll.traction * traction + roll.constant) / roll.on.roll
    pitch_dd = (
        -(pitch.on.x * x_dd + pitch.on.roll * roll_dd + pitch.traction * traction + pitch.constant)
        / pitch.on.pitch
    )
    z_dd = (
        -(
            z.on.x * x_dd
            + z.on.pitch * pitch_dd
            + z.on.roll * roll_dd
            + z.traction * traction
            + z.constant
        )
        / z.on.z
    )
    return Quad(x_dd, z_dd, pitch_dd, roll_dd), traction


@inlined
def value(function, acceleration, traction):
    """Value of an affine function of the unknowns."""
    on = function.on
    return (
        function.constant
        + function.traction * traction
        + on.x * acceleration.x
        + on.z * acceleration.z
        + on.pitch * acceleration.pitch
        + on.roll * acceleration.roll
    )


@inlined
def rim_accelerations(body, chassis, fl, fr, rl, rr, a_x, exact):
    """All second derivatives, the traction and the vertical forces.

    a_x : prescribed chassis acceleration, m/s2; exact : 1.0 to follow it exactly, 0.0 for the
    paper's traction
    """
    front = bar_torque(body.front_bar_stiffness, body.front_bar_damping, fl.arm, fr.arm)
    rear = bar_torque(body.rear_bar_stiffness, body.rear_bar_damping, rl.arm, rr.arm)
    fl_z, fl_p, fl_r, fl_x, fl_load = corner_rows(fl, fl.moment - front)
    fr_z, fr_p, fr_r, fr_x, fr_load = corner_rows(fr, fr.moment + front)
    rl_z, rl_p, rl_r, rl_x, rl_load = corner_rows(rl, rl.moment - rear)
    rr_z, rr_p, rr_r, rr_x, rr_load = corner_rows(rr, rr.moment + rear)

    mass, bias = sprung_mass(body, chassis)
    own_z = Linear(Quad(mass.xz, mass.zz, mass.zp, mass.zr), 0.0, bias.z)
    own_p = Linear(Quad(mass.xp, mass.zp, mass.pp, mass.pr), 0.0, bias.pitch)
    own_r = Linear(Quad(mass.xr, mass.zr, mass.pr, mass.rr), 0.0, bias.roll)
    own_x = Linear(Quad(mass.xx, mass.xz, mass.xp, mass.xr), 0.0, bias.x)
    z = linear_add(own_z, linear_add(linear_add(fl_z, fr_z), linear_add(rl_z, rr_z)))
    pitch = linear_add(own_p, linear_add(linear_add(fl_p, fr_p), linear_add(rl_p, rr_p)))
    roll = linear_add(own_r, linear_add(linear_add(fl_r, fr_r), linear_add(rl_r, rr_r)))
    x = linear_add(own_x, linear_add(linear_add(fl_x, fr_x), linear_add(rl_x, rr_x)))

    none = Quad(0.0, 0.0, 0.0, 0.0)
    resistance = linear_add(
        linear_add(
            eliminated(Linear(none, 0.0, 0.0), fl_load, fl.resistance),
            eliminated(Linear(none, 0.0, 0.0), fr_load, fr.resistance),
        ),
        linear_add(
            eliminated(Linear(none, 0.0, 0.0), rl_load, rl.resistance),
            eliminated(Linear(none, 0.0, 0.0), rr_load, rr.resistance),
        ),
    )
    paper = 1.0 - exact
    closing = eliminated(
        Linear(Quad(exact, 0.0, 0.0, 0.0), paper, -(exact + paper * body.total_mass) * a_x),
        resistance,
        -paper,
    )
    acceleration, traction = solve(z, pitch, roll, x, closing)
    return RimAccelerations(
        acceleration,
        traction,
        value(arm_acceleration(fl), acceleration, 0.0),
        value(arm_acceleration(fr), acceleration, 0.0),
        value(arm_acceleration(rl), acceleration, 0.0),
        value(arm_acceleration(rr), acceleration, 0.0),
        value(fl_load, acceleration, traction),
        value(fr_load, acceleration, traction),
        value(rl_load, acceleration, traction),
        value(rr_load, acceleration, traction),
    )
