"""The kernels' outputs as named channels."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..frames import CORNERS
from ..kernels.observe import CarOutput, CornerOutput
from ..vehicle import Vehicle
from .integration import CORNER_SIZE, FIRST_CORNER

Array = NDArray[np.float64]
Points = Mapping[str, tuple[float, float, float]]
Triple = tuple[Any, Any, Any]
"""Components of a vector: numbers or arrays (n,)."""

DEFAULT_POINTS: Points = {"seat.driver": (-0.15, 0.37, 0.05)}
"""Chassis points with accelerometers: name -> position from the sprung mass's CG in B, m."""

_CORNER_CHANNELS = {
    "wheel.{}.z": "rise",
    "tyre.{}.load": "load",
    "suspension.{}.travel": "travel",
    "suspension.{}.spring_force": "spring",
    "suspension.{}.damper_force": "damper",
    "arm.{}.angle": "angle",
    "mount.{}.force_x": "mount_x",
    "mount.{}.force_z": "mount_z",
    "pivot.{}.force_x": "pivot_x",
    "pivot.{}.force_z": "pivot_z",
}


def corner_output(outputs: Array, corner: int, field: str) -> Array:
    """One field of one corner from outputs (n, OUTPUTS)."""
    return outputs[:, FIRST_CORNER + corner * CORNER_SIZE + CornerOutput._fields.index(field)]


def car_output(outputs: Array, field: str) -> Array:
    """One field of the whole car from outputs (n, OUTPUTS)."""
    return outputs[:, CarOutput._fields.index(field)]


def common_channels(states: Array, outputs: Array, points: Points) -> dict[str, Array]:
    """Channels of every mode: motion, travels, forces, accelerations at points.

    states (n, 16) : coordinates and rates; outputs (n, OUTPUTS)
    """
    channels = {
        "chassis.x": states[:, 0],
        "chassis.z": states[:, 1],
        "chassis.pitch": states[:, 2],
        "chassis.roll": states[:, 3],
        "chassis.v_x": states[:, 8],
        "chassis.z_rate": states[:, 9],
        "chassis.pitch_rate": states[:, 10],
        "chassis.roll_rate": states[:, 11],
        "chassis.a_x": car_output(outputs, "x_acceleration"),
        "stabilizer_bar.front.torque": car_output(outputs, "front_bar"),
        "stabilizer_bar.rear.torque": car_output(outputs, "rear_bar"),
    }
    for index, corner in enumerate(CORNERS):
        for name, field in _CORNER_CHANNELS.items():
            channels[name.format(corner)] = corner_output(outputs, index, field)
    for name, position in points.items():
        acceleration = point_acceleration(states, outputs, position)
        for axis, values in zip("xyz", acceleration, strict=True):
            channels[f"{name}.a_{axis}"] = values
    return channels


def torque_channels(inputs: Array) -> dict[str, Array]:
    """Drive and brake torques from the free car's inputs (n, 16)."""
    channels = {}
    for index, corner in enumerate(CORNERS):
        channels[f"drive.{corner}.torque"] = inputs[:, 8 + index]
        channels[f"brake.{corner}.torque"] = inputs[:, 12 + index]
    return channels


def traction_torques(vehicle: Vehicle, outputs: Array, braking: Array) -> dict[str, Array]:
    """Torques that the rims mode's traction stands for: T = r Fx, split by the braking weight."""
    traction = car_output(outputs, "traction")
    driven = vehicle.driven_corners
    channels = {}
    for corner in CORNERS:
        radius = vehicle.axle_at(corner).wheel.radius
        if corner in driven:
            share = (1.0 - braking) / len(driven)
            channels[f"drive.{corner}.torque"] = share * radius * traction
        if vehicle.brakes:
            front = vehicle.brakes.front_share
            share = braking * (front if corner[0] == "f" else 1.0 - front) / 2.0
            channels[f"brake.{corner}.torque"] = -share * radius * traction
    return channels


def point_acceleration(
    states: Array, outputs: Array, position: tuple[float, float, float]
) -> tuple[Array, Array, Array]:
    """Inertial acceleration of a chassis point along inertial X, Y and Z, m/s2, gravity excluded.

    a = (x'', 0, z'') + R (w' x p + w x (w x p)), p from the CG in B
    """
    pitch, roll, pitch_rate, roll_rate = (states[:, k] for k in (2, 3, 10, 11))
    sp, cp, sr, cr = np.sin(pitch), np.cos(pitch), np.sin(roll), np.cos(roll)
    pitch_dd = car_output(outputs, "pitch_acceleration")
    roll_dd = car_output(outputs, "roll_acceleration")
    product = pitch_rate * roll_rate
    w = (roll_rate, pitch_rate * cr, -pitch_rate * sr)
    w_rate = (roll_dd, pitch_dd * cr - product * sr, -pitch_dd * sr - product * cr)
    swinging, centripetal = _cross(w_rate, position), _cross(w, _cross(w, position))
    x, y, z = (one + other for one, other in zip(swinging, centripetal, strict=True))
    x_dd = car_output(outputs, "x_acceleration")
    z_dd = car_output(outputs, "z_acceleration")
    return (
        x_dd + cp * x + sp * sr * y + sp * cr * z,
        cr * y - sr * z,
        z_dd - sp * x + cp * sr * y + cp * cr * z,
    )


def _cross(a: Triple, b: Triple) -> Triple:
    """a x b, component by component: numpy's own takes longer to arrange them than to multiply."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
