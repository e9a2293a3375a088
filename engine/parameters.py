"""The parameters an identification can free: the twelve of the paper's Table 3 in its order, then
the four of dampers with two slopes and a knee, which stay as they are unless they are named.

One row a parameter: its path in the vehicle's JSON, its symbol and label, how a page shows it and
how far a slider goes. Bounds of a fit, sliders, JSON and documentation all read this table.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass
from difflib import get_close_matches

from .errors import ParameterError
from .frames import AXLES, AxleName
from .vehicle import Vehicle, numbers

SHARE_OF_START = (0.05, 8.0)
"""Default bounds of a stiffness or damping, as multiples of its start value."""

ANGLE_BOUNDS = (-0.3, 1.3)
"""Default bounds of a pivot angle, rad."""

DISTANCE_BOUNDS = (0.1, 10.0)
"""Default bounds of a pivot distance's magnitude, m; its sign is that of the start value."""

RATIO_BOUNDS = (0.2, 10.0)
"""Default bounds of a damper's rebound ratio."""

KNEE_BOUNDS = (0.02, 20.0)
"""Default bounds of a damper's knee speed, m/s: from hardly above friction to beyond any road."""

DAMPER_STARTS = {"rebound_ratio": 1.5, "knee_speed": 0.5}
"""Where the search begins for a car whose damper is linear, SI."""

PER_DEGREE = math.pi / 180.0
"""Factor from a quantity per radian to one per degree."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter; slider limits, step and `unit` are SI, `display = SI * display_factor`.

    meaning : what the label leaves open
    """

    name: str
    symbol: str
    label: str
    unit: str
    display_unit: str
    display_factor: float
    slider_lower: float
    slider_upper: float
    step: float
    meaning: str = ""


def _spring(axle: AxleName) -> Parameter:
    return Parameter(
        name=f"{axle}.suspension.stiffness",
        symbol=f"K_{axle[0].upper()}",
        label=f"{axle.capitalize()} spring stiffness",
        unit="N/m",
        display_unit="N/mm",
        display_factor=1e-3,
        slider_lower=5e3,
        slider_upper=1e5,
        step=100.0,
    )


def _damper(axle: AxleName) -> Parameter:
    return Parameter(
        name=f"{axle}.suspension.damping",
        symbol=f"C_{axle[0].upper()}",
        label=f"{axle.capitalize()} damping",
        unit="N s/m",
        display_unit="N s/m",
        display_factor=1.0,
        slider_lower=100.0,
        slider_upper=1e4,
        step=10.0,
    )


def _bar_stiffness(axle: AxleName) -> Parameter:
    return Parameter(
        name=f"{axle}.stabilizer_bar.stiffness",
        symbol=f"Ktor_{axle[0].upper()}",
        label=f"{axle.capitalize()} stabilizer bar stiffness",
        unit="N m/rad",
        display_unit="N m/deg",
        display_factor=PER_DEGREE,
        slider_lower=0.0,
        slider_upper=2000.0 / PER_DEGREE,
        step=1.0 / PER_DEGREE,
    )


def _bar_damping(axle: AxleName) -> Parameter:
    return Parameter(
        name=f"{axle}.stabilizer_bar.damping",
        symbol=f"Ctor_{axle[0].upper()}",
        label=f"{axle.capitalize()} stabilizer bar damping",
        unit="N m s/rad",
        display_unit="N m s/deg",
        display_factor=PER_DEGREE,
        slider_lower=0.0,
        slider_upper=30.0 / PER_DEGREE,
        step=0.05 / PER_DEGREE,
    )


def _pivot_distance(axle: AxleName) -> Parameter:
    return Parameter(
        name=f"{axle}.pivot.distance",
        symbol=f"d_{axle[0].upper()}",
        label=f"{axle.capitalize()} pivot distance",
        unit="m",
        display_unit="m",
        display_factor=1.0,
        slider_lower=0.2,
        slider_upper=6.0,
        step=0.01,
    )


def _pivot_angle(axle: AxleName) -> Parameter:
    return Parameter(
        name=f"{axle}.pivot.angle",
        symbol=f"phi_{axle[0].upper()}",
        label=f"{axle.capitalize()} pivot angle",
        unit="rad",
        display_unit="deg",
        display_factor=1.0 / PER_DEGREE,
        slider_lower=-15.0 * PER_DEGREE,
        slider_upper=60.0 * PER_DEGREE,
        step=0.1 * PER_DEGREE,
    )


def _rebound_ratio(axle: AxleName) -> Parameter:
    return Parameter(
        name=f"{axle}.suspension.rebound_ratio",
        symbol=f"rho_{axle[0].upper()}",
        label=f"{axle.capitalize()} rebound ratio",
        unit="1",
        display_unit="",
        display_factor=1.0,
        slider_lower=0.2,
        slider_upper=5.0,
        step=0.05,
        meaning="the damper's slope in rebound over that in jounce, near rest",
    )


def _knee_speed(axle: AxleName) -> Parameter:
    return Parameter(
        name=f"{axle}.suspension.knee_speed",
        symbol=f"v_{axle[0].upper()}",
        label=f"{axle.capitalize()} knee speed",
        unit="m/s",
        display_unit="m/s",
        display_factor=1.0,
        slider_lower=0.02,
        slider_upper=5.0,
        step=0.01,
        meaning="where the damper's force is half of what its slope near rest promises",
    )


PARAMETERS: tuple[Parameter, ...] = (
    _spring("front"),
    _damper("front"),
    _spring("rear"),
    _damper("rear"),
    _bar_stiffness("front"),
    _bar_damping("front"),
    _bar_stiffness("rear"),
    _bar_damping("rear"),
    _pivot_distance("front"),
    _pivot_angle("front"),
    _pivot_distance("rear"),
    _pivot_angle("rear"),
)

"""The twelve, which a fit frees unless told otherwise."""

DAMPER_PARAMETERS: tuple[Parameter, ...] = (
    _rebound_ratio("front"),
    _knee_speed("front"),
    _rebound_ratio("rear"),
    _knee_speed("rear"),
)

ALL_PARAMETERS = (*PARAMETERS, *DAMPER_PARAMETERS)

PARAMETER_NAMES: tuple[str, ...] = tuple(row.name for row in PARAMETERS)
DAMPER_NAMES: tuple[str, ...] = tuple(row.name for row in DAMPER_PARAMETERS)
ALL_NAMES: tuple[str, ...] = (*PARAMETER_NAMES, *DAMPER_NAMES)


def parameter(name: str) -> Parameter:
    """The row of the parameter with this name or symbol, in any case."""
    known = {key.lower(): row for row in ALL_PARAMETERS for key in (row.name, row.symbol)}
    row = known.get(name.lower())
    if row is not None:
        return row
    near = get_close_matches(name.lower(), known, n=1)
    if near:
        row = known[near[0]]
        hint = f"did you mean {row.name if '.' in near[0] else row.symbol}?"
    else:
        hint = f"there are {', '.join(ALL_NAMES)}."
    raise ParameterError(f"No parameter is called '{name}'; {hint}")


def number_path(name: str) -> str:
    """Path of a vehicle's number that is given by its path, or by its symbol if it is one of
    `ALL_PARAMETERS`, in any case.
    """
    paths = {path: path for path in numbers()} | {row.symbol: row.name for row in ALL_PARAMETERS}
    known = {told.lower(): told for told in paths}
    if (told := known.get(name.lower())) is not None:
        return paths[told]
    near = get_close_matches(name.lower(), known, n=1)
    hint = f"did you mean {known[near[0]]}?" if near else "e.g. front.suspension.stiffness."
    raise ParameterError(f"No number of a vehicle is called '{name}'; {hint}")


def default_bounds(name: str, start: float) -> tuple[float, float]:
    """Lower and upper bound of a free parameter that starts at `start`.

    Stiffness and damping: 0.05 to 8 times the start, which must be positive. Pivot angle: -0.3 to
    1.3 rad. Pivot distance: 0.1 to 10 m with the sign of the start. Rebound ratio: 0.2 to 10. Knee
    speed: 0.02 to 20 m/s. All of it within what a vehicle accepts.
    """
    row = parameter(name)
    accepted = numbers()[row.name]
    lower, upper = _wished_bounds(row, start)
    return max(lower, accepted.lower), min(upper, accepted.upper)


def bounds_rule(name: str) -> str:
    """The rule of `default_bounds` for a parameter, for a person to read."""
    row = parameter(name)
    if ".pivot." in row.name or row.name in DAMPER_NAMES:
        return "the same for every car"
    lower, upper = SHARE_OF_START
    return f"{lower:g} to {upper:g} times the start"


def _wished_bounds(row: Parameter, start: float) -> tuple[float, float]:
    if row.name.endswith("pivot.angle"):
        return ANGLE_BOUNDS
    if row.name.endswith("rebound_ratio"):
        return RATIO_BOUNDS
    if row.name.endswith("knee_speed"):
        return KNEE_BOUNDS
    lower, upper = DISTANCE_BOUNDS
    if row.name.endswith("pivot.distance"):
        return (lower, upper) if start > 0.0 else (-upper, -lower)
    if not start > 0.0:
        raise ParameterError(
            f"{row.name} starts at {start:g} {row.unit}, from which no default bounds follow; give"
            " it a positive start value, give its bounds, or fix it."
        )
    return SHARE_OF_START[0] * start, SHARE_OF_START[1] * start


def damper_starts(vehicle: Vehicle, names: Collection[str]) -> dict[str, float]:
    """Start values for those of some parameters that a car's linear dampers lack."""
    linear = {axle: vehicle.axle(axle).suspension.linear for axle in AXLES}
    found = {}
    for row in DAMPER_PARAMETERS:
        axle, _, number = row.name.split(".")
        if row.name in names and (linear[axle] or vehicle.value(row.name) is None):
            found[row.name] = DAMPER_STARTS[number]
    return found
