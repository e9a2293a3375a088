"""`ridetune condition`: from what raw sensors recorded to what an identification needs."""

import json
import sys
from argparse import Namespace
from pathlib import Path

from ...engine.conditioning.chain import condition as after
from ...engine.conditioning.chain import read_steps, steps_to_json
from ...engine.conditioning.suggestion import Suggestion, suggest
from ...engine.errors import MeasurementError
from ...engine.known_band import output_highpass
from ...engine.measurement import missing_for_identification, run_to_csv
from ...engine.run import Run
from ...engine.run_notes import notes_beside, notes_of, read_notes
from ...engine.units import counted
from .arguments import ArgumentError
from .inputs import find_mapping, find_vehicle, read_one, recording_files
from .output import OutputError, print_warnings, require_place, write_file


def condition(options: Namespace) -> None:
    """Do the steps, or those suggested, print what they did, write recording and record."""
    if options.suggest and options.output:
        raise ArgumentError("--suggest does nothing to the run; leave out it or -o.")
    _require_places(options)
    vehicle = options.vehicle and find_vehicle(options.vehicle)
    run = read_one(options.run_file, find_mapping(options.mapping))
    suggestion = None if options.steps else suggest(run, vehicle)
    if options.suggest and suggestion:
        print(json.dumps(steps_to_json(suggestion.steps), indent=1))
        above = suggestion.output_highpass_hz
        for sentence in (*suggestion.reasons, *_lacking(suggestion), *_compared_above(above)):
            print(sentence, file=sys.stderr)
        return
    steps = read_steps(Path(options.steps)) if suggestion is None else suggestion.steps
    done = after(run, steps, vehicle)
    for record in done.conditioning[len(run.conditioning) :]:
        print(f"{record.step['kind']}: {' '.join(record.sentences)}")
        print_warnings(record.warnings)
    print(f"{counted(len(steps), 'step')}, {done.time.size} samples over {done.duration:.4g} s.")
    _print_use(done, suggestion)
    if options.output:
        write_file(options.output, run_to_csv(done))
        write_file(notes_beside(Path(options.output)), notes_of(done))
        print(f"Wrote {options.output}, and what was done beside it.")
    else:
        print("Nothing was written; add -o run.csv to keep the run.")


def _lacking(suggestion: Suggestion) -> list[str]:
    return [f"Still lacking, {sentence}" for sentence in suggestion.lacks]


def _compared_above(hertz: float | None) -> list[str]:
    return [] if hertz is None else [f"Compare the run with --output-highpass {hertz:g}."]


def _print_use(done: Run, suggestion: Suggestion | None) -> None:
    """Say whether a fit can use the run, and how."""
    missing = missing_for_identification(done)
    if suggestion is not None:
        lacking = _lacking(suggestion)
    elif missing:
        lacking = [f"Still lacking for an identification: {', '.join(missing)}."]
    else:
        lacking = []
    for sentence in (*lacking, *_compared_above(output_highpass(done))):
        print(sentence)
    print_warnings(done.warnings)


def _require_places(options: Namespace) -> None:
    """Refuse places that cannot be written, or that hold notes of somebody else's."""
    if options.output is None:
        return
    inputs = (options.vehicle, options.steps, options.mapping, *recording_files([options.run_file]))
    beside = notes_beside(Path(options.output))
    for place in (options.output, beside):
        require_place(place, inputs)
    if beside == Path(options.output):
        raise OutputError(f"{beside}: its notes would be the same file; name a .csv with -o.")
    if beside.is_file():
        try:
            ours = bool(read_notes(beside).conditioning)
        except MeasurementError:
            ours = False
        if not ours:
            raise OutputError(
                f"{beside}: these notes were not written by this command, and the new ones would "
                "take their place; choose another name with -o."
            )
