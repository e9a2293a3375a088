"""What a fit found of each number: its value, its error and how well the runs determine it."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..channels import INPUT_CHANNELS
from .compared_runs import ComparedRun
from .fit import DELAY_MATTERS, ParameterEstimate, SensorEstimate, determined
from .problem import Problem
from .sensing import A_X
from .sensor_model import SensorVariable
from .uncertainty import Uncertainty
from .variables import Variable

Array = NDArray[np.float64]


def estimates(
    problem: Problem, x: Array, errors: Uncertainty, *, beyond: Array
) -> tuple[tuple[ParameterEstimate, ...], tuple[SensorEstimate, ...]]:
    """Parameters and sensors at the search's variables x (n,).

    errors : of all variables;  beyond : (n,) where the search would go on to were there no bounds
    At a bound nobody has looked further, so the interval is open there and, on this side, reaches
    to where it would around the point that lies beyond.
    """
    parameters: list[ParameterEstimate] = []
    sensors: list[SensorEstimate] = []
    rows = zip(x.tolist(), beyond.tolist(), errors.std_error.tolist(), strict=True)
    for one, (variable, further, deviation) in zip(problem.variables, rows, strict=True):
        value = one.value(variable)
        at_bound = one.at_bound(value)
        below = above = errors.quantile * deviation
        if at_bound and one.end_near(variable) < 0:
            below, above = math.inf, max(0.0, further - variable + above)
        elif at_bound:
            below, above = max(0.0, variable - further + below), math.inf
        low, high = one.interval(variable, below, above)
        numbers: dict[str, Any] = dict(
            name=one.name,
            value=value,
            unit=one.unit,
            std_error=abs(one.slope(variable)) * deviation,
            confidence_interval=(low, high),
            start=one.start,
            lower=one.lower,
            upper=one.upper,
            at_bound=at_bound,
            determined=determined(_size(one, value, problem.runs), 0.5 * (high - low), at_bound),
        )
        if isinstance(one, SensorVariable):
            own = {"channel": one.channel, "quantity": one.quantity, "run": one.run}
            sensors.append(SensorEstimate(**numbers, **own))
        else:
            parameters.append(ParameterEstimate(**numbers))
    return tuple(parameters), tuple(sensors)


def _size(one: Variable, value: float, runs: Sequence[ComparedRun]) -> float:
    """What an interval is judged against: |value|, or what a nominally 0 quantity matters to."""
    if isinstance(one, SensorVariable) and one.quantity == "delay":
        return DELAY_MATTERS
    if isinstance(one, SensorVariable) and one.quantity == "bias":
        return next(_spread(seen, one.channel) for seen in runs if seen.name == one.run)
    return one.size(value)


def _spread(seen: ComparedRun, channel: str) -> float:
    """Standard deviation of a channel in a run, as it is compared or drives the model."""
    if channel not in INPUT_CHANNELS:
        return float(np.std(seen.measured[channel]))
    place = A_X if channel == INPUT_CHANNELS[-1] else INPUT_CHANNELS.index(channel)
    return float(np.std(seen.inputs.stage_inputs[:, 0, place]))
