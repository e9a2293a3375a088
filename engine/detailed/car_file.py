"""A detailed car from JSON, checked so that a mistake is named before anything is solved.

Every message starts with the file and the place in it, such as `joints[12].bodies[1]`.
"""

from collections import Counter
from collections.abc import Iterator
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import VehicleError
from ..frames import AXLES, CORNERS
from ..json_record import RecordReader
from ..json_text import read_json
from .records import BodyData, DetailedCar
from .rigid import rigid_groups

ROUNDING = 1e-3
"""Relative slack of the inertia's inequalities, for tensors written with few digits, and of the
length of an axis."""


BALANCE = 1e-4
"""m: the CG of what turns with a wheel lies this close to its axle."""


def read_car(path: str | Path) -> DetailedCar:
    """Read and check a file; raises VehicleError naming the file, the place and the remedy."""
    path = Path(path)
    return car_from_json(read_json(path, VehicleError), path.name)


def car_from_json(data: Any, source: str = "car") -> DetailedCar:
    """Build and check a car from parsed JSON; `source` heads every message."""
    car = RecordReader(source, VehicleError).record(DetailedCar, data)
    for place, sentence in _mistakes(car):
        raise VehicleError(f"{source}: {place} {sentence}")
    return car


@cache
def reference_car() -> DetailedCar:
    """The car that comes with the package."""
    return read_car(Path(__file__).with_name("car.json"))


def _mistakes(car: DetailedCar) -> Iterator[tuple[str, str]]:
    """Places and sentences of everything that is wrong with a car whose fields are in range."""
    yield from _doubled("bodies", [body.name for body in car.bodies])
    yield from _doubled("bushing_laws", [law.name for law in car.bushing_laws])
    for k, body in enumerate(car.bodies):
        if problem := _inertia_problem(body):
            yield f"bodies[{k}].inertia", problem
    for place, name, known in _references(car):
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f'did you mean "{near[0]}"?' if near else "add it or correct the name."
            yield place, f'is "{name}", which is not there; {hint}'
    yield from _pairs(car)
    for k, joint in enumerate(car.joints):
        if joint.axis is None:
            if joint.kind not in ("fixed", "ball"):
                yield f"joints[{k}].axis", f"is missing; a {joint.kind} joint needs a unit vector."
        elif abs(np.linalg.norm(joint.axis) - 1.0) > ROUNDING:
            yield f"joints[{k}].axis", "is not a unit vector; scale it to length 1."
    for section in ("wheels", "springs", "dampers"):
        yield from _one_each(section, [one.corner for one in getattr(car, section)], CORNERS)
    yield from _one_each("stabilizer_bars", [bar.axle for bar in car.stabilizer_bars], AXLES)
    for section in ("springs", "dampers"):
        for k, line in enumerate(getattr(car, section)):
            if np.allclose(*line.ends):
                yield f"{section}[{k}].ends", "are one point; move one of them."
    yield from _spoilt_wheels(car)
    if not any(wheel.driven_against for wheel in car.wheels):
        yield "wheels", 'are none of them driven; give one a "driven_against".'
    if loose := sorted(_loose(car)):
        yield "bodies", f'hold "{loose[0]}", which nothing joins to the {car.chassis}; join it.'


def _doubled(section: str, names: list[str]) -> Iterator[tuple[str, str]]:
    for name, count in Counter(names).items():
        if count > 1:
            yield section, f'hold "{name}" {count} times; rename all but one.'


def _one_each(section: str, given: list, wanted: tuple) -> Iterator[tuple[str, str]]:
    for place in wanted:
        if given.count(place) != 1:
            yield section, f'are {given.count(place)} of "{place}"; give one.'


def _inertia_problem(body: BodyData) -> str:
    """What makes a tensor impossible, or nothing: no moment may exceed the other two's sum."""
    moments = np.linalg.eigvalsh(body.inertia.matrix)
    slack = ROUNDING * moments[2]
    shown = ", ".join(f"{moment:.4g}" for moment in moments)
    if moments[0] <= 0.0:
        return (
            f'of "{body.name}" has a principal moment that is not positive ({shown}); correct it.'
        )
    if moments[2] > moments[0] + moments[1] + slack:
        return (
            f'of "{body.name}" has principal moments {shown} kg m^2, of which the largest exceeds'
            " the sum of the others; no body has that, correct it."
        )
    return ""


def _references(car: DetailedCar) -> Iterator[tuple[str, str, list[str]]]:
    """Place, name and the names it may be, of everything that is referred to by name."""
    bodies = list(car.body_named)
    yield "chassis", car.chassis, bodies
    for section in ("joints", "bushings", "springs", "dampers", "stabilizer_bars"):
        for k, element in enumerate(getattr(car, section)):
            for end, name in enumerate(element.bodies):
                yield f"{section}[{k}].bodies[{end}]", name, bodies
    for k, bushing in enumerate(car.bushings):
        yield f"bushings[{k}].law", bushing.law, list(car.law_named)
    for k, wheel in enumerate(car.wheels):
        for field in ("body", "carrier", "driven_against"):
            if (name := getattr(wheel, field)) is not None:
                yield f"wheels[{k}].{field}", name, bodies


def _pairs(car: DetailedCar) -> Iterator[tuple[str, str]]:
    for section in ("joints", "bushings", "springs", "dampers", "stabilizer_bars"):
        for k, element in enumerate(getattr(car, section)):
            if element.bodies[0] == element.bodies[1]:
                yield f"{section}[{k}].bodies", f'are both "{element.bodies[0]}"; name two.'


def _spoilt_wheels(car: DetailedCar) -> Iterator[tuple[str, str]]:
    """Wheels that cannot turn, are not balanced about their axle, or are driven one by one."""
    group_of = {name: group for group in rigid_groups(car) for name in group.names}
    for k, wheel in enumerate(car.wheels):
        if wheel.carrier in group_of[wheel.body].names:
            yield (
                f"wheels[{k}].carrier",
                f'is "{wheel.carrier}", which is one rigid body with "{wheel.body}" that is to turn'
                " in it; correct one of the two.",
            )
        away = np.subtract(wheel.centre, group_of[wheel.body].cg)
        if (off := float(np.hypot(away[0], away[2]))) > BALANCE:
            yield (
                f"wheels[{k}].centre",
                f"is {1e3 * off:.1f} mm off the axis through the CG of what turns; correct it.",
            )
    for axle in AXLES:
        if len({wheel.driven_against is None for wheel in car.wheels_of(axle)}) > 1:
            yield "wheels", f'of the {axle} axle are driven by halves; give both "driven_against".'


def _loose(car: DetailedCar) -> set[str]:
    """Bodies that no chain of joints and bushings leads to from the chassis."""
    reached, edges = {car.chassis}, [set(one.bodies) for one in (*car.joints, *car.bushings)]
    while found := {name for edge in edges if edge & reached for name in edge} - reached:
        reached |= found
    return set(car.body_named) - reached
