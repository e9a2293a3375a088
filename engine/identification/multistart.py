"""Many starts: which minima the cost has, and which of them is the lowest.

Starts are a scrambled Sobol sequence (Owen 1998; scipy.stats.qmc) between the bounds, in the
optimiser's variables: a stiffness is as likely between 0.1 and 0.2 of a bound's range in logarithm
as between 0.8 and 0.9. All of them are simulated once, in one batch; the start that was told and
the best of the others are refined. A refinement is cut short once the quadratic about a minimum
already found promises its cost and its Newton step (`search.Found.holds`); it is counted there,
and so told.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from .ended_search import EndedSearch
from .fit import Ending, Stage
from .search import Found, Search

Array = NDArray[np.float64]

REFINED = 8
"""Searches run to their end, that from the told start among them."""

SEARCH_OF_START = 1.75
"""Single fits that the search from another start is worth, most of it on the way to a basin, ..."""

SIMULATIONS = 250
"""... and simulations of a single fit (docs/identification.md, Many starts)."""


def fits_of(starts: int) -> float:
    """How many single fits so many starts are worth: one simulation each, and their searches."""
    others = starts - 1
    return 1.0 + SEARCH_OF_START * min(others, REFINED - 1) + others / SIMULATIONS


def spread(lower: Array, upper: Array, count: int, seed: int) -> list[Array]:
    """`count` points between the bounds, of a Sobol sequence scrambled by `seed`."""
    if count < 1:
        return []
    sequence = qmc.Sobol(len(lower), scramble=True, rng=seed)
    # The balance of the sequence is that of a power of two; of one, its first points are taken.
    shares = sequence.random_base2(int(np.ceil(np.log2(count))))[:count]
    return [lower + (upper - lower) * share for share in shares]


def refined_starts(
    search: Search,
    start: Array,
    others: list[Array],
    most_evaluations: int,
    ended: Mapping[int, EndedSearch],
    keep: Callable[[int, EndedSearch], object],
) -> list[list[Found]]:
    """Distinct minima, the lowest first, each with all refinements that ended there, its own first.

    start : refined first and in any case;  others : points, of which the best are refined
    ended : searches by number that need not be made again;  keep : told of each that was made
    """
    costs = search.screened(start, others, min(1 + len(others), REFINED))
    best = [k for k in np.argsort(costs, kind="stable")[: REFINED - 1] if np.isfinite(costs[k])]
    trials = [start, *(others[k] for k in best)]
    minima: list[list[Found]] = []
    searched: list[Found] = []
    for k, trial in enumerate(trials):
        search.stage, search.turn = Stage.SEARCHING, (k + 1, len(trials))
        if (before := ended.get(k)) is not None:
            found = search.again(before, None if before.basin is None else searched[before.basin])
        else:
            known = [of[0] for of in minima if of[0].ending == Ending.CONVERGED]
            simulations, evaluations = search.simulations, search.evaluations
            found = (
                search.explore(trial, most_evaluations, known)
                if k
                else search.refine(trial, most_evaluations)
            )
            basin = (j for j, one in enumerate(searched) if one is found.minimum)
            keep(
                k,
                EndedSearch(
                    tuple(found.x.tolist()),
                    found.ending,
                    next(basin, None),
                    search.simulations - simulations,
                    tuple(search.cost_history[evaluations:]),
                ),
            )
        searched.append(found)
        place = next((of for of in minima if _ended_in(of, found)), None)
        if place is None:
            minima.append([found])
        elif found.ending == Ending.CONVERGED and found.cost < place[0].cost:
            place.insert(0, found)
        else:
            place.append(found)
    return sorted(minima, key=lambda of: of[0].cost)


def _ended_in(minimum: list[Found], found: Found) -> bool:
    """Whether a refinement ended in a minimum, given as all that ended there before."""
    if found.minimum is not None:
        return any(one is found.minimum for one in minimum)
    return minimum[0].is_same_minimum(found)
