"""What is known of parameters before any run: from drawings, data sheets or a test bench.

A prior of mean m and standard deviation s is one more residual,

    (p - m) / s,    or    ln(p / m) / (s / |m|)

where the optimiser works on the logarithm: linear in its variable x, with the slope `weight`. Its
error is what it says, so it enters the errors with variance 1.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import ProblemError
from ..units import after_number
from .variables import Variable

WIDEST = 0.5
"""Relative deviation beyond which a prior in the logarithm would mean something else."""


@dataclass(frozen=True, slots=True)
class Prior:
    """Mean and standard deviation of a parameter, SI."""

    name: str
    mean: float
    deviation: float

    def weight(self, one: Variable) -> float:
        """d residual / d x for the parameter of this prior."""
        size = abs(self.mean) if one.logarithmic else one.scale
        return size / self.deviation

    def residual(self, one: Variable, x: float) -> float:
        """The residual at the variable x."""
        return (x - one.variable(self.mean)) * self.weight(one)


def checked_prior(name: str, prior: tuple[float, float], known: Sequence[Variable]) -> Prior:
    """A prior on one of the free parameters, or one sentence on what is wrong with it."""
    one = next((one for one in known if one.name == name), None)
    if one is None:
        raise ProblemError(f"A prior is given for {name}, which is not free; free it or leave it.")
    mean, deviation = prior
    unit = after_number(one.unit)
    if not 0.0 < deviation < math.inf:
        raise ProblemError(
            f"The prior of {name} has a standard deviation of {deviation:g}{unit}; it must be "
            "positive."
        )
    if not one.lower <= mean <= one.upper:
        raise ProblemError(
            f"The prior of {name}, {mean:g}{unit}, lies outside its bounds {one.lower:g} to "
            f"{one.upper:g}{unit}; widen the bounds or correct the prior."
        )
    if one.logarithmic and deviation > WIDEST * abs(mean):
        raise ProblemError(
            f"The prior of {name} has a standard deviation of {deviation:g}{unit}, more than half "
            f"its mean, {mean:g}{unit}; it says next to nothing, so leave it out."
        )
    return Prior(name, float(mean), float(deviation))
