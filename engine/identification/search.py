"""The search for a minimum: scipy's trust-region reflective least squares between bounds.

The optimiser is handed condensed residuals; what it asks for is kept with the result, so that
nothing is simulated twice. A loss works on single samples and cannot be left to the optimiser: the
residuals are reweighted before they are condensed (`loss`), and the cost, which their squares do
not add up to, is handed over in a row of its own.

One `Search` may refine several starts. One that falls into a minimum already found is cut short, if
the caller asks for that.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from .condensed import condensed_jacobian, condensed_residuals
from .ended_search import EndedSearch
from .fit import Ending, Progress, Stage
from .residuals import FAILED_TRIAL, Residuals
from .uncertainty import DIRECTION_TOLERANCE

Array = NDArray[np.float64]

COST_TOLERANCE = 1e-8
STEP_TOLERANCE = 1e-8
GRADIENT_TOLERANCE = 1e-8

QUADRATIC = 0.3
"""Share by which cost and Newton step at a point may miss what the quadratic about a minimum
promises there, for the point to lie in the basin of that minimum."""

SAME_POINT = 0.1
"""Standard errors within which two points are the same minimum."""

SAME_COST = 1e-4
"""Relative difference of cost up to which two minima may be one (as may those whose costs differ
by less than a move of SAME_POINT does at the stated noise), and ..."""

SAME_VALUES = 1e-3
"""... difference in every one of the optimiser's variables, where SAME_POINT does not say so
already."""


RELEASED = 1.0
"""Of the search's variables, where 1 is about 100 %: how much further a bound is thought to be."""


@dataclass(frozen=True, slots=True)
class Found:
    """Where one refinement ended.

    cost : as `Residuals.cost`
    residuals, slopes : (samples,) r and (samples, n) dr/dx there
    rows, jacobian : of the condensed, reweighted problem, (n + 1,) and (n + 1, n)
    told : whether it began from the problem's start values
    minimum : in whose basin it was cut short
    """

    x: Array
    cost: float
    residuals: Array
    slopes: Array
    rows: Array
    jacobian: Array
    ending: Ending
    told: bool
    minimum: "Found | None" = None

    @property
    def curvature(self) -> Array:
        """(n, n) the cost's second derivative as Gauss and Newton have it."""
        return self.jacobian.T @ self.jacobian

    def variance(self) -> float:
        """Mean square of the residuals over their degrees of freedom."""
        samples, n = self.slopes.shape
        return 2.0 * self.cost / max(samples - n, 1)

    def distance(self, x: Array) -> float:
        """How far x is from here, in standard errors: |J (x - x_0)| over the residuals' rms."""
        away = x - self.x
        rise = float(away @ self.curvature @ away)
        return float(np.sqrt(max(rise, 0.0) / max(self.variance(), np.finfo(float).tiny)))

    def is_same_minimum(self, other: "Found") -> bool:
        """Whether another refinement ended in the same minimum."""
        apart = abs(self.cost - other.cost)
        if apart > max(SAME_COST * min(self.cost, other.cost), 0.5 * SAME_POINT**2):
            return False
        near = float(np.max(np.abs(self.x - other.x))) <= SAME_VALUES
        return near or max(self.distance(other.x), other.distance(self.x)) <= SAME_POINT

    def beyond(self) -> Array:
        """Where the search would go on to were there no bounds."""
        return self.x + self._step(np.ones(len(self.x), dtype=bool))

    def released(self, sides: NDArray[np.int64]) -> dict[int, Array]:
        """How far all would go, (n,), were one bound RELEASED further away, by that one's place.

        sides : (n,) -1 or 1 where a variable is at the lower or the upper end of its range, else 0
        Those that the search would leave if there were no bounds at all are left out.
        """
        free, found = sides == 0, {}
        onwards = sides * (self.beyond() - self.x) > 0.0
        for k in np.flatnonzero(onwards).tolist():
            step = self._step(free | (np.arange(len(sides)) == k))
            if sides[k] * step[k] > 0.0:
                found[k] = step * min(1.0, RELEASED / abs(step[k]))
        return found

    def _step(self, free: NDArray[np.bool_]) -> Array:
        return gauss_newton(self.jacobian, self.rows, free)

    def holds(self, x: Array, cost: float, gradient: Array) -> bool:
        """Whether x lies where the quadratic about this minimum is the cost: its basin.

        The cost must rise from here to x as promised, and the Newton step from x, by the curvature
        here, lead back here; both within QUADRATIC, or a tenth of a standard error.
        """
        away = x - self.x
        rise = 0.5 * float(away @ self.curvature @ away)
        some = SAME_POINT**2 * max(self.variance(), np.finfo(float).tiny)
        if abs(cost - self.cost - rise) > max(QUADRATIC * rise, some):
            return False
        missed = away - np.linalg.pinv(self.curvature, hermitian=True) @ gradient
        return float(missed @ self.curvature @ missed) <= max(2.0 * QUADRATIC**2 * rise, some)


def gauss_newton(jacobian: Array, rows: Array, free: NDArray[np.bool_]) -> Array:
    """The step (n,) of some variables towards the least squares of rows; the others stay."""
    step = np.zeros(jacobian.shape[1])
    step[free] = -np.linalg.lstsq(jacobian[:, free], rows, rcond=DIRECTION_TOLERANCE)[0]
    return step


def _cost_alone(z: Array) -> Array:
    """scipy's form of a loss, (3, rows): the last row of squares z is the cost, the others none."""
    rho = np.zeros((3, len(z)))
    rho[0, -1] = z[-1]
    rho[1] = 1.0
    return rho


class _SameBasin(Exception):
    """Ends a refinement; carries the minimum in whose basin it is."""

    def __init__(self, minimum: Found):
        self.minimum = minimum


class Search:
    """Refinements of one problem, keeping the best point of all and telling of progress."""

    def __init__(self, residuals: Residuals, progress: Callable[[Progress], None] | None = None):
        self.residuals = residuals
        self.evaluations = 0
        self.cost_history: list[float] = []
        self.stage = Stage.SEARCHING
        self.turn: tuple[int, int] = (1, 1)
        self._progress = progress
        self._simulations_before = 0
        self._best_cost = np.inf
        self._quick = False
        self._minima: Sequence[Found] = ()

    @property
    def simulations(self) -> int:
        """Behind all refinements."""
        return self._simulations_before + self.residuals.simulations

    def screened(self, start: Array, others: Sequence[Array], searches: int) -> Array:
        """The cost at other starts than the told one, of which the best will be searched from.

        searches : that are to come, at most
        """
        if not others:
            return np.zeros(0)
        self.stage, self.turn = Stage.SCREENING, (0, searches)
        r = self.residuals.vector(start)
        self._tell(start, r, self.residuals.cost(start, r))
        return self.residuals.costs(others)

    def weigh(self, residuals: Residuals) -> None:
        """Go on with other residuals of the same variables, whose costs do not compare."""
        self._simulations_before = self.simulations
        self.residuals, self._best_cost = residuals, np.inf

    def explore(self, x: Array, most_evaluations: int, minima: Sequence[Found]) -> Found:
        """Search from x with quick derivatives; cut short in the basin of one of `minima`, else
        refined.
        """
        self._quick, self._minima = True, minima
        try:
            found = self._run(x, most_evaluations)
        finally:
            self._quick, self._minima = False, ()
        return self.refine(found.x, most_evaluations) if found.minimum is None else found

    def refine(self, x: Array, most_evaluations: int) -> Found:
        """Search from x."""
        return self._run(x, most_evaluations)

    def again(self, ended: EndedSearch, minimum: Found | None) -> Found:
        """What a search found that has ended before, out of what is kept of it.

        minimum : in whose basin it was cut short
        """
        x, spent = np.array(ended.x), self.residuals.simulations
        quick = ended.ending == Ending.SAME_BASIN
        self._slopes = self.residuals.quick(x)[1] if quick else self.residuals.jacobian(x)
        found = self._found(x, ended.ending, minimum)
        self._simulations_before += ended.simulations - (self.residuals.simulations - spent)
        self.evaluations += len(ended.cost_history)
        self.cost_history += ended.cost_history
        if ended.cost_history[-1] < self._best_cost:
            self._best, self._best_cost = (x, found.residuals), ended.cost_history[-1]
        self._tell(*self._best, self._best_cost)
        return found

    def _run(self, x: Array, most_evaluations: int) -> Found:
        self._began, self._failures = self.evaluations, 0
        self._slopes = np.zeros((0, len(x)))
        try:
            solution = least_squares(
                self._vector,
                x,
                cast(Any, self._jacobian),  # scipy's hints know no callable here
                bounds=(self.residuals.lower, self.residuals.upper),
                method="trf",
                loss=cast(Any, _cost_alone),
                ftol=COST_TOLERANCE,
                xtol=STEP_TOLERANCE,
                gtol=GRADIENT_TOLERANCE,
                max_nfev=most_evaluations,
            )
        except _SameBasin as same:
            return self._found(self._at, Ending.SAME_BASIN, same.minimum)
        if solution.status <= 0:
            return self._found(solution.x, Ending.BUDGET_SPENT)
        stuck = self._failures > 0.5 * (self.evaluations - self._began)
        return self._found(solution.x, Ending.STUCK if stuck else Ending.CONVERGED)

    def _found(self, x: Array, ending: Ending, minimum: Found | None = None) -> Found:
        r = self.residuals.vector(x)
        rows, root = self.residuals.reweighted(x, r)
        slopes = self.residuals.reweighted_slopes(self._slopes, root)
        return Found(
            x=x.copy(),
            cost=self.residuals.cost(x, r),
            residuals=r,
            slopes=self._slopes,
            rows=condensed_residuals(rows, len(x)),
            jacobian=condensed_jacobian(rows, slopes),
            ending=ending,
            told=self.turn[0] == 1,
            minimum=minimum,
        )

    def _vector(self, x: Array) -> Array:
        """The reweighted residuals, condensed, and the cost's root; one evaluation."""
        r = self.residuals.quick(x)[0] if self._quick else self.residuals.vector(x)
        cost = self.residuals.cost(x, r)
        self.evaluations += 1
        self._failures += bool(np.any(r == FAILED_TRIAL))
        if cost < self._best_cost:
            self._best, self._best_cost = (x.copy(), r), cost
        self.cost_history.append(self._best_cost)
        self._tell(*self._best, self._best_cost)
        rows, _ = self.residuals.reweighted(x, r)
        return np.append(condensed_residuals(rows, len(x)), np.sqrt(2.0 * cost))

    def _jacobian(self, x: Array) -> Array:
        """Their derivative; the cost's row has none."""
        known = self.residuals
        self._at = x.copy()
        self._slopes = known.quick(x)[1] if self._quick else known.jacobian(x)
        r = known.vector(x)
        rows, root = known.reweighted(x, r)
        slopes = known.reweighted_slopes(self._slopes, root)
        gradient, cost = slopes.T @ rows, known.cost(x, r)
        for minimum in self._minima:
            if minimum.holds(x, cost, gradient):
                raise _SameBasin(minimum)
        return np.vstack([condensed_jacobian(rows, slopes), np.zeros(len(x))])

    def _tell(self, x: Array, r: Array, cost: float) -> None:
        """Tell of x as the best so far."""
        if self._progress is None:
            return
        problem = self.residuals.problem
        values = problem.values(x).tolist()
        self._progress(
            Progress(
                evaluations=self.evaluations,
                simulations=self.simulations,
                cost=cost,
                parameters={one.name: v for one, v in zip(problem.free, values, strict=True)},
                fit_percent=self.residuals.percents(r),
                stage=self.stage,
                search=self.turn[0],
                searches=self.turn[1],
            )
        )
