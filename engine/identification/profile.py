"""The profile likelihood of one parameter: how the cost rises when it is held elsewhere and all
others are fitted anew.

The rise D(p) = 2 (cost(p) - cost at the fit) is turned into a distance in standard errors,

    t(p)^2 = D(p) (s_0 / s)^2,

with s_0 the error by the cost's second derivative alone, s_0^2 = (J^T J)^-1 (with a loss, J as in
`Residuals.of_runs`: what keeps w above 0 for the search would not be that of D), and s that of
`uncertainty`, which knows how correlated the residuals are (Pace & Salvan, Principles of
Statistical Inference, 1997, 4.7: the scaled likelihood ratio of a wrong likelihood). The 95 %
interval is where t stays below the quantile. Where the fit is as good as linear it is that of the
fit; along a curved valley and next to a bound it is right where the other is not, and it stays
open towards a side on which t never gets there. Where another parameter reaches its bound on the
way, the cost rises by that bound and not by the runs alone, and the profile says so.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import ProblemError
from ..parameters import parameter
from ..simulation.simulate import rims_batch
from ..units import after_number, listed
from .batches import Simulate
from .problem import FreeParameter, Problem
from .residuals import Residuals
from .search import Found, Search
from .uncertainty import DIRECTION_TOLERANCE, information, uncertainty
from .variables import AT_BOUND

Array = NDArray[np.float64]

STRIDE = 0.5
"""Between two points, in standard errors; where the error is unknown or large ..."""

MOST_STRIDE = 0.25
"""... at most so much of the search's variable, where 1 is about 100 %; more where a side's points
would reach neither its bound nor the quantile."""

PAST = 1.1
"""Quantiles from the fit at which a side ends."""

TOO_FAR = 1.5
"""Quantiles from the fit beyond which a point is tried again at half the stride, as where another
parameter has met its bound on the way: the interval's end would be guessed between far points."""

HALVINGS = 8
"""On each side at most."""

POINTS = 16
"""On each side at most."""

EVALUATIONS = 40
"""For each point at most."""


@dataclass(frozen=True, slots=True)
class ProfilePoint:
    """The best fit with the parameter held at a value, SI.

    distance : t, negative below the fit's value
    others : the other parameters, by name
    """

    value: float
    distance: float
    cost: float
    others: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Profile:
    """How well the runs hold one parameter.

    points : by value, the fit's own among them
    quantile : of t, at which the 95 % interval ends
    confidence_interval : an end infinite where the runs leave that side open
    lower_at_bound, upper_at_bound : what is at a bound of the search where a side ends: the
        parameter itself, or others that go there with it
    sentences : which bounds end the sides, if any do
    """

    name: str
    points: tuple[ProfilePoint, ...]
    quantile: float
    confidence_interval: tuple[float, float]
    lower_at_bound: tuple[str, ...]
    upper_at_bound: tuple[str, ...]
    sentences: tuple[str, ...]
    simulations: int


def profile(
    problem: Problem,
    name: str,
    *,
    progress: Callable[[int], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
    simulate: Simulate = rims_batch,
) -> Profile:
    """The profile of a parameter around the solution at which the problem starts.

    name : or symbol, of a free parameter
    progress : called after every point with their number
    Raises ProblemError for a parameter that is not free, ParameterError for a name that is none,
    and Cancelled.
    """
    full = parameter(name).name
    require_free(problem, [full])
    held = [one.name for one in problem.free].index(full)
    residuals = Residuals(problem, simulate, cancelled)
    start = [one.variable(one.start) for one in problem.variables]
    best = Search(residuals).refine(np.clip(start, *residuals.starts_between), EVALUATIONS)
    said = information(residuals.of_runs(best.residuals, best.slopes))
    known = sum(residuals.of_priors(), start=said)
    errors = uncertainty(known)
    curvature = known.root.T @ known.root
    tour = _Tour(problem, held, best, curvature, float(errors.std_error[held]), residuals)
    told = progress or (lambda points: None)
    below = tour.points(-1.0, errors.quantile, told)
    above = tour.points(1.0, errors.quantile, told)
    points = [*reversed(below), tour.centre, *above]
    one = problem.free[held]
    lower, upper = (tour.at_bound(points[end]) for end in (0, -1))
    return Profile(
        name=full,
        points=tuple(points),
        quantile=errors.quantile,
        confidence_interval=(
            _end(one, [tour.centre, *below], errors.quantile, -math.inf),
            _end(one, [tour.centre, *above], errors.quantile, math.inf),
        ),
        lower_at_bound=lower,
        upper_at_bound=upper,
        sentences=(
            *_ended_by(full, "lower", lower, points[0]),
            *_ended_by(full, "upper", upper, points[-1]),
        ),
        simulations=tour.simulations,
    )


def require_free(problem: Problem, names: Iterable[str]) -> None:
    """Raise ProblemError for a parameter that a problem does not free."""
    free = [one.name for one in problem.free]
    for name in names:
        if name not in free:
            raise ProblemError(f"{name} was not free in this fit; free are {', '.join(free)}.")


class _Tour:
    """The way along one parameter, away from the best fit to either side."""

    def __init__(
        self,
        problem: Problem,
        held: int,
        best: Found,
        curvature: Array,
        error: float,
        residuals: Residuals,
    ):
        self._problem, self._held, self._best, self._all = problem, held, best, residuals
        self.simulations = residuals.simulations
        inverse = np.linalg.pinv(curvature, rcond=DIRECTION_TOLERANCE**2, hermitian=True)
        blind = math.sqrt(float(inverse[held, held]))
        known = math.isfinite(error) and error > 0.0
        self._ratio = blind / error if known else 1.0
        self._stride = min(STRIDE * error, MOST_STRIDE) if known else MOST_STRIDE
        others = np.delete(np.arange(len(best.x)), held)
        # Where the others go to when the parameter moves a little.
        self._slope = inverse[others, held] / inverse[held, held]
        self.centre = self._point(best.x[held], np.delete(best.x, held), best.cost, 0.0)

    def points(
        self, way: float, quantile: float, told: Callable[[int], None]
    ) -> list[ProfilePoint]:
        """Points to the side on which the parameter's value falls (-1) or rises (1)."""
        one = self._problem.free[self._held]
        at = float(self._best.x[self._held])
        others, slope = np.delete(self._best.x, self._held), self._slope
        rising = one.variable(one.upper) > one.variable(one.lower)
        ahead, stride, before = (way if rising else -way), self._stride, 0.0
        first, last = one.ends
        found: list[ProfilePoint] = []
        halvings = HALVINGS
        while len(found) < POINTS and first < at < last:
            further = min(max(at + ahead * stride, first), last)
            moved, cost = self._refitted(further, others + slope * (further - at))
            rise = max(2.0 * (cost - self._best.cost), 0.0)
            distance = way * math.sqrt(rise) * self._ratio
            if abs(distance) > TOO_FAR * quantile and halvings:
                halvings -= 1
                stride = 0.5 * abs(further - at)
                continue
            found.append(self._point(further, moved, cost, distance))
            told(len(found))
            slope = (moved - others) / (further - at)
            at, others = further, moved
            if abs(distance) > PAST * quantile:
                break
            left, rate = POINTS - len(found), abs(distance - before)
            if left and abs(distance) + left * rate < PAST * quantile:
                room = last - at if ahead > 0.0 else at - first
                stride = max(stride, room / left)
            before = distance
        return found

    def at_bound(self, end: ProfilePoint) -> tuple[str, ...]:
        """What is at a bound at a side's end: the parameter, and others that go there with it."""
        held = self._problem.free[self._held]
        found = [held.name] if held.at_bound(end.value) else []
        way = held.variable(end.value) - held.variable(self.centre.value)
        rest = [one for one in self._problem.free if one is not held]
        for one, slope in zip(rest, self._slope[: len(rest)].tolist(), strict=True):
            value, before = end.others[one.name], self.centre.others[one.name]
            first, last = one.ends
            outwards = slope * way * one.end_near(one.variable(value))
            driven = outwards > AT_BOUND * (last - first)
            if one.at_bound(value) and (driven or not one.at_bound(before)):
                found.append(one.name)
        return tuple(found)

    def _refitted(self, at: float, others: Array) -> tuple[Array, float]:
        """The others' best variables with the parameter held, and the cost."""
        problem, one = self._problem, self._problem.free[self._held]
        if not len(others):
            x = np.array([at])
            return others, self._all.cost(x, self._all.vector(x))
        residuals = self._all.of(
            replace(
                problem,
                vehicle=problem.vehicle.with_values({one.name: one.value(at)}),
                free=tuple(each for each in problem.free if each is not one),
                priors=tuple(each for each in problem.priors if each.name != one.name),
            )
        )
        start = np.clip(others, *residuals.starts_between)
        found = Search(residuals).refine(start, EVALUATIONS)
        self.simulations += residuals.simulations
        of_it = [each.residual(one, at) for each in problem.priors if each.name == one.name]
        return found.x, found.cost + 0.5 * sum(residual**2 for residual in of_it)

    def _point(self, at: float, others: Array, cost: float, distance: float) -> ProfilePoint:
        one = self._problem.free[self._held]
        rest = [each for each in self._problem.free if each is not one]
        of_car = others[: len(rest)]
        values = {each.name: each.value(float(x)) for each, x in zip(rest, of_car, strict=True)}
        return ProfilePoint(one.value(at), distance, cost, values)


def _ended_by(held: str, side: str, names: Sequence[str], end: ProfilePoint) -> list[str]:
    """What to say of a side that ends with some parameters at their bounds: with the parameter
    itself there, others have not ended it."""
    if held in names:
        return [f"The {side} side ends at the search's bound, {_told(held, end.value)}."]
    if not names:
        return []
    is_at, it = ("is at its bound", "it") if len(names) == 1 else ("are at their bounds", "them")
    others = listed([_told(name, end.others[name]) for name in names])
    return [
        f"On the {side} side {others} {is_at}, and not the runs alone end the profile; widen the "
        f"search, or fix {it} at what is known."
    ]


def _told(name: str, value: float) -> str:
    return f"{name} of {value:.4g}{after_number(parameter(name).unit)}"


def _end(
    one: FreeParameter, points: Sequence[ProfilePoint], quantile: float, otherwise: float
) -> float:
    """The value at which t reaches the quantile, between the points, from the fit outwards."""
    for near, far in pairwise(points):
        if abs(far.distance) >= quantile:
            share = (quantile - abs(near.distance)) / (abs(far.distance) - abs(near.distance))
            begin, end = one.variable(near.value), one.variable(far.value)
            return one.value(begin + share * (end - begin))
    return otherwise
