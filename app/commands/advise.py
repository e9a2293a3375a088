"""`ridetune advise`: which manoeuvre to drive next, and what it would tell."""

import json
import math
from argparse import Namespace
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from ...engine.identification.advice_file import advisory_to_json
from ...engine.identification.advisor import Advisory, advise_unmeasured, require_sound
from ...engine.identification.advisor import advise as advise_after
from ...engine.identification.candidates import catalogue
from ...engine.identification.fit_file import fit_to_json
from ...engine.identification.identify import identify
from ...engine.identification.kept_fit import fit_from_json
from ...engine.identification.problem import Problem
from ...engine.manoeuvre import Manoeuvre
from ...engine.parameters import parameter
from .inputs import (
    find_manoeuvre,
    find_mappings,
    find_vehicle,
    fit_data,
    mapping_files,
    read_noise,
    read_runs,
    recording_files,
)
from .output import print_table, require_place, significant, write_file


def advise(options: Namespace) -> None:
    """Rank the candidates, print the report, write the advice."""
    read = (*mapping_files(options.mapping), *recording_files(options.runs))
    inputs = (options.vehicle, options.noise, *read)
    require_place(options.json, (*inputs, *options.candidates, *options.planned))
    candidates = _candidates(options)
    planned = tuple(map(_key, options.planned))
    noise = read_noise(options.noise)
    if options.runs:
        found = advise_after(_problem(options, noise), candidates, planned=planned)
    else:
        vehicle = find_vehicle(options.vehicle)
        found = advise_unmeasured(vehicle, candidates, planned=planned, noise=noise)
        print(_without_runs(options.vehicle))
    print_advisory(found)
    if options.json:
        write_file(options.json, json.dumps(advisory_to_json(found), indent=2) + "\n")


def _candidates(options: Namespace) -> dict[str, Manoeuvre]:
    """Those named, or the usual ones, with what is planned among them."""
    known = catalogue()
    names = [*(options.candidates or known), *options.planned]
    return {_key(name): known.get(name) or find_manoeuvre(name) for name in names}


def _key(name: str) -> str:
    """A candidate's key: that of a known one, or the name of a file without its ending."""
    return Path(name).stem if Path(name).is_file() else name


def _problem(options: Namespace, noise: Mapping[str, float]) -> Problem:
    """The problem of the runs at fitted values: those of a fit's file, else fitted now."""
    runs = read_runs(options.runs, (), find_mappings(options.mapping, options.runs), noise=noise)
    data = fit_data(options.vehicle)
    if data is None:
        problem = Problem.build(find_vehicle(options.vehicle), runs)
        fitted = fit_to_json(identify(problem))
        print(fitted["outcome"])
        require_sound(fitted)
        return problem.as_fitted(fitted)
    fit = fit_from_json(data, Path(options.vehicle).name)
    require_sound(fit.ended)
    return Problem.build(
        fit.vehicle,
        [replace(run, braking=fit.braking.get(run.name) or run.braking) for run in runs],
        [one.name for one in fit.free],
        bounds={one.name: (one.lower, one.upper) for one in fit.free},
        traction=fit.traction,
        settings=fit.settings,
        loss=fit.loss,
        priors=fit.priors,
        sensors=fit.sensors,
    ).as_fitted(fit.ended)


def _without_runs(vehicle: str) -> str:
    """What is known where no run is given, of a car or of a fit."""
    if fit_data(vehicle) is not None:
        return (
            f"What {Path(vehicle).name} knows counts only together with its runs: give them as RUN;"
            " without them, nothing is known but what is planned."
        )
    return "Without recordings, nothing is known but what is planned."


def print_advisory(found: Advisory) -> None:
    """Print what is doubtful and what is known, then the candidates by rank."""
    for warning in found.warnings:
        print(f"Warning: {warning}")
    best = found.ranked[0] if found.ranked else None
    rows = [("parameter", "error %", "determined", *((f"after {best.key} %",) if best else ()))]
    for place, one in enumerate(found.now):
        after = (_percent(best.after[place].relative),) if best else ()
        symbol = parameter(one.name).symbol
        rows.append((symbol, _percent(one.relative), one.determined, *after))
    print_table(rows, right=(1, 3))
    print()
    rows = [("candidate", "rises", "bits", "what it would tell (standard errors)")]
    for advice in found.ranked:
        rows.append(
            (advice.key, str(advice.promoted), significant(advice.gain, 2), advice.sentence)
        )
    print_table(rows, right=(1, 2))
    for advice in found.ranked:
        if advice.remark:
            print(f"{advice.key}: {advice.remark}")
    for key, why in found.excluded.items():
        print(f"{key}: {why}")
    if len(found.together) > 1:
        print(f"Together: {', then '.join(one.key for one in found.together)}.")
        for advice in found.together[1:]:
            print(f"  {advice.sentence}")


def _percent(relative: float) -> str:
    return significant(100.0 * relative, 2) if math.isfinite(relative) else "unknown"
