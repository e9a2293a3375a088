"""A car as the ride model sees it: records with units and accepted ranges, and their checks.

The field names are the keys of the vehicle's JSON, so a dotted path such as
`front.pivot.angle` names the same number in a file, in an error and in the table of parameters.
Everything is in SI and radians. The range beside each number says what is accepted: wide enough
for a kart and a lorry, narrow enough to catch a value in the wrong unit.

A number may be an array (C,), which makes a vehicle C cars that share the rest (`Vehicle.varied`);
what is derived from a vehicle here and in `equilibrium` and `car_rows` holds for one and for many.
"""

import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, is_dataclass, replace
from difflib import get_close_matches
from functools import cache, reduce
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from .errors import ParameterError, VehicleError
from .frames import AXLES, CORNERS, AxleName, Corner, axle_of
from .units import after_number


@dataclass(frozen=True, slots=True)
class Range:
    """The unit of a number and the closed interval it must lie in; `apart` keeps it off zero."""

    unit: str
    lower: float
    upper: float
    apart: float = 0.0

    def holds(self, value: float) -> bool:
        """Whether a value is accepted; NaN never is."""
        return (self.lower <= value) & (value <= self.upper) & (abs(value) >= self.apart)

    def __str__(self) -> str:
        """Say the range as a person reads it."""
        unit = after_number(self.unit)
        if self.apart:
            return (
                f"between {self.apart:g} and {self.upper:g}{unit}"
                f" (or between {self.lower:g} and {-self.apart:g}{unit})"
            )
        return f"between {self.lower:g} and {self.upper:g}{unit}"


PIVOT_CLEARANCE = 0.1
"""Least longitudinal distance between a pivot and its wheel's contact point, m."""

STEEPEST_ARM = 0.1
"""Least share of an arm's length that lies along the car: steeper, its wheel can barely rise."""

Mass = Annotated[float, Range("kg", 0.1, 1e5)]
MomentOfInertia = Annotated[float, Range("kg m^2", 0.0, 1e6)]
LinearDamping = Annotated[float, Range("N s/m", 0.0, 1e6)]
TorsionalStiffness = Annotated[float, Range("N m/rad", 0.0, 1e7)]
TorsionalDamping = Annotated[float, Range("N m s/rad", 0.0, 1e6)]
Share = Annotated[float, Range("1", 0.0, 1.0)]
Reaction = Literal["chassis", "arm"]

Condition = tuple[Any, Callable[[], str]]
"""What must hold of a car, and the sentence to say where it does not; of many cars, (C,)."""


@dataclass(frozen=True, slots=True)
class Inertia:
    """Elements of the sprung mass's inertia tensor at its CG in B; xz = -integral of x z dm."""

    xx: Annotated[float, Range("kg m^2", 0.1, 1e6)]
    yy: Annotated[float, Range("kg m^2", 0.1, 1e6)]
    zz: Annotated[float, Range("kg m^2", 0.1, 1e6)]
    xz: Annotated[float, Range("kg m^2", -1e6, 1e6)] = 0.0


@dataclass(frozen=True, slots=True)
class Inertia3:
    """Principal moments of inertia of a corner's moving parts at their CG, axes parallel to B."""

    xx: MomentOfInertia
    yy: MomentOfInertia
    zz: MomentOfInertia


@dataclass(frozen=True, slots=True)
class Chassis:
    """The sprung mass; `cg_height` is the height of its CG above the ground at rest."""

    mass: Annotated[float, Range("kg", 10.0, 1e5)]
    inertia: Inertia
    cg_height: Annotated[float, Range("m", 0.05, 5.0)]


@dataclass(frozen=True, slots=True)
class Wheel:
    """One corner's moving parts (wheel, arm and what moves with them) as one rigid body.

    radius : loaded static radius, which is also the effective radius
    cg_offset : CG from the wheel centre as (towards the middle of the car, outwards, up); the
        first is counted in the direction in which a positive pivot distance is
    """

    mass: Mass
    radius: Annotated[float, Range("m", 0.05, 2.0)]
    inertia: Inertia3
    cg_offset: Annotated[tuple[float, float, float], Range("m", -1.0, 1.0)] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Suspension:
    """Spring-damper from the wheel centre to a mount `mount_height` straight above it at rest.

    damping : of the damper near rest, the mean of its slopes in jounce and in rebound
    rebound_ratio : its slope in rebound over that in jounce
    knee_speed : at which its force has fallen to half of what the slope promises; None where the
        slope holds at every speed
    """

    stiffness: Annotated[float, Range("N/m", 100.0, 1e7)]
    damping: LinearDamping
    mount_height: Annotated[float, Range("m", 0.02, 5.0)] = 0.40
    rebound_ratio: Annotated[float, Range("1", 0.05, 20.0)] = 1.0
    knee_speed: Annotated[float, Range("m/s", 0.01, 100.0)] | None = None

    @property
    def linear(self) -> bool:
        """Whether the damper's force is its damping times the jounce rate."""
        return self.rebound_ratio == 1.0 and self.knee_speed is None

    @property
    def slopes(self) -> tuple[float, float]:
        """Of the damper's force near rest, in jounce and in rebound, N s/m."""
        jounce = 2.0 * self.damping / (1.0 + self.rebound_ratio)
        return jounce, self.rebound_ratio * jounce


@dataclass(frozen=True, slots=True)
class StabilizerBar:
    """Torque between an axle's two arms by the difference of their angles; 0 is no bar."""

    stiffness: TorsionalStiffness
    damping: TorsionalDamping


@dataclass(frozen=True, slots=True)
class Pivot:
    """Where the arms of an axle are hinged, seen from the wheel's contact point.

    distance : along the car towards its middle, negative outwards
    angle : the pivot lies `distance` tan(`angle`) above the ground
    """

    distance: Annotated[float, Range("m", -100.0, 100.0, apart=PIVOT_CLEARANCE)]
    angle: Annotated[float, Range("rad", -1.5, 1.5)]


@dataclass(frozen=True, slots=True)
class Tyre:
    """Vertical spring-damper between wheel centre and ground, and the rolling resistance."""

    stiffness: Annotated[float, Range("N/m", 1e3, 1e8)]
    damping: LinearDamping
    rolling_resistance: Annotated[float, Range("1", 0.0, 0.5)]


@dataclass(frozen=True, slots=True)
class Axle:
    """Two mirrored corners; `cg_distance` from the sprung mass's CG, positive for both axles.

    torque_reaction : where the drive torque is held, on the chassis (differential) or inside
        the arm (hub motor)
    """

    cg_distance: Annotated[float, Range("m", 0.05, 20.0)]
    track: Annotated[float, Range("m", 0.2, 5.0)]
    wheel: Wheel
    suspension: Suspension
    stabilizer_bar: StabilizerBar
    pivot: Pivot
    tyre: Tyre
    driven: bool
    torque_reaction: Reaction = "chassis"


@dataclass(frozen=True, slots=True)
class Brakes:
    """Front share of the braking force, and where the brake torque is held (outboard: arm)."""

    front_share: Share
    reaction: Reaction = "arm"


@dataclass(frozen=True, slots=True)
class Vehicle:
    """The whole car; `source` says where its numbers come from and plays no part in the model."""

    name: str
    chassis: Chassis
    front: Axle
    rear: Axle
    brakes: Brakes | None = None
    source: str = ""

    @property
    def wheelbase(self) -> float:
        """Distance between the axles, m."""
        return self.front.cg_distance + self.rear.cg_distance

    @property
    def total_mass(self) -> float:
        """Sprung mass and the four corners, kg."""
        return self.chassis.mass + 2.0 * (self.front.wheel.mass + self.rear.wheel.mass)

    @property
    def driven_corners(self) -> tuple[Corner, ...]:
        """Corners that take drive torque, in the order of CORNERS."""
        return tuple(corner for corner in CORNERS if self.axle_at(corner).driven)

    def axle(self, name: AxleName) -> Axle:
        """The axle called "front" or "rear"."""
        return self.front if name == "front" else self.rear

    def axle_at(self, corner: Corner) -> Axle:
        """The axle a corner belongs to."""
        return self.axle(axle_of(corner))

    def value(self, path: str) -> float:
        """The number at a dotted path, e.g. `front.pivot.angle`; None for one the car lacks."""
        _require_number(self, path)
        record: Any = self
        for name in path.split("."):
            record = getattr(record, name)
        return record

    def with_values(self, values: Mapping[str, float]) -> "Vehicle":
        """This car with the numbers at some dotted paths replaced, checked like a file."""
        vehicle = self._with({path: float(value) for path, value in values.items()})
        check(vehicle)
        return vehicle

    def varied(self, values: Mapping[str, NDArray[np.float64]]) -> "Vehicle":
        """Many cars: this one with arrays (C,) at some dotted paths; `possible` checks them."""
        return self._with(values)

    def _with(self, values: Mapping[str, Any]) -> "Vehicle":
        vehicle = self
        for path, value in values.items():
            _require_number(self, path)
            vehicle = _replaced(vehicle, path.split("."), value)
        return vehicle


def _replaced(record: Any, names: list[str], value: Any) -> Any:
    name, *rest = names
    return replace(
        record, **{name: _replaced(getattr(record, name), rest, value) if rest else value}
    )


@cache
def field_types(record: type) -> dict[str, tuple[Any, Range | None]]:
    """Fields of a record: name -> (type without None and Annotated, accepted range or None)."""
    found: dict[str, tuple[Any, Range | None]] = {}
    for name, hint in get_type_hints(record, include_extras=True).items():
        if NoneType in get_args(hint):
            hint = next(one for one in get_args(hint) if one is not NoneType)
        if get_origin(hint) is Annotated:
            bare, accepted = get_args(hint)[:2]
            found[name] = (bare, accepted)
        else:
            found[name] = (hint, None)
    return found


@cache
def numbers(record: type = Vehicle) -> dict[str, Range]:
    """Dotted path of every single number in a record -> its unit and accepted range."""
    found: dict[str, Range] = {}
    for name, (kind, accepted) in field_types(record).items():
        if is_dataclass(kind) and isinstance(kind, type):
            found |= {f"{name}.{path}": held for path, held in numbers(kind).items()}
        elif kind is float and accepted is not None:
            found[name] = accepted
    return found


def _require_number(vehicle: Vehicle, path: str) -> None:
    if path not in numbers():
        near = get_close_matches(path, numbers(), n=1)
        hint = f"did you mean {near[0]}?" if near else "e.g. front.suspension.stiffness."
        raise ParameterError(f"No number of a vehicle is called '{path}'; {hint}")
    if path.startswith("brakes.") and vehicle.brakes is None:
        raise ParameterError(
            f"{path} cannot be used because the vehicle '{vehicle.name}' has no brakes;"
            ' add "brakes" to its data first.'
        )


def _ranged(record: Any, prefix: str = "") -> Iterator[tuple[str, float, Range]]:
    """Every number of a record with its dotted path and accepted range."""
    for name, (_, accepted) in field_types(type(record)).items():
        path, value = prefix + name, getattr(record, name)
        if value is None:
            continue
        if accepted is None:
            if is_dataclass(value):
                yield from _ranged(value, f"{path}.")
        elif isinstance(value, tuple):
            yield from ((f"{path}[{i}]", element, accepted) for i, element in enumerate(value))
        else:
            yield path, value, accepted


def check(vehicle: Vehicle, source: str = "vehicle") -> None:
    """Refuse a car that cannot exist or that the model cannot drive.

    source : what the car was read from, named at the head of every message
    Raises VehicleError naming the dotted path, the accepted range and what to do.
    """
    require(_conditions(vehicle), f"{source}: ")


def possible(vehicle: Vehicle) -> Any:
    """Whether `check` accepts a car; of many cars (C,)."""
    return all_hold(holds for holds, _ in _conditions(vehicle))


def require(conditions: Iterable[Condition], head: str = "") -> None:
    """Raise VehicleError with the sentence of the first condition that one car does not meet."""
    for holds, sentence in conditions:
        if not holds:
            raise VehicleError(f"{head}{sentence()}")


def all_hold(conditions: Iterable[Any]) -> Any:
    """Whether all of some conditions hold, for one car or for each of many."""
    return reduce(operator.and_, conditions)


def _conditions(vehicle: Vehicle) -> Iterator[Condition]:
    """What `check` asks for, in its order."""
    for path, value, accepted in _ranged(vehicle):
        unit = after_number(accepted.unit)
        yield (
            accepted.holds(value),
            lambda: f"{path} is {value:g}{unit}, but must lie {accepted}; correct it.",
        )
    inertia = vehicle.chassis.inertia
    crossed = inertia.xz != 0.0
    yield _real_inertia("chassis.inertia", *_principal_moments(inertia), crossed=crossed)
    for name in AXLES:
        axle = vehicle.axle(name)
        moments = axle.wheel.inertia
        yield _real_inertia(f"{name}.wheel.inertia", moments.xx, moments.yy, moments.zz)
        yield _carrying_arm(f"{name}.pivot", axle)
    yield (
        bool(vehicle.driven_corners),
        lambda: "front.driven and rear.driven are both false; set one of them to true.",
    )


def _carrying_arm(place: str, axle: Axle) -> Condition:
    """No arm stands so near the vertical that it cannot carry its wheel up and down."""
    pivot = axle.pivot
    height = pivot.distance * np.tan(pivot.angle)
    along, up = abs(pivot.distance), abs(height - axle.wheel.radius)
    return (
        along >= STEEPEST_ARM * np.hypot(along, up),
        lambda: (
            f"{place} lies {along:.3g} m from the wheel along the car at a height of {height:.3g}"
            f" m, so that the arm stands {np.degrees(np.arctan2(along, up)):.2g} deg from the"
            " vertical and cannot carry the wheel up and down; lengthen pivot.distance or bring"
            " pivot.angle nearer to zero."
        ),
    )


def _principal_moments(inertia: Inertia) -> tuple[Any, Any, Any]:
    """Eigenvalues of the tensor, which is symmetric about the xz plane."""
    mean = 0.5 * (inertia.xx + inertia.zz)
    spread = np.hypot(0.5 * (inertia.xx - inertia.zz), inertia.xz)
    return mean - spread, inertia.yy, mean + spread


def _real_inertia(place: str, *moments: Any, crossed: Any = False) -> Condition:
    """No principal moment of a real body is negative or exceeds the sum of the other two."""
    total = sum(moments)
    rounding = 1e-9 * total

    def sentence() -> str:
        what = "the principal moments (xz included)" if crossed else "the moments"
        listed = ", ".join(f"{moment:.6g}" for moment in moments)
        return (
            f"{place} cannot belong to a real body: {what} {listed} kg m^2 must not be negative and"
            " none may exceed the sum of the other two; correct xx, yy or zz"
            + (" or xz." if crossed else ".")
        )

    within = ((one >= -rounding) & (2.0 * one <= total + rounding) for one in moments)
    return all_hold(within), sentence
