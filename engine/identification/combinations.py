"""Quantities of a car that its parameters make together, in the field's words.

Runs may determine them where they leave the parameters apart: a bar acts on the wheels only as
K_tor/d^2, and the traction of a wheel whose torque comes from the chassis lifts the car only as
tan(phi) - r/d (docs/model.md).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from ..frames import AXLES, AxleName
from ..vehicle import Vehicle

MATTERS = 0.05
"""What an error of a slope, or of a height in m, nearer to 0 is judged by: a pivot's angle of as
many rad makes such a slope, and at an arm of 1 m such a height."""


@dataclass(frozen=True, slots=True)
class Combination:
    """One quantity; `value` is SI.

    of : names of the parameters that it is made of
    signed : whether it may be negative or zero
    matters : what its error is judged by at least, in place of |value|
    acts : whether it is what acts in a car
    """

    name: str
    symbol: str
    label: str
    unit: str
    of: tuple[str, ...]
    value: Callable[[Vehicle], float]
    signed: bool = False
    matters: float = 0.0
    acts: Callable[[Vehicle], bool] = lambda car: True


def _bar(axle: AxleName, number: str, letter: str, name: str, unit: str) -> Combination:
    """What a bar's number comes to at the wheels."""
    path, distance = f"{axle}.stabilizer_bar.{number}", f"{axle}.pivot.distance"
    end = axle[0].upper()
    return Combination(
        name=f"{axle}.bar_{name}",
        symbol=f"{letter}_{end}/d_{end}^2",
        label=f"{axle.capitalize()} stabilizer bar's {name} at the wheels",
        unit=unit,
        of=(path, distance),
        value=lambda car: car.value(path) / car.value(distance) ** 2,
    )


def _roll_rate(axle: AxleName) -> Combination:
    def value(car: Vehicle) -> float:
        one = car.axle(axle)
        bar = 2.0 * one.stabilizer_bar.stiffness / one.pivot.distance**2
        return one.suspension.stiffness + bar

    letter = axle[0].upper()
    return Combination(
        name=f"{axle}.wheel_rate_in_roll",
        symbol=f"K_{letter} + 2 Ktor_{letter}/d_{letter}^2",
        label=f"{axle.capitalize()} wheel rate in roll",
        unit="N/m",
        of=(
            f"{axle}.suspension.stiffness",
            f"{axle}.stabilizer_bar.stiffness",
            f"{axle}.pivot.distance",
        ),
        value=value,
    )


def _traction_slope(axle: AxleName) -> Combination:
    def value(car: Vehicle) -> float:
        one = car.axle(axle)
        return math.tan(one.pivot.angle) - one.wheel.radius / one.pivot.distance

    def acts(car: Vehicle) -> bool:
        """A torque held inside the arm, as of a hub motor, leaves the slope at tan phi."""
        one = car.axle(axle)
        braked = car.brakes is not None and car.brakes.reaction == "chassis"
        return braked or (one.driven and one.torque_reaction == "chassis")

    letter = axle[0].upper()
    return Combination(
        name=f"{axle}.traction_slope",
        symbol=f"tan phi_{letter} - r/d_{letter}",
        label=f"{axle.capitalize()} slope of the traction's line of action",
        unit="1",
        of=(f"{axle}.pivot.angle", f"{axle}.pivot.distance"),
        value=value,
        signed=True,
        matters=MATTERS,
        acts=acts,
    )


def _pivot_height(axle: AxleName) -> Combination:
    def value(car: Vehicle) -> float:
        pivot = car.axle(axle).pivot
        return pivot.distance * math.tan(pivot.angle)

    letter = axle[0].upper()
    return Combination(
        name=f"{axle}.pivot_height",
        symbol=f"d_{letter} tan phi_{letter}",
        label=f"{axle.capitalize()} pivot's height above the ground",
        unit="m",
        of=(f"{axle}.pivot.distance", f"{axle}.pivot.angle"),
        value=value,
        signed=True,
        matters=MATTERS,
    )


def _both_axles(number: str, letter: str, label: str, unit: str) -> Combination:
    of = tuple(f"{axle}.suspension.{number}" for axle in AXLES)
    return Combination(
        name=f"suspension.{number}",
        symbol=f"{letter}_F + {letter}_R",
        label=label,
        unit=unit,
        of=of,
        value=lambda car: sum(car.value(name) for name in of),
    )


COMBINATIONS: tuple[Combination, ...] = (
    _both_axles("stiffness", "K", "Spring stiffness of both axles", "N/m"),
    _both_axles("damping", "C", "Damping of both axles", "N s/m"),
    *(_bar(axle, "stiffness", "Ktor", "rate", "N/m") for axle in AXLES),
    *(_bar(axle, "damping", "Ctor", "damping", "N s/m") for axle in AXLES),
    *(make(axle) for make in (_roll_rate, _traction_slope, _pivot_height) for axle in AXLES),
)
