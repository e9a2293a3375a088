"""The detailed car as the concept model sees it: what a test department would know of it.

Lifting the wheels of an axle by dz with the chassis held lifts the CG of body k by s_k dz. Its mass
counts with s_k to the wheels and with the rest to the sprung mass, so that the wheels' motion has
the momentum sum s_k m_k dz/dt of the bodies: a link counts by about one half. Suspension values are
round first guesses, as good as those of a car not yet measured.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import SimulationError
from ..frames import AXLES, AxleName, axle_of
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
    check,
)
from .builder import Model
from .records import DetailedCar
from .rigid import Group
from .side_view import around, clamped

Array = NDArray[np.float64]

SOURCE = "Known data of the detailed car; suspension, bar and pivot are a first guess."

OFF_CG = 1e-3
"""m: the measured point lies this close to the sprung mass's CG."""

FIRST_GUESS = {
    "front": {
        "suspension": Suspension(stiffness=22000.0, damping=1500.0, mount_height=0.45),
        "stabilizer_bar": StabilizerBar(stiffness=15000.0, damping=100.0),
        "pivot": Pivot(distance=1.8, angle=0.06),
    },
    "rear": {
        "suspension": Suspension(stiffness=24000.0, damping=1500.0, mount_height=0.45),
        "stabilizer_bar": StabilizerBar(stiffness=8000.0, damping=100.0),
        "pivot": Pivot(distance=1.2, angle=0.25),
    },
}
"""Of each axle; nothing in the car's data went into it."""


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """A car cut into the concept model's bodies, in the design frame.

    sprung : the sprung mass
    corners : by axle, its left corner
    """

    sprung: Group
    corners: dict[AxleName, Group]


def known_vehicle(car: DetailedCar) -> Vehicle:
    """Masses, geometry, tyres and drive of a car with first guesses of its suspension.

    Raises SimulationError where Exudyn is missing, the car does not stand, or its measured point is
    not the sprung mass's CG.
    """
    parts = cut(car)
    if np.linalg.norm(parts.sprung.cg - car.measured_point) > OFF_CG:
        place = ", ".join(f"{value:.4f}" for value in parts.sprung.cg)
        raise SimulationError(
            f"{car.name}: the CG of the sprung mass is at [{place}], which measured_point must be;"
            " write that into the car's file."
        )
    (xx, _, xz), (_, yy, _), (_, _, zz) = parts.sprung.inertia
    vehicle = Vehicle(
        name=car.name,
        chassis=Chassis(parts.sprung.mass, Inertia(xx, yy, zz, xz), car.measured_point[2]),
        front=_axle(car, "front", parts),
        rear=_axle(car, "rear", parts),
        brakes=Brakes(car.brakes.front_share),
        source=SOURCE,
    )
    check(vehicle, car.name)
    return vehicle


def cut(car: DetailedCar) -> Parts:
    """Share the bodies out between sprung mass and corners, those of an axle mirror images."""
    model = Model(car)
    clamped(model)
    share = {axle: _shares(model, axle) for axle in AXLES}
    moving = [_on_the_left(group, k in model.wheels) for k, group in enumerate(model.groups)]
    corners: dict[AxleName, Group] = {axle: _weighted(moving, share[axle] / 2.0) for axle in AXLES}
    sprung = _weighted(model.groups, 1.0 - share["front"] - share["rear"])
    # The concept model has the corners' CGs at the wheel centres; the whole car's stays.
    whole = _weighted(model.groups, np.ones(len(model.groups)))
    rest = whole.mass * whole.cg
    for axle in AXLES:
        rest = rest - 2.0 * corners[axle].mass * car.middle(axle)
    return Parts(replace(sprung, cg=rest / sprung.mass), corners)


def _shares(model: Model, axle: AxleName) -> Array:
    """s (groups,): rise of each CG over that of the axle's wheel centres."""
    lower, upper = around(model, axle, 0.0)
    rise = upper[:, 2] - lower[:, 2]
    wheels = zip(model.wheels, model.car.wheels, strict=True)
    return rise / np.mean([rise[k] for k, wheel in wheels if axle_of(wheel.corner) == axle])


def _on_the_left(group: Group, wheel: bool) -> Group:
    """A group or its mirror image; a wheel without its moment about the axle, since it does not
    turn with the concept model's arm.
    """
    mirror = np.diag([1.0, 1.0 if group.cg[1] >= 0.0 else -1.0, 1.0])
    inertia = mirror @ group.inertia @ mirror
    if wheel:
        inertia[1] = inertia[:, 1] = 0.0
    return replace(group, cg=mirror @ group.cg, inertia=inertia)


def _weighted(groups: list[Group], weight: Array) -> Group:
    """Mass, CG and inertia of groups of which a share (groups,) counts."""
    masses = weight * [group.mass for group in groups]
    mass = masses.sum()
    cg = masses @ np.array([group.cg for group in groups]) / mass
    inertia = np.zeros((3, 3))
    for share, part, group in zip(weight, masses, groups, strict=True):
        d = group.cg - cg
        inertia += share * group.inertia + part * (d @ d * np.eye(3) - np.outer(d, d))
    return Group((), float(mass), cg, inertia)


def _axle(car: DetailedCar, name: AxleName, parts: Parts) -> Axle:
    wheels = car.wheels_of(name)
    x, _, z = car.middle(name)
    corner = parts.corners[name]
    tyre = car.tyre
    return Axle(
        cg_distance=float(abs(x - car.measured_point[0])),
        track=float(np.ptp([wheel.centre[1] for wheel in wheels])),
        wheel=Wheel(corner.mass, float(z), Inertia3(*np.diag(corner.inertia).tolist())),
        tyre=Tyre(tyre.stiffness, tyre.damping, tyre.rolling_resistance),
        driven=any(wheel.driven_against for wheel in wheels),
        torque_reaction="arm" if any(w.driven_against == w.carrier for w in wheels) else "chassis",
        **FIRST_GUESS[name],
    )
