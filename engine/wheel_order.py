"""Wheel channels in the wrong columns: does the model follow a run better with wheels exchanged?

Asked only of runs which the fit follows badly. The two sides, the two axles and every pair of
wheels change places, and the car of the start values and the fitted one are driven by the result.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from .channels import WHEEL_CHANNELS
from .problem import ComparedRun
from .residuals import Residuals
from .simulation import fit_percent

Array = NDArray[np.float64]
Histories = Mapping[str, Mapping[str, Array]]
"""(samples,) by run and channel."""

MUCH_CLOSER = 0.5
"""A channel counts as followed much better when its squared misfit falls below this share."""

NO_FURTHER = 1.5
"""No other channel's squared misfit may grow by more than this factor."""

CLEARLY = 0.8
"""Of two exchanges the one that is named second must leave less than this share of misfit."""


def _orders() -> dict[str, list[int]]:
    """By name of the exchange, which wheel's channel drives each wheel."""
    orders = {"left and right wheels": [1, 0, 3, 2], "front and rear wheels": [2, 3, 0, 1]}
    for one, other in combinations(range(4), 2):
        order = list(range(4))
        order[one], order[other] = other, one
        orders[f"{WHEEL_CHANNELS[one]} and {WHEEL_CHANNELS[other]}"] = order
    return orders


ORDERS = _orders()


def exchanged_wheels(
    residuals: Residuals, points: Sequence[Array], runs: Collection[str]
) -> dict[str, str]:
    """A sentence by run whose wheels are probably exchanged.

    points : the optimiser's variables of the cars to try, e.g. start and solution
    runs : names of the runs to look at
    """
    problem = residuals.problem
    seen = tuple(one for one in problem.runs if one.name in runs)
    if not seen:
        return {}
    best: dict[str, tuple[float, str]] = {}
    for x in points:
        as_given = residuals.model(x)
        for words, order in ORDERS.items():
            exchanged = tuple(_exchanged(one, order) for one in seen)
            trial = residuals.on(replace(problem, runs=exchanged), x)
            for one in seen:
                ratio = _misfit_ratio(one, as_given[one.name], trial[one.name])
                if ratio < CLEARLY * best.get(one.name, (1.0 / CLEARLY, ""))[0]:
                    best[one.name] = ratio, _sentence(one, words, as_given, trial)
    return {run: sentence for run, (_, sentence) in best.items()}


def _exchanged(seen: ComparedRun, order: Sequence[int]) -> ComparedRun:
    """The run with u, u' and u'' of the wheels in another order."""
    stages = seen.inputs.stage_inputs.copy()
    for first in (0, 4, 8):
        stages[:, :, first : first + 4] = stages[:, :, [first + wheel for wheel in order]]
    return replace(seen, inputs=replace(seen.inputs, stage_inputs=stages))


def _misfit_ratio(
    seen: ComparedRun, given: Mapping[str, Array], trial: Mapping[str, Array]
) -> float:
    """Mean over channels of squared misfit after over before; infinite where not much better."""
    before, after = (
        np.array([np.sum((model[name] - values) ** 2) for name, values in seen.measured.items()])
        for model in (given, trial)
    )
    ratios = after / np.maximum(before, np.finfo(float).tiny)
    # A car that failed is not a number and follows nothing.
    if not (np.all(ratios < NO_FURTHER) and np.any(ratios < MUCH_CLOSER)):
        return np.inf
    return float(np.mean(ratios))


def _sentence(seen: ComparedRun, words: str, given: Histories, trial: Histories) -> str:
    gains = []
    for channel, measured in seen.measured.items():
        before, after = (fit_percent(measured, one[seen.name][channel]) for one in (given, trial))
        gains.append((after - before, f"{channel} from {before:.0f} to {after:.0f} %"))
    return (
        f"The model follows run {seen.name} much better with {words} exchanged (fit of "
        f"{max(gains)[1]}); check which column is which wheel."
    )
