"""Accelerations of the free car: road and posts modes.

The four arms are eliminated from the 8 x 8 system, leaving four equations for the chassis
(a Schur complement), solved by a square-root-free Cholesky factorisation.
"""

from typing import NamedTuple

from ..jit import inlined
from .equations import (
    ArmEquation,
    ChassisMass,
    Quad,
    arm_equation,
    mass_add,
    outer_product,
    quad_add,
    quad_dot,
    quad_scale,
    sprung_mass,
    wheel_force_effect,
)
from .forces import bar_torque, road_wheel_force, strut, tyre_load
from .kinematics import ArmPose, Attitude, WheelMotion, wheel_motion


class FreeCorner(NamedTuple):
    """One corner of the free car at one instant, before its bar is known."""

    arm: ArmPose
    wheel: WheelMotion
    equation: ArmEquation
    force_X: float
    load: float
    on_chassis: Quad
    moment: float
    """On the arm about its pivot, from tyre, spring-damper, drive and brake."""
    travel: float
    clearance: float
    """Of the spring-damper's mount."""


class ArmRest(NamedTuple):
    """What is left of a corner: M and Q - h of its arm, and what is tallied of its wheel."""

    inertia: float
    moment: float
    load: float
    travel: float
    clearance: float


class FreeShare(NamedTuple):
    """What a corner adds to the chassis's equations, and its arm's own."""

    mass: ChassisMass
    force: Quad
    coupling: Quad
    rest: ArmRest


@inlined
def free_corner(corner, chassis: Attitude, state, arm, given, direction):
    """Forces and inertia of one corner, driven by its contact point and torques."""
    wheel = wheel_motion(corner, chassis, arm, state.z, state.x_rate, state.z_rate)
    load = tyre_load(corner, wheel, given.road, given.road_rate)
    force_X, torque = road_wheel_force(corner, load, given, direction)
    on_chassis, on_arm = wheel_force_effect(chassis, wheel, force_X, load, corner.radius)
    element = strut(corner, wheel.arm, arm)
    moment = on_arm + torque + element.moment
    equation = arm_equation(corner, chassis, arm)
    return FreeCorner(
        arm,
        wheel,
        equation,
        force_X,
        load,
        on_chassis,
        moment,
        element.travel,
        element.clearance,
    )


@inlined
def free_share(corner, moment):
    """What a corner adds to the chassis's equations once its arm is eliminated.

    Mass M_cc - m m^T / M and force Q_c - h_c - m (Q - h) / M.
    moment : Q with the bar, N m
    """
    equation = corner.equation
    m = equation.coupling
    mass = mass_add(equation.chassis_mass, outer_product(-1.0 / equation.inertia, m, m))
    carried = quad_scale((equation.bias - moment) / equation.inertia, m)
    given = quad_add(corner.on_chassis, quad_scale(-1.0, equation.chassis_bias))
    rest = ArmRest(
        equation.inertia, moment - equation.bias, corner.load, corner.travel, corner.clearance
    )
    return FreeShare(mass, quad_add(given, carried), m, rest)


@inlined
def arm_acceleration(share, chassis_acceleration):
    """a'' = (Q - h - m . c'') / M of one arm once the chassis is known."""
    return (share.rest.moment - quad_dot(share.coupling, chassis_acceleration)) / share.rest.inertia


@inlined
def chassis_acceleration(body, chassis, fl, fr, rl, rr):
    """c'' from the shares of the four corners."""
    mass, bias = sprung_mass(body, chassis)
    arms = mass_add(mass_add(fl.mass, fr.mass), mass_add(rl.mass, rr.mass))
    forces = quad_add(quad_add(fl.force, fr.force), quad_add(rl.force, rr.force))
    return solve_chassis(mass_add(mass, arms), quad_add(forces, quad_scale(-1.0, bias)))


@inlined
def solve_chassis(mass, force):
    """Solve the symmetric positive definite 4 x 4 system mass c'' = force by L D L^T."""
    d1 = 1.0 / mass.xx
    l21, l31, l41 = mass.xz * d1, mass.xp * d1, mass.xr * d1
    d2 = 1.0 / (mass.zz - l21 * mass.xz)
    u32, u42 = mass.zp - l31 * mass.xz, mass.zr - l41 * mass.xz
    l32, l42 = u32 * d2, u42 * d2
    d3 = 1.0 / (mass.pp - l31 * mass.xp - l32 * u32)
    u43 = mass.pr - l41 * mass.xp - l42 * u32
    l43 = u43 * d3
    d4 = 1.0 / (mass.rr - l41 * mass.xr - l42 * u42 - l43 * u43)

    b2 = force.z - l21 * force.x
    b3 = force.pitch - l31 * force.x - l32 * b2
    b4 = force.roll - l41 * force.x - l42 * b2 - l43 * b3
    roll = b4 * d4
    pitch = b3 * d3 - l43 * roll
    z = b2 * d2 - l32 * pitch - l42 * roll
    x = force.x * d1 - l21 * z - l31 * pitch - l41 * roll
    return Quad(x, z, pitch, roll)


@inlined
def bar_torques(body, state):
    """Torques of both bars in a state."""
    front_stiffness, front_damping = body.front_bar_stiffness, body.front_bar_damping
    rear_stiffness, rear_damping = body.rear_bar_stiffness, body.rear_bar_damping
    return (
        bar_torque(
            front_stiffness, front_damping, state.fl - state.fr, state.fl_rate - state.fr_rate
        ),
        bar_torque(
            rear_stiffness, rear_damping, state.rl - state.rr, state.rl_rate - state.rr_rate
        ),
    )
