"""`ridetune identify`: from recordings to the car's parameters with their error bars."""

import json
import math
import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence

from ...engine.channels import OUTPUT_CHANNELS
from ...engine.identification.fit import Fit, Progress, Stage
from ...engine.identification.fit_file import fit_to_json, profile_to_json
from ...engine.identification.identify import identify as fit_to_runs
from ...engine.identification.problem import Problem
from ...engine.identification.profile import Profile, profile, require_free
from ...engine.parameters import DAMPER_NAMES, PARAMETER_NAMES, parameter
from ...engine.run import Run
from ...engine.vehicle import Vehicle
from ..work.time_left import SearchClock
from .arguments import bounds, loss, priors, rims_settings, sensors, whole
from .arguments import starts as start_values
from .inputs import (
    find_mappings,
    find_vehicle,
    held_bounds,
    mapping_files,
    read_noise,
    read_runs,
    recording_files,
)
from .output import (
    print_fit_percent,
    print_table,
    print_warnings,
    require_place,
    significant,
    write_file,
)
from .watch import hours


def identify(options: Namespace) -> None:
    """Fit the free parameters to all runs at once, print the report, write the fit."""
    read = (*mapping_files(options.mapping), *recording_files(options.runs))
    require_place(options.output, (options.vehicle, options.noise, *read))
    noise = read_noise(options.noise)
    vehicle = find_vehicle(options.vehicle)
    under = find_mappings(options.mapping, options.runs)
    runs = read_runs(options.runs, options.braking or (), under, noise=noise)
    problem = asked(options, vehicle, runs, noise)
    profiled = [parameter(name).name for name in options.profile or ()]
    require_free(problem, profiled)
    fit = fitted(options, problem)
    print_fit(fit)
    found = fit_to_json(fit)
    solved = problem.as_fitted(found)
    profiles = [profile(solved, name) for name in profiled]
    _print_profiles(profiles)
    if options.output:
        told = {**found, "profiles": [profile_to_json(one) for one in profiles]}
        write_file(options.output, json.dumps(told, indent=2) + "\n")


def asked(
    options: Namespace, vehicle: Vehicle, runs: Sequence[Run], noise: Mapping[str, float]
) -> Problem:
    """What the options ask to be fitted to some runs.

    noise : that --noise gives, of channels that are compared and others
    """
    free, start = _free(options), start_values(options.start)
    found = [parameter(name).name for name in free or PARAMETER_NAMES]
    fixed = [parameter(name).name for name in options.fixed or ()]
    held = {
        name: ends
        for name, ends in held_bounds(options.vehicle).items()
        if name in found and name not in fixed and name not in start
    }
    return Problem.build(
        vehicle,
        runs,
        free,
        options.fixed or None,
        bounds=held | bounds(options.bounds),
        start=start,
        noise={name: one for name, one in noise.items() if name in OUTPUT_CHANNELS},
        traction=options.traction or "exact",
        settings=rims_settings(options),
        loss=loss(options),
        priors=priors(options.prior),
        sensors=sensors(options),
        fit_noise=options.fit_noise,
    )


def fitted(options: Namespace, problem: Problem) -> Fit:
    """The fit, with its progress on a terminal."""
    watched = sys.stderr.isatty()
    starts = whole(options.starts or "1", f"--starts {options.starts}", "how many starts")
    clock = SearchClock(noise_follows=problem.sensors.finds_noise)
    fit = fit_to_runs(
        problem,
        progress=(lambda now: _show(progress_line(now, starts, clock.left(now))))
        if watched
        else None,
        starts=starts,
        seed=options.seed or 0,
    )
    if watched:
        print("\r\033[K", end="", file=sys.stderr)
    return fit


def _free(options: Namespace) -> list[str] | None:
    """The parameters to find, or None for the twelve."""
    if options.damper != "two-slope":
        return options.free or None
    fixed = {parameter(name).name for name in options.fixed or ()}
    usual = [*(options.free or PARAMETER_NAMES), *DAMPER_NAMES]
    return [name for name in usual if name in (options.free or ()) or name not in fixed]


def progress_line(now: Progress, starts: int, seconds_left: float | None) -> str:
    """How far a fit is, in one line."""
    line = f"{now.simulations} simulations, cost {now.cost:.6g}"
    if now.stage == Stage.SCREENING:
        return f"{line}, screening {starts} starts"
    if now.stage == Stage.REWEIGHING:
        line += ", with the noise found"
    if now.searches > 1:
        line += f", search {now.search} of {now.searches}"
    return line if seconds_left is None else f"{line}, about {hours(seconds_left)} left"


def _show(line: str) -> None:
    """Keep one line on the terminal up to date."""
    print(f"\r{line}\033[K", end="", file=sys.stderr, flush=True)


def print_fit(fit: Fit) -> None:
    """Print parameters, fit percents, outcome and warnings."""
    rows = [("parameter", "value", "± (95 %)", "unit", "determined")]
    for estimate in (*fit.parameters, *fit.sensors):
        rows.append(
            (
                estimate.title,
                significant(estimate.value, 5),
                _error(*estimate.confidence_interval),
                estimate.unit,
                estimate.determined,
            )
        )
    print_table(rows, right=(1, 2))
    print()
    print_fit_percent(fit.fit_percent)
    print()
    if fit.starts > 1:
        _print_minima(fit)
    print(f"{fit.outcome} {fit.simulations} simulations in {fit.seconds:.1f} s.")
    for sentence in fit.verdict.sentences:
        print(sentence)
    print_warnings(fit.warnings)
    for offer in fit.offers:
        for quantity, value in offer.sensor.items():
            print(f"{offer.sentence} Add --sensor {offer.channel}.{quantity}={value:.9g}.")


def _error(lower: float, upper: float) -> str:
    """Half of an interval, or the end that is known of one that lies open, as exact as a value."""
    if math.isfinite(lower) and math.isfinite(upper):
        return significant((upper - lower) / 2.0, 2)
    if math.isfinite(lower):
        return f"from {significant(lower, 5)}"
    return f"up to {significant(upper, 5)}" if math.isfinite(upper) else "unbounded"


def _print_profiles(profiles: Sequence[Profile]) -> None:
    """Print the intervals by profile likelihood; "open" where the runs never object."""
    if not profiles:
        return
    rows = [("profile", "from", "to", "unit")]
    for one in profiles:
        low, high = (_shown_end(end) for end in one.confidence_interval)
        rows.append((one.name, low, high, parameter(one.name).unit))
    print()
    print_table(rows, right=(1, 2))
    for one in profiles:
        for sentence in one.sentences:
            print(f"{one.name}: {sentence}")


def _shown_end(end: float) -> str:
    return significant(end, 5) if math.isfinite(end) else "open"


def _print_minima(fit: Fit) -> None:
    """Print what the searches from many starts ended in."""
    rows = [("minimum", "cost", "searches", "cut short", "at a bound", "ended")]
    rows += [
        (
            f"{place}{' (start)' if one.from_start else ''}",
            significant(one.cost, 6),
            str(one.starts),
            str(one.cut_short),
            ", ".join(one.at_bound) or "none",
            str(one.outcome),
        )
        for place, one in enumerate(fit.minima, start=1)
    ]
    print_table(rows, right=(1, 2, 3))
    print()
