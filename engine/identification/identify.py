"""Identification: the free parameters that make the model follow the measured runs.

Least squares on (model - measured) / noise over every compared channel of every run, by the
trust-region reflective method of scipy (`least_squares`, trf) on scaled parameters between bounds;
`residuals` has the scaling and the derivatives, `uncertainty` the errors. What is asked of the
sensors is found with the parameters; `errors`, the verdict and all that follows from them are of
the car's parameters, whatever the sensors are (`Uncertainty.marginal`). docs/identification.md
tells what the paper's campaign can and cannot determine.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc  # its own name would lock out another thread that imports scipy.stats

from ..channels import WHEEL_CHANNELS
from ..errors import ProblemError
from ..simulation.initial_state import swings_in
from ..simulation.simulate import rims_batch
from .batches import Simulate
from .cars import mixed_plants
from .compared_runs import ComparedRun
from .ended_search import EndedSearch
from .estimates import estimates
from .fit import (
    CONVERGED,
    Ending,
    Estimate,
    Fit,
    FittedRun,
    Minimum,
    Outcome,
    ParameterEstimate,
    Progress,
    SensorEstimate,
)
from .fit_findings import (
    Histories,
    bound_findings,
    fault_sentences,
    faults_of_channels,
    hardly_moving,
    minima_findings,
    outlier_findings,
    poor_fits,
    undetermined_findings,
    well_driven,
)
from .linear_dampers import freed_ratios
from .multistart import refined_starts, spread
from .noise_rounds import with_found_noise
from .offers import offers
from .prior_checks import disagreements, prior_checks
from .problem import FreeParameter, Problem
from .residuals import FAILED_TRIAL, Residuals
from .search import Found, Search
from .search_settings import MOST_STARTS
from .uncertainty import information, uncertainty
from .verdict import verdict, without_verdict
from .whiteness import far_from_white, whiteness, whiteness_findings

__all__ = ["Fit", "FreeParameter", "Outcome", "Problem", "Progress", "identify"]

Array = NDArray[np.float64]

MOST_EVALUATIONS = 100
EVALUATIONS_ON_A_FAULT = 40
"""Trial points spent when a channel probably has the wrong sign or unit: enough should it turn out
to be right, no more because a fit to the wrong one means nothing."""


SCATTERED_STARTS = 32
"""Cars tried around start values that do not carry the car through the runs; if all fail, as many
between the bounds."""

MUCH_BETTER = 0.5
"""Such a car is taken when the runs' cost of it is below this share of the start's."""


def identify(
    problem: Problem,
    *,
    progress: Callable[[Progress], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
    most_evaluations: int = MOST_EVALUATIONS,
    starts: int = 1,
    seed: int = 0,
    ended: Mapping[int, EndedSearch] | None = None,
    keep: Callable[[int, EndedSearch], object] = lambda number, search: None,
    simulate: Simulate = rims_batch,
) -> Fit:
    """Fit the problem's free parameters.

    progress : called after every evaluation
    cancelled : polled throughout; Cancelled is raised within 0.2 s of its being true
    most_evaluations : trial points before a search gives up
    starts : points to try as starts, the told one and others spread over the bounds by `seed`
    ended, keep : searches by number that the same fit made before it was broken off, and what is
        told of each that ends: a fit that goes on gives what an undisturbed one gives
    simulate : the model, as a function of cars, inputs and traction

    A poor, undetermined or unfinished fit is a result and says so in its outcome and warnings.
    Raises ProblemError when the model cannot follow the runs from the start values, and Cancelled.
    """
    if not 1 <= starts <= MOST_STARTS:
        raise ProblemError(f"starts is {starts}; give a number from 1 to {MOST_STARTS}.")
    began = time.perf_counter()
    residuals = Residuals(problem, simulate, cancelled)
    lower, upper = residuals.starts_between
    x_start = np.clip([one.variable(one.start) for one in problem.variables], lower, upper)
    x_start, moved = _usable_start(residuals, x_start)
    start = residuals.model(x_start)

    search = Search(residuals, progress)
    doubted = _in_doubt(residuals, x_start)
    if doubted:  # where other starts would mean nothing either
        most_evaluations, starts = min(most_evaluations, EVALUATIONS_ON_A_FAULT), 1
    others = spread(problem.of_car(lower), problem.of_car(upper), starts - 1, seed)
    of_sensors = x_start[len(problem.free) :]
    others = [np.concatenate([of_car, of_sensors]) for of_car in others]
    reached = refined_starts(search, x_start, others, most_evaluations, ended or {}, keep)
    if not doubted:
        reached = with_found_noise(search, reached, most_evaluations)
    told, residuals = problem.runs, search.residuals
    problem, solution = residuals.problem, reached[0][0]
    r = solution.residuals
    left = residuals.of_runs(r, solution.slopes)
    said = information(left)
    tests = tuple(
        test
        for seen, run in zip(problem.runs, left, strict=True)
        for test in whiteness(seen.name, list(seen.measured), run, problem.settings)
    )
    of_all = uncertainty(sum(residuals.of_priors(), start=said))
    errors = of_all.marginal(len(problem.free))
    priors = prior_checks(residuals, solution, said)
    parameters, sensors = estimates(problem, solution.x, of_all, beyond=solution.beyond())
    fitted = residuals.model(solution.x)
    of_channels = faults_of_channels(problem.runs, start, fitted)
    faults = fault_sentences(problem.runs, of_channels)
    outcome = Outcome.DOUBTFUL if faults else _outcome(solution, parameters, sensors, residuals)
    converged = outcome in CONVERGED
    runs = tuple(_fitted_run(seen, residuals, r) for seen in problem.runs)
    minima = tuple(_minimum(ended, residuals) for ended in reached)
    if not converged:
        parameters = tuple(replace(one, determined="no") for one in parameters)
        sensors = tuple(replace(one, determined="no") for one in sensors)
    vehicle = problem.vehicle_at(solution.x)
    judged = without_verdict(parameters)
    if converged:
        released = _released(solution, [*parameters, *sensors], problem)
        if far_from_white(tests):
            at_bound = np.array([one.at_bound for one in (*parameters, *sensors)])
            released |= freed_ratios(residuals, solution, at_bound)
        judged = verdict(parameters, errors, vehicle, released)
    warnings = [
        *(warning for seen in problem.runs for warning in seen.warnings),
        *mixed_plants({seen.name: seen.plant for seen in problem.runs}),
        *moved,
        *faults,
    ]
    if not faults:  # what else a wrong channel has bent is no news
        warnings += [
            *poor_fits(told, fitted),  # noise out of residuals explains any misfit
            *_swings(problem, fitted),
            *hardly_moving(told),
            *minima_findings(minima),
            *outlier_findings(problem, runs),
            *disagreements(priors, problem.free),
            *whiteness_findings(tests, [one.name for one in problem.free]),
            *bound_findings([*parameters, *sensors], judged),
        ]
    if converged:
        warnings += undetermined_findings([*parameters, *sensors], of_all, judged.combinations)
    return Fit(
        verdict=judged,
        vehicle=vehicle,
        parameters=parameters,
        sensors=sensors,
        fixed_sensors=problem.sensors.fixed,
        cost=float(solution.cost),
        errors=errors,
        fit_percent=residuals.percents(r),
        residuals=_histories(residuals, r),
        outcome=outcome,
        converged=converged,
        warnings=tuple(dict.fromkeys(warnings)),
        faults=faults,
        offers=offers(problem, well_driven(problem.runs), of_channels),
        seconds=time.perf_counter() - began,
        simulations=search.simulations,
        evaluations=search.evaluations,
        cost_history=tuple(search.cost_history),
        traction=problem.traction,
        settings=problem.settings,
        runs=runs,
        starts=starts,
        minima=minima,
        loss=problem.loss,
        priors=priors,
        whiteness=tests,
    )


def _usable_start(residuals: Residuals, x: Array) -> tuple[Array, list[str]]:
    """Where the search begins, and a sentence when that is not where it was told to.

    Start values from which the model fails, or is further from the runs than their mean, can
    lie where the car falls over into another equilibrium, from which no small step leads out.
    Unless a channel that is probably wrong is the reason, a Halton sequence of cars around them is
    tried and the best taken, if it is much better; if all of them fail, one between the bounds.
    Raises ProblemError when the model fails on every one.
    """
    r = residuals.vector(x)
    failed = bool(np.any(r == FAILED_TRIAL))
    cost = residuals.cost_of_runs(r)
    if cost <= residuals.scatter():
        return x, []
    if not failed and _in_doubt(residuals, x):
        return x, []
    reach = np.where([one.logarithmic for one in residuals.problem.variables], 1.0, 2.0)
    # The sequence begins at the lower bounds.
    spread = qmc.Halton(len(x), scramble=False).fast_forward(1).random(SCATTERED_STARTS)
    near = np.maximum(residuals.lower, x - reach), np.minimum(residuals.upper, x + reach)
    of_sensors = np.arange(len(x)) >= len(residuals.problem.free)
    for where, ends in (
        ("near them", near),
        ("between the bounds", (residuals.lower, residuals.upper)),
    ):
        lower, upper = (np.where(of_sensors, x, end) for end in ends)
        trials = [lower + (upper - lower) * share for share in spread]
        costs = residuals.costs_of_runs(trials)
        best = int(np.argmin(costs))
        if costs[best] < MUCH_BETTER * cost:
            return trials[best], [
                "The start values do not carry the car through the runs, so the fit began from "
                f"others {where}; check the start values."
            ]
        if not failed:
            return x, []
    raise ProblemError(_failure(residuals.problem))


def _swings(problem: Problem, fitted: Histories) -> list[str]:
    """Sentences on runs that start away from the equilibrium in which the model starts."""
    if problem.settings.initial_state == "measured":
        return []
    return [
        sentence
        for seen in problem.runs
        if not seen.inputs.stands
        for sentence in swings_in(seen.name, seen.inputs.time, seen.measured, fitted[seen.name])
    ]


def _in_doubt(residuals: Residuals, x: Array) -> bool:
    """Whether a channel is probably wrong, as the car at x sees it."""
    runs = residuals.problem.runs
    return bool(fault_sentences(runs, faults_of_channels(runs, residuals.model(x))))


def _failure(problem: Problem) -> str:
    """Why the model may fail on the runs wherever the fit could start."""
    furthest = {
        f"{channel} of run {seen.name}": np.max(np.abs(seen.inputs.stage_inputs[:, 0, corner]))
        for seen in problem.runs
        for corner, channel in enumerate(WHEEL_CHANNELS)
    }
    place = max(furthest, key=lambda name: furthest[name])
    return (
        f"The model fails at the start values and wherever else it was tried ({place} reaches "
        f"{1e3 * furthest[place]:.0f} mm); check the units of the runs, the car's known data and "
        "the start values."
    )


def _fitted_run(seen: ComparedRun, residuals: Residuals, r: Array) -> FittedRun:
    """What was compared in a run, as data."""
    loss = residuals.problem.loss
    discounted = {
        block.channel: int(np.sum(np.abs(r[block.place]) > loss.scale))
        for block in residuals.blocks()
        if block.run == seen.name and loss.name != "linear"
    }
    return FittedRun(
        name=seen.name,
        samples=len(seen.inputs.time),
        noise=dict(seen.noise),
        noise_source=dict(seen.noise_source),
        discounted=discounted,
        braking=seen.inputs.braking,
        conditioning=seen.inputs.conditioning,
    )


def _minimum(ended: list[Found], residuals: Residuals) -> Minimum:
    """A minimum as data, from the searches that ended in it, the lowest first."""
    lowest, problem = ended[0], residuals.problem
    values = problem.values(lowest.x).tolist()
    return Minimum(
        cost=lowest.cost,
        parameters={one.name: value for one, value in zip(problem.free, values, strict=True)},
        fit_percent=residuals.percents(lowest.residuals),
        starts=len(ended),
        cut_short=sum(one.ending == Ending.SAME_BASIN for one in ended),
        from_start=any(one.told for one in ended),
        at_bound=tuple(
            one.name for one, value in zip(problem.free, values, strict=True) if one.at_bound(value)
        ),
        outcome=lowest.ending,
    )


def _released(found: Found, estimates: Sequence[Estimate], problem: Problem) -> dict[str, Array]:
    """How far the parameters' variables (n,) would go were one bound further away, by the title of
    what is at it."""
    sides = np.zeros(len(estimates), dtype=np.int64)
    for k, (one, free) in enumerate(zip(estimates, problem.variables, strict=True)):
        if one.at_bound:
            sides[k] = free.end_near(found.x[k])
    steps = found.released(sides)
    return {estimates[k].title: step[: len(problem.free)] for k, step in steps.items()}


def _outcome(
    found: Found,
    parameters: tuple[ParameterEstimate, ...],
    sensors: tuple[SensorEstimate, ...],
    residuals: Residuals,
) -> Outcome:
    """The sentence for how the fit ended."""
    if found.ending == Ending.BUDGET_SPENT:
        return Outcome.BUDGET_SPENT
    if found.ending == Ending.STUCK:
        return Outcome.STUCK
    if residuals.cost_of_runs(found.residuals) > residuals.scatter():
        return Outcome.ASTRAY
    if any(one.at_bound for one in (*parameters, *sensors)):
        return Outcome.AT_BOUND
    verdicts = {one.determined for one in parameters}
    if "no" in verdicts:
        return Outcome.UNDETERMINED
    return Outcome.WEAKLY if "weakly" in verdicts else Outcome.DETERMINED


def _histories(residuals: Residuals, r: Array) -> dict[str, dict[str, Array]]:
    """Model minus measured by run and channel, SI."""
    histories: dict[str, dict[str, Array]] = {}
    for block in residuals.blocks():
        histories.setdefault(block.run, {})[block.channel] = block.noise * r[block.place]
    return histories
