"""`ridetune validate`: identify a car on some runs, predict others, report how well."""

import hashlib
import json
import math
from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...engine.errors import VehicleError
from ...engine.identification.fit_file import fit_to_json
from ...engine.identification.kept_fit import fit_from_json
from ...engine.json_text import read_json
from ...engine.manoeuvre import Manoeuvre, read_manoeuvre
from ...engine.run import Run
from ...engine.run_notes import manoeuvre_beside
from ...engine.validation.cases import Case, as_it_moved, check_cases
from ...engine.validation.geometry import Geometry, geometry_from_json
from ...engine.validation.validate import ValidatedRun, Validation
from ...engine.validation.validate import validate as predict
from ...engine.validation.validation_file import validation_to_json
from ..work.report import made, report
from .arguments import ArgumentError, place_of, rims_settings, run_and_file
from .identify import asked, fitted, print_fit
from .inputs import (
    find_manoeuvre,
    find_mappings,
    find_vehicle,
    mapping_files,
    read_noise,
    read_runs,
    recording_files,
)
from .output import print_table, print_warnings, require_place, write_file

DRIVEN_BY = {"rims": "rims", "road": "road + torque"}
MODELS = {"8dof": "8-DOF", "7dof": "7-DOF"}


def validate(options: Namespace) -> None:
    """Fit, predict, print the table of fit percents, write report and results."""
    paths = [*options.runs, *options.hold_out]
    _require_places(options, paths)
    geometry = _geometry(options.geometry)
    vehicle = find_vehicle(options.vehicle)
    under, noise = find_mappings(options.mapping, paths), read_noise(options.noise)
    runs = read_runs(paths, options.braking or (), under, noise=noise)
    cases = _cases(runs, len(options.runs), _manoeuvres(options.manoeuvre, paths))
    check_cases(cases)
    fit = fitted(options, asked(options, vehicle, runs[: len(options.runs)], noise))
    print_fit(fit)
    found = fit_to_json(fit)
    validation = predict(
        fit.vehicle,
        [
            replace(case, run=as_it_moved(case.run, found, _fitted_name(case, found, place)))
            for place, case in enumerate(cases)
        ],
        traction=options.traction or "exact",
        settings=rims_settings(options),
        fit=fit_from_json(found),
    )
    print()
    _print(validation)
    recordings = [
        {"name": run.name, "sha256": hashlib.sha256(Path(path).read_bytes()).hexdigest()}
        for run, path in zip(runs, paths, strict=True)
    ]
    document = validation_to_json(validation, found, geometry, made(recordings))
    write_file(options.output, report(document))
    print(f"Wrote {options.output}: open it in a browser, whose print makes a PDF of it.")
    if options.json:
        write_file(options.json, json.dumps(document, allow_nan=False) + "\n")
        print(f"Wrote {options.json}.")


def _require_places(options: Namespace, paths: Sequence[str]) -> None:
    """Refuse places that cannot be written before the work is done."""
    beside = [manoeuvre_beside(Path(path)) for path in paths]
    inputs = (
        *(options.vehicle, options.noise, options.geometry),
        *mapping_files(options.mapping),
        *recording_files(paths),
        *beside,
        *(run_and_file(text)[1] for text in options.manoeuvre),
    )
    require_place(options.output, inputs)
    require_place(options.json, inputs)
    if options.json and Path(options.json).resolve() == Path(options.output).resolve():
        raise ArgumentError(f"--json {options.json} and -o name the same file; name two.")


def _geometry(path: str | None) -> Geometry | None:
    if path is None:
        return None
    return geometry_from_json(read_json(Path(path), VehicleError), Path(path).name)


def _manoeuvres(given: Sequence[str], paths: Sequence[str]) -> dict[int, Manoeuvre]:
    """What was driven by a run's place in `paths`: as given, else as it lies beside the run."""
    found: dict[int, Manoeuvre] = {}
    for text in given:
        argument = f"--manoeuvre {text}"
        name, manoeuvre = run_and_file(text)
        if not (name and manoeuvre):
            raise ArgumentError(f"{argument} names no run or no manoeuvre; write RUN=NAME.")
        place = place_of(name, paths, argument)
        if place in found:
            raise ArgumentError(f"{argument} gives {name} a second one; give it one.")
        found[place] = find_manoeuvre(manoeuvre)
    for place, path in enumerate(paths):
        beside = manoeuvre_beside(Path(path))
        if place not in found and beside.is_file():
            found[place] = read_manoeuvre(beside)
    return found


def _cases(runs: Sequence[Run], fits: int, manoeuvres: dict[int, Manoeuvre]) -> list[Case]:
    return [
        Case(run, "fit" if place < fits else "hold-out", manoeuvres.get(place))
        for place, run in enumerate(runs)
    ]


def _fitted_name(case: Case, fit: Mapping[str, Any], place: int) -> str | None:
    """What the fit calls a run that it has seen."""
    return fit["runs"][place]["name"] if case.role == "fit" else None


def _print(validation: Validation) -> None:
    """Print fit percents by run and prediction, the squat, and what was found on the way."""
    names = list(
        dict.fromkeys(
            name for run in validation.runs for one in run.predictions for name in one.scores
        )
    )
    rows = [["predicted, fit percent", "driven by", "model", *names]]
    for run in validation.runs:
        for one in run.predictions:
            scores = [
                f"{one.scores[name].fit_percent:.1f}" if name in one.scores else "-"
                for name in names
            ]
            rows.append([_what(run), DRIVEN_BY[one.mode], MODELS[one.model], *scores])
    print_table(rows, right=range(3, 3 + len(names)))
    _print_coverage(validation.runs, names)
    _print_squats(validation.runs)
    print_warnings(finding for run in validation.runs for finding in run.findings)
    print_warnings(
        f"{run.name}, {DRIVEN_BY[one.mode]}, {MODELS[one.model]}: {one.failure}"
        for run in validation.runs
        for one in run.predictions
        if one.failure
    )


def _print_coverage(runs: Sequence[ValidatedRun], names: Sequence[str]) -> None:
    """Print how much of each channel lies within the error band of its prediction and the noise."""
    rows = [["within 95 % band and noise, percent", "driven by", *names]]
    for run in runs:
        for one in run.predictions:
            if one.half_width:
                within = [
                    one.scores[name].coverage if name in one.scores else None for name in names
                ]
                shares = ("-" if share is None else f"{100.0 * share:.1f}" for share in within)
                rows.append([_what(run), DRIVEN_BY[one.mode], *shares])
    if len(rows) > 1:
        print()
        print_table(rows, right=range(2, 2 + len(names)))


def _what(run: ValidatedRun) -> str:
    return f"{run.name} ({'fitted' if run.role == 'fit' else 'held out'})"


def _print_squats(runs: Sequence[ValidatedRun]) -> None:
    """Print the step of the pitch, measured and predicted, of the runs that have one."""
    squatting = [run for run in runs if run.squat is not None]
    kinds = list(
        dict.fromkeys((one.mode, one.model) for run in squatting for one in run.predictions)
    )
    if not squatting:
        return
    rows = [
        [
            "squat, deg of pitch",
            "measured",
            *(f"{MODELS[model]}, {DRIVEN_BY[mode]}" for mode, model in kinds),
        ]
    ]
    for run in squatting:
        predicted = {(one.mode, one.model): one.squat for one in run.predictions}
        steps = [run.squat, *(predicted.get(kind) for kind in kinds)]
        rows.append(
            [run.name, *("-" if step is None else f"{math.degrees(step):.3f}" for step in steps)]
        )
    print()
    print_table(rows, right=range(1, 2 + len(kinds)))
