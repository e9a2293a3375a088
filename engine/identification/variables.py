"""The numbers that a fit looks for, and the variables in which the optimiser does.

The optimiser's variable is x = log |p / s| for stiffness, damping and pivot distance p of scale s,
x = p / s for angles and for bounds at or across zero: a step of 1 is about 100 % everywhere.
"""

import math
from dataclasses import dataclass

from ..parameters import parameter

ANGLE_MATTERS = 0.05
"""What an error of a pivot's angle nearer to 0 is judged by, rad: 3 degrees."""

FARTHEST = 1e3
"""Factor from a value to the end of its interval beyond which the end is not worth telling."""

AT_BOUND = 1e-3
"""A value whose variable is nearer to that of a bound than this share of the range between the
bounds is at it."""


@dataclass(frozen=True, slots=True)
class Variable:
    """A number to be found, in SI: its name, start value and bounds."""

    name: str
    start: float
    lower: float
    upper: float

    @property
    def unit(self) -> str:
        """SI unit of the number."""
        raise NotImplementedError

    @property
    def scale(self) -> float:
        """Typical size: |start|, at least a twentieth of the range between the bounds."""
        return max(abs(self.start), 0.05 * (self.upper - self.lower))

    @property
    def logarithmic(self) -> bool:
        """Whether the optimiser works on the logarithm: for all but angles and bounds at zero."""
        return self.lower * self.upper > 0.0 and not self.name.endswith("pivot.angle")

    def variable(self, value: float) -> float:
        """The optimiser's variable: log |value / scale|, or value / scale."""
        ratio = value / self.scale
        return math.log(abs(ratio)) if self.logarithmic else ratio

    def value(self, variable: float) -> float:
        """The number at a variable, kept between the bounds against rounding."""
        return min(max(self._unbounded(variable), self.lower), self.upper)

    @property
    def ends(self) -> tuple[float, float]:
        """The lower and the upper end of the variable's range."""
        low, high = sorted((self.variable(self.lower), self.variable(self.upper)))
        return low, high

    def end_near(self, variable: float) -> int:
        """Which end of the variable's range is nearer to it: -1 the lower one, 1 the upper one."""
        return 1 if variable > 0.5 * sum(self.ends) else -1

    def at_bound(self, value: float) -> bool:
        """Whether a value is at one of its bounds."""
        return self._is_at(self.lower, value) or self._is_at(self.upper, value)

    def at_lower(self, value: float) -> bool:
        """Whether a value is at its lower bound."""
        return self._is_at(self.lower, value)

    def at_upper(self, value: float) -> bool:
        """Whether a value is at its upper bound."""
        return self._is_at(self.upper, value)

    def _is_at(self, bound: float, value: float) -> bool:
        low, high = self.ends
        return abs(self.variable(value) - self.variable(bound)) < AT_BOUND * (high - low)

    def slope(self, variable: float) -> float:
        """d value / d variable."""
        return self.value(variable) if self.logarithmic else self.scale

    def size(self, value: float) -> float:
        """What the error of a value is judged by: |value|."""
        return abs(value)

    def interval(self, variable: float, below: float, above: float) -> tuple[float, float]:
        """Values from so far below a variable to so far above it, bounds aside. An end is infinite
        where it is, or where the logarithm puts it a factor FARTHEST or more away.
        """
        value = self._unbounded(variable)
        low, high = (self.moved(value, change) for change in (-below, above))
        return (low, high) if low < high else (high, low)

    def moved(self, value: float, change: float) -> float:
        """Where a step of the variable leads from a value, bounds aside (see `moved`)."""
        return moved(value, change, logarithmic=self.logarithmic, scale=self.scale)

    def _unbounded(self, variable: float) -> float:
        ratio = math.copysign(math.exp(variable), self.lower) if self.logarithmic else variable
        return ratio * self.scale


def moved(value: float, change: float, *, logarithmic: bool, scale: float = 1.0) -> float:
    """Where a step of a number's variable leads from a value; infinite where the logarithm puts it
    a factor FARTHEST or more away.
    """
    if not logarithmic:
        return value + change * scale
    if abs(change) > math.log(FARTHEST):
        return math.copysign(math.inf, change * value)
    return value * math.exp(change)


@dataclass(frozen=True, slots=True)
class FreeParameter(Variable):
    """A parameter of the car, by its dotted path."""

    @property
    def unit(self) -> str:
        """SI unit of the parameter."""
        return parameter(self.name).unit

    def size(self, value: float) -> float:
        """|value|, and of a pivot's angle, which may be 0, at least ANGLE_MATTERS."""
        angle = self.name.endswith("pivot.angle")
        return max(abs(value), ANGLE_MATTERS) if angle else abs(value)
