"""The car as far as a manoeuvre's torques and road depend on it: a mass on four wheels.

A torque law asks for the mass that is to be accelerated, and the spin of the wheels adds to it. The
`Vehicle` made here has that apparent mass M' = M + sum I/r^2, and the rolling resistance fr M/M',
so that T = r M' (a + fr g M/M') / n, the coasting -fr g M/M' and the brakes' force M' b are this
car's.
"""

import numpy as np

from ..frames import AxleName
from ..vehicle import (
    Axle,
    Brakes,
    Chassis,
    Inertia,
    Inertia3,
    Pivot,
    StabilizerBar,
    Suspension,
    Tyre,
    Vehicle,
    Wheel,
)
from .records import DetailedCar
from .rigid import rigid_groups

PLAYS_NO_PART = {
    "suspension": Suspension(stiffness=2e4, damping=2e3),
    "stabilizer_bar": StabilizerBar(stiffness=0.0, damping=0.0),
    "pivot": Pivot(distance=1.0, angle=0.0),
}
"""Parts of an axle on which neither torque nor road depends."""

LIGHT = 1.0
"""kg, mass of a wheel here: only the sum counts."""


def apparent_mass(car: DetailedCar) -> float:
    """What the tyres have to accelerate along the road, kg: M + sum I/r^2 of the wheels."""
    spinning = {wheel.body for wheel in car.wheels}
    inertia = sum(group.inertia[1, 1] for group in rigid_groups(car) if spinning & set(group.names))
    return car.total_mass + float(inertia) / car.tyre.rolling_radius**2


def point_mass(car: DetailedCar) -> Vehicle:
    """The vehicle of which a manoeuvre's demand is asked; its CG is the measured point."""
    mass = apparent_mass(car)
    sprung = mass - 4.0 * LIGHT
    return Vehicle(
        name=car.name,
        chassis=Chassis(sprung, Inertia(sprung, sprung, sprung), cg_height=0.5),
        front=_axle(car, "front", mass),
        rear=_axle(car, "rear", mass),
        brakes=Brakes(car.brakes.front_share),
    )


def _axle(car: DetailedCar, name: AxleName, mass: float) -> Axle:
    wheels = car.wheels_of(name)
    tyre = car.tyre
    return Axle(
        cg_distance=float(abs(car.middle(name)[0] - car.measured_point[0])),
        track=float(np.ptp([wheel.centre[1] for wheel in wheels])),
        wheel=Wheel(LIGHT, tyre.rolling_radius, Inertia3(0.01, 0.01, 0.01)),
        tyre=Tyre(tyre.stiffness, tyre.damping, tyre.rolling_resistance * car.total_mass / mass),
        driven=any(wheel.driven_against for wheel in wheels),
        **PLAYS_NO_PART,
    )
