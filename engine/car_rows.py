"""A vehicle as the kernels read it: one row of numbers, derived once before a simulation."""

from collections.abc import Sequence
from math import tan

import numpy as np
from numpy.typing import NDArray

from .equilibrium import static_loads
from .frames import CORNERS, axle_of, side_of
from .frames import Corner as CornerName
from .kernels.records import Body, Corner
from .vehicle import Vehicle

NO_FLOOR = -1e300
"""Least tyre load without the lift-off option: none."""


def body_record(vehicle: Vehicle) -> Body:
    """Sprung mass and stabilizer bars of a vehicle."""
    inertia = vehicle.chassis.inertia
    front, rear = vehicle.front.stabilizer_bar, vehicle.rear.stabilizer_bar
    return Body(
        mass=vehicle.chassis.mass,
        xx=inertia.xx,
        yy=inertia.yy,
        zz=inertia.zz,
        xz=inertia.xz,
        total_mass=vehicle.total_mass,
        front_bar_stiffness=front.stiffness,
        front_bar_damping=front.damping,
        rear_bar_stiffness=rear.stiffness,
        rear_bar_damping=rear.damping,
    )


def corner_record(vehicle: Vehicle, corner: CornerName, lift_off: bool) -> Corner:
    """One corner of a vehicle.

    Wheel centre at rest in B: (+l_f or -l_r, +-track/2, r - h); pivot: d towards the middle of
    the car from it, d tan(phi) above the ground (section "Bodies and geometry", docs/model.md).
    """
    axle = vehicle.axle_at(corner)
    front = axle_of(corner) == "front"
    outwards = side_of(corner)
    inwards = -1.0 if front else 1.0
    wheel, suspension, tyre, pivot = axle.wheel, axle.suspension, axle.tyre, axle.pivot
    height = vehicle.chassis.cg_height
    wheel_x = axle.cg_distance if front else -axle.cg_distance
    arm_x, arm_z = -inwards * pivot.distance, wheel.radius - pivot.distance * tan(pivot.angle)
    offset_x, offset_y, offset_z = wheel.cg_offset
    loads = static_loads(vehicle)
    brakes = vehicle.brakes
    front_share = brakes.front_share if brakes else 0.0
    driven = vehicle.driven_corners
    return Corner(
        pivot_x=wheel_x - arm_x,
        pivot_y=outwards * axle.track / 2.0,
        pivot_z=wheel.radius - height - arm_z,
        arm_x=arm_x,
        arm_z=arm_z,
        cg_x=arm_x + inwards * offset_x,
        cg_y=outwards * offset_y,
        cg_z=arm_z + offset_z,
        mass=wheel.mass,
        xx=wheel.inertia.xx,
        yy=wheel.inertia.yy,
        zz=wheel.inertia.zz,
        mount_x=arm_x,
        mount_z=arm_z + suspension.mount_height,
        preload=loads.preload[corner],
        stiffness=suspension.stiffness,
        damping=suspension.damping,
        rest_length=suspension.mount_height,
        static_load=loads.tyre_load[corner],
        tyre_stiffness=tyre.stiffness,
        tyre_damping=tyre.damping,
        load_floor=0.0 if lift_off else NO_FLOOR,
        radius=wheel.radius,
        rolling_resistance=tyre.rolling_resistance,
        drive_reaction=1.0 if axle.torque_reaction == "chassis" else 0.0,
        brake_reaction=1.0 if brakes and brakes.reaction == "chassis" else 0.0,
        drive_share=1.0 / len(driven) if corner in driven else 0.0,
        brake_share=(front_share if front else 1.0 - front_share) / 2.0,
    )


def car_row(vehicle: Vehicle, lift_off: bool = False) -> NDArray[np.float64]:
    """Body and four corners of a vehicle as one row (CAR_ROWS,)."""
    corners = [corner_record(vehicle, corner, lift_off) for corner in CORNERS]
    return np.concatenate([body_record(vehicle), *corners])


def car_rows(vehicles: Sequence[Vehicle], lift_off: bool = False) -> NDArray[np.float64]:
    """One row a vehicle (C, CAR_ROWS)."""
    return np.array([car_row(vehicle, lift_off) for vehicle in vehicles])
