"""Noise that is found: from the residuals of a fit, which is then refined with it.

Noise only weighs the channels against each other, so that two rounds are enough: a weight that is
off by a tenth costs an estimate less than a hundredth of its precision.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..run_notes import DEFAULT_NOISE
from .compared_runs import SENSORS_BEST
from .fit import Stage
from .residuals import FAILED_TRIAL, Residuals
from .search import Found, Search

Array = NDArray[np.float64]

NOISE_ROUNDS = 2
"""Fits at most with noise from the residuals of the fit before, unless ..."""

SAME_NOISE = 0.01
"""... none of it changes by more than this share."""

MEDIAN_OF_NORMAL = 0.6745
"""Median of |e| over the standard deviation of a normal e."""


def with_found_noise(
    search: Search, reached: list[list[Found]], most_evaluations: int
) -> list[list[Found]]:
    """The minima, refined with the noise that is to be found from their lowest's residuals; what
    is one minimum with it, is one of them.
    """
    for _ in range(NOISE_ROUNDS):
        noise = _found_noise(search.residuals, reached[0][0].residuals)
        known = {seen.name: seen.noise for seen in search.residuals.problem.runs}
        if all(
            abs(one - known[run][channel]) <= SAME_NOISE * one
            for (run, channel), one in noise.items()
        ):
            break
        search.weigh(search.residuals.of(search.residuals.problem.with_noise(noise)))
        refined = []
        for k, of in enumerate(reached, start=1):
            search.stage, search.turn = Stage.REWEIGHING, (k, len(reached))
            found = search.refine(of[0].x, most_evaluations)
            refined.append([replace(found, told=of[0].told), *of[1:]])
        reached = _regrouped(refined)
    return reached


def _regrouped(reached: list[list[Found]]) -> list[list[Found]]:
    """Distinct minima, the lowest first, each with all that ended there."""
    minima: list[list[Found]] = []
    for ended in sorted(reached, key=lambda of: of[0].cost):
        same = next((of for of in minima if of[0].is_same_minimum(ended[0])), None)
        if same is None:
            minima.append(ended)
        else:
            same += ended
    return minima


def _found_noise(residuals: Residuals, r: Array) -> dict[tuple[str, str], float]:
    """By run and channel, standard deviation of the residuals where the noise is to be found; by
    their median where a loss expects outliers.
    """
    problem, found = residuals.problem, {}
    if np.any(r == FAILED_TRIAL):
        return {}
    for block in residuals.blocks():
        if problem.sensors.fits_noise(block.channel):
            left = np.abs(r[block.place])
            size = (
                float(np.sqrt(np.mean(left**2)))
                if problem.loss.name == "linear"
                else float(np.median(left)) / MEDIAN_OF_NORMAL
            )
            gain = abs(problem.sensors.reading(block.channel).gain)
            least = SENSORS_BEST * DEFAULT_NOISE[block.channel] * gain
            found[block.run, block.channel] = max(size * block.noise, least)
    return found
