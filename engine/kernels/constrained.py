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

V_x = 0, V_z = 1, X_cx = 1 and X_cz = 0 are left out of the products.
"""

from math import sqrt
from typing import NamedTuple

from ..jit import inlined
from .elementary import angle_of
from .equations import (
    ArmEquation,
    Quad,
    about_roll_axis,
    arm_equation,
    quad_add,
    quad_scale,
    sprung_mass,
)
from .forces import bar_torque, strut
from .kinematics import ArmPose, WheelMotion, pivot, turned, wheel_motion
from .vec3 import add, cross, dot


class RimCorner(NamedTuple):
    """One corner on its prescribed rim at one instant, before its bar is known."""

    arm: ArmPose
    wheel: WheelMotion
    equation: ArmEquation
    bend: "Bend"
    force: Quad
    """V - e X_c: on the chassis per unit of N, with its rolling resistance."""
    force_arm: float
    """g - e X: on the arm."""
    resistance: float
    """e"""
    traction: Quad
    """s D_c"""
    traction_arm: float
    """s D"""
    moment: float
    """S without the bar"""
    travel: float
    clearance: float
    """Of the spring-damper's mount."""


class Bend(NamedTuple):
    """Arm's acceleration a'' = constant + z z'' + pitch pitch'' + roll roll'' (eq. 13)."""

    z: float
    pitch: float
    roll: float
    constant: float


class Linear(NamedTuple):
    """An affine function of the five unknowns: constant + on . c'' + traction F."""

    on: Quad
    traction: float
    constant: float


class RimRest(NamedTuple):
    """What else is wanted of a corner: e, and what is tallied of its wheel."""

    resistance: float
    travel: float
    least: float
    """Least of the arm's reach and the mount's clearance."""


class RimShare(NamedTuple):
    """What a corner adds to the chassis's equations z, pitch, roll and x, and its load."""

    z: Linear
    pitch: Linear
    roll: Linear
    x: Linear
    load: Linear
    rest: RimRest


@inlined
def reached_arm(corner, chassis, z, z_rate, rim):
    """Arm pose that puts the wheel centre at its prescribed height and rise rate.

    e_Z . (pivot + Ry(a) p) = rest + u - z is P cos a + Q sin a = D; of the two solutions the one
    around a = 0. Its rate a' = (u' - z' - e_Z . (w x centre)) / g. Returns the pose and
    1 - D^2 / (P^2 + Q^2), negative out of reach.
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
    still = ArmPose(angle_of(sine_a, cosine_a), sine_a, cosine_a, 0.0)
    p = turned(corner.arm_x, 0.0, corner.arm_z, still)
    carried = z_rate + dot(cross(e, chassis.w), add(pivot(corner), p))
    rate = (rim.u_rate - carried) / rise_per_angle(chassis, p)
    return ArmPose(still.angle, sine_a, cosine_a, rate), reach


@inlined
def rise_per_angle(chassis, p):
    """g = e_Z . (e_y x p), m/rad: positive lever for the rear, negative for the front."""
    return chassis.e_Z[0] * p[2] - chassis.e_Z[2] * p[0]


@inlined
def free_rise(chassis, arm, wheel):
    """k = e_Z . (T C + 2 a' w x (e_y x p) + a'^2 e_y x (e_y x p)) of the wheel centre C, m/s2."""
    e, T = chassis.e_Z, chassis.turning
    carried = (
        e[0] * T[0][0] + e[1] * T[1][0] + e[2] * T[2][0],
        e[0] * T[0][1] + e[1] * T[1][1] + e[2] * T[2][1],
        e[0] * T[0][2] + e[1] * T[1][2] + e[2] * T[2][2],
    )
    turning, p = cross(e, chassis.w), wheel.arm
    coriolis = 2.0 * arm.rate * (turning[0] * p[2] - turning[2] * p[0])
    inwards = arm.rate * arm.rate * (e[0] * p[0] + e[2] * p[2])
    return dot(carried, wheel.centre) + coriolis - inwards


@inlined
def rim_corner(corner, chassis, arm, z, z_rate, rim, direction, braking):
    """Inertia and unit-force effects of one corner on its rim, its arm known.

    direction : tanh(v/v0); braking : weight b between driving (0) and braking (1)
    """
    wheel = wheel_motion(corner, chassis, arm, z, 0.0, z_rate)
    lever = rise_per_angle(chassis, wheel.arm)
    up_pitch, up_roll = -wheel.ahead, about_roll_axis(wheel.centre, chassis.e_Z)
    p, radius = wheel.arm, corner.radius
    back_pitch, back_roll = wheel.above - radius, about_roll_axis(wheel.centre, chassis.e_X)
    back_arm = chassis.e_X[0] * p[2] - chassis.e_X[2] * p[0] - radius * chassis.e_Y[1]
    e = corner.rolling_resistance * direction
    driven = (1.0 - braking) * corner.drive_share
    braked = braking * corner.brake_share
    torque = radius * (driven * corner.drive_reaction + braked * corner.brake_reaction)
    share = driven + braked
    element = strut(corner, p, arm)
    per_lever = 1.0 / lever
    rise = rim.u_acceleration - free_rise(chassis, arm, wheel)
    return RimCorner(
        arm,
        wheel,
        arm_equation(corner, chassis, arm),
        Bend(-per_lever, -per_lever * up_pitch, -per_lever * up_roll, per_lever * rise),
        Quad(-e, 1.0, up_pitch - e * back_pitch, up_roll - e * back_roll),
        lever - e * back_arm,
        e,
        Quad(share, 0.0, share * back_pitch, share * back_roll),
        share * back_arm + torque,
        element.moment,
        element.travel,
        element.clearance,
    )


@inlined
def wheel_load(corner, moment):
    """Affine N (eq. 14); moment : S with the bar, N m."""
    m, bend, inertia = corner.equation.coupling, corner.bend, corner.equation.inertia
    inverse = 1.0 / corner.force_arm
    return Linear(
        Quad(
            inverse * m.x,
            inverse * (m.z + inertia * bend.z),
            inverse * (m.pitch + inertia * bend.pitch),
            inverse * (m.roll + inertia * bend.roll),
        ),
        -inverse * corner.traction_arm,
        inverse * (inertia * bend.constant + corner.equation.bias - moment),
    )


@inlined
def row(mass_row, bias, coupling, force, traction, bend, load):
    """One chassis equation's share from one corner, everything on the left-hand side.

    mass_row . c'' + bias + coupling a'' - force N - traction F
    """
    return Linear(
        Quad(
            mass_row.x - force * load.on.x,
            mass_row.z + coupling * bend.z - force * load.on.z,
            mass_row.pitch + coupling * bend.pitch - force * load.on.pitch,
            mass_row.roll + coupling * bend.roll - force * load.on.roll,
        ),
        -traction - force * load.traction,
        bias + coupling * bend.constant - force * load.constant,
    )


@inlined
def linear_add(a, b):
    """Sum."""
    return Linear(quad_add(a.on, b.on), a.traction + b.traction, a.constant + b.constant)


@inlined
def rim_share(corner, moment, reach):
    """Share of a corner; moment : S with the bar, N m; reach : as of `reached_arm`."""
    equation, bend, load = corner.equation, corner.bend, wheel_load(corner, moment)
    mass, bias, m = equation.chassis_mass, equation.chassis_bias, equation.coupling
    force, pull = corner.force, corner.traction
    in_z = Quad(mass.xz, mass.zz, mass.zp, mass.zr)
    in_pitch = Quad(mass.xp, mass.zp, mass.pp, mass.pr)
    in_roll = Quad(mass.xr, mass.zr, mass.pr, mass.rr)
    in_x = Quad(mass.xx, mass.xz, mass.xp, mass.xr)
    return RimShare(
        row(in_z, bias.z, m.z, force.z, pull.z, bend, load),
        row(in_pitch, bias.pitch, m.pitch, force.pitch, pull.pitch, bend, load),
        row(in_roll, bias.roll, m.roll, force.roll, pull.roll, bend, load),
        row(in_x, bias.x, m.x, force.x, pull.x, bend, load),
        load,
        RimRest(corner.resistance, corner.travel, min(reach, corner.clearance)),
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
def bent(bend, acceleration):
    """An arm's acceleration once the chassis's is known."""
    c = acceleration
    return bend.constant + bend.z * c.z + bend.pitch * c.pitch + bend.roll * c.roll


@inlined
def rim_bar_torque(stiffness, damping, left, right):
    """Torque of a bar between two arms known by sine and cosine: one arc tangent does for both."""
    sine = left.sine * right.cosine - left.cosine * right.sine
    cosine = left.cosine * right.cosine + left.sine * right.sine
    return bar_torque(stiffness, damping, angle_of(sine, cosine), left.rate - right.rate)


@inlined
def rim_bar_torques(body, fl, fr, rl, rr):
    """Torques of both bars from the arms' poses."""
    return (
        rim_bar_torque(body.front_bar_stiffness, body.front_bar_damping, fl, fr),
        rim_bar_torque(body.rear_bar_stiffness, body.rear_bar_damping, rl, rr),
    )


@inlined
def linear_sum(fl, fr, rl, rr, chassis):
    """Sum over the corners and the sprung mass."""
    return linear_add(chassis, linear_add(linear_add(fl, fr), linear_add(rl, rr)))


@inlined
def rims_solution(body, chassis, fl, fr, rl, rr, a_x, exact):
    """c'' and F from the shares of the four corners.

    a_x : prescribed chassis acceleration, m/s2; exact : 1.0 to follow it exactly, 0.0 for the
    paper's F = M a_x + sum e_i N_i
    """
    mass, bias = sprung_mass(body, chassis)
    own_z = Linear(Quad(mass.xz, mass.zz, mass.zp, mass.zr), 0.0, bias.z)
    own_pitch = Linear(Quad(mass.xp, mass.zp, mass.pp, mass.pr), 0.0, bias.pitch)
    own_roll = Linear(Quad(mass.xr, mass.zr, mass.pr, mass.rr), 0.0, bias.roll)
    own_x = Linear(Quad(mass.xx, mass.xz, mass.xp, mass.xr), 0.0, bias.x)
    z = linear_sum(fl.z, fr.z, rl.z, rr.z, own_z)
    pitch = linear_sum(fl.pitch, fr.pitch, rl.pitch, rr.pitch, own_pitch)
    roll = linear_sum(fl.roll, fr.roll, rl.roll, rr.roll, own_roll)
    x = linear_sum(fl.x, fr.x, rl.x, rr.x, own_x)
    paper = 1.0 - exact
    known = -(exact + paper * body.total_mass) * a_x
    none = Linear(Quad(0.0, 0.0, 0.0, 0.0), 0.0, 0.0)
    resistance = linear_add(
        linear_add(
            eliminated(none, fl.load, fl.rest.resistance),
            eliminated(none, fr.load, fr.rest.resistance),
        ),
        linear_add(
            eliminated(none, rl.load, rl.rest.resistance),
            eliminated(none, rr.load, rr.rest.resistance),
        ),
    )
    closing = eliminated(Linear(Quad(exact, 0.0, 0.0, 0.0), paper, known), resistance, -paper)
    return solve(z, pitch, roll, x, closing)
