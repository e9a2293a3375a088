"""A vehicle as the kernels read it: one row of numbers, derived once before a simulation.

The records are derived from a vehicle's numbers or, for many cars at once, from arrays of them
(C,), by the same expressions.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..equilibrium import StaticLoads, loads_at_rest, stands, static_loads
from ..frames import CORNERS, axle_of, side_of
from ..frames import Corner as CornerName
from ..kernels.buffer import BODY_ROWS, CAR_ROWS, CORNER_ROWS
from ..kernels.records import Body, Corner
from ..vehicle import Vehicle, possible

Array = NDArray[np.float64]

NO_FLOOR = -1e300
"""Least tyre load without the lift-off option: none."""

AT_ONCE = 2048
"""Cars whose rows are written or read together, one number of all of them after the other, so that
they stay in a core's cache."""


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


def corner_record(
    vehicle: Vehicle, corner: CornerName, loads: StaticLoads, lift_off: bool
) -> Corner:
    """One corner of a vehicle that stands on its static loads.

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
    arm_x, arm_z = -inwards * pivot.distance, wheel.radius - pivot.distance * np.tan(pivot.angle)
    offset_x, offset_y, offset_z = wheel.cg_offset
    jounce_damping, rebound_damping = suspension.slopes
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
        jounce_damping=jounce_damping,
        rebound_damping=rebound_damping,
        per_knee=0.0 if suspension.knee_speed is None else 1.0 / suspension.knee_speed,
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


def car_row(vehicle: Vehicle, lift_off: bool = False) -> Array:
    """Body and four corners of a vehicle as one row (CAR_ROWS,).

    Raises VehicleError for a car that cannot stand at rest.
    """
    row = np.empty(CAR_ROWS)
    _write(row, vehicle, static_loads(vehicle), lift_off)
    return row


def car_rows(
    vehicle: Vehicle, names: Sequence[str], values: Array, lift_off: bool = False
) -> Array:
    """Many cars (C, CAR_ROWS): a vehicle with other numbers in each.

    names : dotted paths of P numbers, e.g. `front.pivot.angle`
    values : (C, P), SI

    Each row is `car_row` of `vehicle.with_values`; it is not a number throughout where one of the
    two refuses the car. Raises ParameterError for a path that leads to no number.
    """
    rows = np.empty((len(values), CAR_ROWS))
    for first in range(0, len(values), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        cars = vehicle.varied(dict(zip(names, values[some].T, strict=True)))
        with np.errstate(all="ignore"):  # of impossible cars
            loads = loads_at_rest(cars)
            _write(rows[some], cars, loads, lift_off)
            rows[some][~(possible(cars) & stands(loads))] = np.nan
    return rows


def with_steepest_dampers(cars: Array) -> Array:
    """Rows (C, CAR_ROWS) of the same cars with linear dampers, each as steep as it ever was."""
    rows = cars.copy()
    jounce, rebound, per_knee = (
        BODY_ROWS + Corner._fields.index(name) + CORNER_ROWS * np.arange(len(CORNERS))
        for name in ("jounce_damping", "rebound_damping", "per_knee")
    )
    rows[:, jounce] = rows[:, rebound] = np.maximum(cars[:, jounce], cars[:, rebound])
    rows[:, per_knee] = 0.0
    return rows


def _write(rows: Array, vehicle: Vehicle, loads: StaticLoads, lift_off: bool) -> None:
    """Write the row (CAR_ROWS,) of a vehicle, or those of many (C, CAR_ROWS)."""
    corners = (corner_record(vehicle, corner, loads, lift_off) for corner in CORNERS)
    numbers = (*body_record(vehicle), *(number for corner in corners for number in corner))
    for place, number in enumerate(numbers):
        rows[..., place] = number
