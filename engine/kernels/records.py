"""What the equations of motion read: one record of plain numbers for the chassis and each corner.

Frame B everywhere (sprung mass's CG, x forward, y left, z up), SI units. Records are derived from
a `Vehicle` in `car_rows.py`; their fields, in this order, are rows of the lanes' buffer.
"""

from typing import NamedTuple


class Body(NamedTuple):
    """Sprung mass and stabilizer bars."""

    mass: float
    xx: float
    yy: float
    zz: float
    xz: float
    total_mass: float
    front_bar_stiffness: float
    front_bar_damping: float
    rear_bar_stiffness: float
    rear_bar_damping: float


class Corner(NamedTuple):
    """Wheel and arm, spring-damper and tyre at one corner; lengths at rest."""

    pivot_x: float
    pivot_y: float
    pivot_z: float
    arm_x: float
    """Wheel centre from the pivot (no y: the pivot lies in the wheel's plane)."""
    arm_z: float
    cg_x: float
    """Centre of gravity of wheel and arm from the pivot."""
    cg_y: float
    cg_z: float
    mass: float
    xx: float
    yy: float
    zz: float
    mount_x: float
    """Spring-damper's mount on the chassis from the pivot (no y)."""
    mount_z: float
    preload: float
    stiffness: float
    jounce_damping: float
    """Slope of the damper's force near rest where the element shortens, N s/m."""
    rebound_damping: float
    """The same where it lengthens."""
    per_knee: float
    """One over the speed of the damper's knee, s/m; 0 without one."""
    rest_length: float
    static_load: float
    tyre_stiffness: float
    tyre_damping: float
    load_floor: float
    """Least tyre load: 0 with lift-off, else far below anything that occurs."""
    radius: float
    rolling_resistance: float
    drive_reaction: float
    """1 where the drive torque comes from the chassis, 0 where it stays inside the arm."""
    brake_reaction: float
    """Likewise for the brake torque."""
    drive_share: float
    """Share of the rims mode's traction at this wheel while driving; sums to 1 over the car."""
    brake_share: float
    """Likewise while braking."""


class State(NamedTuple):
    """Generalized coordinates and their rates in the order of `frames.COORDINATES`."""

    x: float
    z: float
    pitch: float
    roll: float
    fl: float
    fr: float
    rl: float
    rr: float
    x_rate: float
    z_rate: float
    pitch_rate: float
    roll_rate: float
    fl_rate: float
    fr_rate: float
    rl_rate: float
    rr_rate: float


class WheelInput(NamedTuple):
    """What acts on one wheel from outside in the road and posts modes."""

    road: float
    """Height of the contact point, m."""
    road_rate: float
    drive: float
    """Drive torque, N m."""
    brake: float
    """Brake torque as a positive number, N m."""


class RimInput(NamedTuple):
    """Prescribed vertical motion of one wheel centre in the rims mode, from rest."""

    u: float
    u_rate: float
    u_acceleration: float
