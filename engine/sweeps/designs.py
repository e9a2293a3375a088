"""Designs: the cars of a sweep, as values of some of a vehicle's numbers.

    full factorial     every combination of the parameters' levels
    Latin hypercube    `cars` random points, one in each of `cars` equal strata of every parameter
    Sobol              `cars` points of a scrambled Sobol sequence, which fill the box evenly

Cars are counted from 0. A seed gives the same car of a number whatever the blocks in which they
are drawn. Parameters go by their path or symbol; every number of a vehicle can be one.
"""

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from ..errors import SweepError
from ..parameters import number_path
from ..units import after_number
from ..vehicle import numbers

Array = NDArray[np.float64]
Limits = tuple[float, float]

MOST_HELD = 1_000_000
"""Most cars of a Latin hypercube, which can only be drawn whole and is held in memory."""


class Design(Protocol):
    """Which cars a sweep has.

    names : paths of the parameters
    cars : how many cars
    low, high (parameters,) : corners of the box in which all cars lie, SI
    """

    names: tuple[str, ...]
    cars: int
    low: Array
    high: Array

    def block(self, first: int, count: int) -> Array:
        """Values (at most `count`, parameters) of the cars from number `first` on, SI."""
        ...

    def to_json(self) -> dict[str, Any]:
        """The design as plain JSON data."""
        ...


@dataclass(frozen=True, slots=True)
class Spaced:
    """Evenly spaced levels from `low` to `high`, both included."""

    low: float
    high: float
    count: int

    def at(self, places: NDArray[np.int64]) -> Array:
        """The levels at some places, 0 to count - 1."""
        share = places / (self.count - 1)
        return self.low * (1.0 - share) + self.high * share


@dataclass(frozen=True, slots=True)
class Listed:
    """Levels one by one."""

    values: tuple[float, ...]

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.values)

    @property
    def low(self) -> float:
        """The least."""
        return min(self.values)

    @property
    def high(self) -> float:
        """The greatest."""
        return max(self.values)

    def at(self, places: NDArray[np.int64]) -> Array:
        """The levels at some places, 0 to count - 1."""
        return np.array(self.values)[places]


class FullFactorial:
    """Every combination of levels; the last parameter's level changes from car to car."""

    kind: ClassVar[str] = "full-factorial"

    def __init__(self, levels: Mapping[str, Spaced | Sequence[float]]):
        """Levels by parameter; raises ParameterError or SweepError."""
        told = {
            name: given if isinstance(given, Spaced) else Listed(tuple(map(float, given)))
            for name, given in levels.items()
        }
        self.names = _paths(told)
        self.levels = tuple(told.values())
        for name, given in zip(self.names, self.levels, strict=True):
            _check_levels(name, given)
        self.cars = math.prod(given.count for given in self.levels)
        self.low = np.array([given.low for given in self.levels])
        self.high = np.array([given.high for given in self.levels])

    def block(self, first: int, count: int) -> Array:
        """Values of some cars, see `Design`."""
        cars = np.arange(first, min(first + count, self.cars))
        places = np.unravel_index(cars, [given.count for given in self.levels])
        columns = [given.at(place) for given, place in zip(self.levels, places, strict=True)]
        return np.column_stack(columns)

    def to_json(self) -> dict[str, Any]:
        """The design as plain JSON data."""
        levels = {
            name: list(given.values)
            if isinstance(given, Listed)
            else {"low": given.low, "high": given.high, "count": given.count}
            for name, given in zip(self.names, self.levels, strict=True)
        }
        return {"kind": self.kind, "levels": levels}


class _Sampled(ABC):
    """Points in a box of ranges."""

    kind: ClassVar[str]

    def __init__(self, ranges: Mapping[str, Limits], cars: int, seed: int = 0):
        """(low, high) by parameter; raises ParameterError or SweepError."""
        self.names = _paths(ranges)
        limits = [(float(low), float(high)) for low, high in ranges.values()]
        for name, (low, high) in zip(self.names, limits, strict=True):
            _check_range(name, low, high, "bounds")
        _require_whole("cars", cars, 1)
        _require_whole("seed", seed, 0)
        self.cars, self.seed = cars, seed
        self.low, self.high = np.array(limits).T

    def block(self, first: int, count: int) -> Array:
        """Values of some cars, see `Design`."""
        share = self._points(first, min(first + count, self.cars))
        return self.low * (1.0 - share) + self.high * share

    def to_json(self) -> dict[str, Any]:
        """The design as plain JSON data."""
        limits = zip(self.low.tolist(), self.high.tolist(), strict=True)
        ranges = {name: list(pair) for name, pair in zip(self.names, limits, strict=True)}
        return {"kind": self.kind, "ranges": ranges, "cars": self.cars, "seed": self.seed}

    @abstractmethod
    def _points(self, first: int, end: int) -> Array:
        """Points (end - first, parameters) of the unit box."""


class LatinHypercube(_Sampled):
    """A random point in each of `cars` strata of every parameter; held in memory whole."""

    kind = "latin-hypercube"

    def __init__(self, ranges: Mapping[str, Limits], cars: int, seed: int = 0):
        """See `_Sampled`; SweepError beyond MOST_HELD cars."""
        super().__init__(ranges, cars, seed)
        if cars > MOST_HELD:
            raise SweepError(
                f"A Latin hypercube is drawn whole and takes at most {MOST_HELD:.3g} cars, not"
                f" {cars:.3g}; take a Sobol sequence, which is drawn block by block."
            )
        self._held: Array | None = None

    def _points(self, first: int, end: int) -> Array:
        if self._held is None:
            self._held = qmc.LatinHypercube(len(self.names), rng=self.seed).random(self.cars)
        return self._held[first:end]


class Sobol(_Sampled):
    """The first points of a scrambled Sobol sequence; best filled by a power of two of them."""

    kind = "sobol"
    _sequence: qmc.Sobol | None = None

    def _points(self, first: int, end: int) -> Array:
        sequence = self._sequence
        if sequence is None or sequence.num_generated != first:
            sequence = self._sequence = qmc.Sobol(len(self.names), rng=self.seed)
            if first:
                sequence.fast_forward(first)
        # scipy warns of a number that is no power of two where a sequence begins with it.
        parts = [1, end - first - 1] if first == 0 else [end - first]
        return np.concatenate([sequence.random(part) for part in parts])


def _paths(names: Iterable[str]) -> tuple[str, ...]:
    """Paths of parameters that may be given by symbol, each once."""
    found: dict[str, str] = {}
    for name in names:
        path = number_path(name)
        if path in found:
            raise SweepError(
                f"{path} is swept twice, as {found[path]} and as {name}; give it once."
            )
        found[path] = name
    if not found:
        raise SweepError(
            "A sweep varies nothing; give levels or a range of at least one parameter, e.g. of"
            " front.suspension.stiffness."
        )
    return tuple(found)


def _check_levels(name: str, levels: Spaced | Listed) -> None:
    """Refuse levels that are none, double, crossed or outside what a vehicle accepts."""
    if isinstance(levels, Spaced):
        _check_range(name, levels.low, levels.high, "levels")
        _require_whole(f"The count of {name}'s levels", levels.count, 2)
        return
    if not levels.values:
        raise SweepError(f"{name} has no levels; give at least one, or leave it out.")
    for value in levels.values:
        _check_value(name, value, "levels")
    value, times = Counter(levels.values).most_common(1)[0]
    if times > 1:
        raise SweepError(f"{name} has the level {value:g} more than once; give it once.")


def _check_range(name: str, low: float, high: float, what: str) -> None:
    """Refuse a range that is crossed, empty or reaches where no vehicle may be."""
    for value in (low, high):
        _check_value(name, value, what)
    accepted = numbers()[name]
    unit = after_number(accepted.unit)
    if low >= high:
        raise SweepError(
            f"The {what} of {name}, {low:g} to {high:g}{unit}, are crossed or leave no room; give"
            " the lower end first, then a higher one."
        )
    if accepted.apart and low < 0.0 < high:
        raise SweepError(
            f"The {what} of {name}, {low:g} to {high:g}{unit}, span zero, but it must lie"
            f" {accepted}; sweep one side at a time."
        )


def _check_value(name: str, value: float, what: str) -> None:
    accepted = numbers()[name]
    if not math.isfinite(value):
        raise SweepError(f"The {what} of {name} hold {value}; give finite numbers.")
    if not accepted.holds(value):
        raise SweepError(
            f"The {what} of {name} reach {value:g}, but it must lie {accepted}; correct them."
        )


def _require_whole(what: str, number: Any, least: int) -> None:
    if isinstance(number, bool) or not isinstance(number, int) or number < least:
        raise SweepError(f"{what} is {number}; give a whole number from {least} on.")
