"""`ridetune channels`: which columns of a recording are which channels, and a mapping of it."""

import json
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches

from ...engine.errors import MeasurementError
from ...engine.mapping.mapping import ChannelMapping, mapping_to_json
from ...engine.mapping.reading import read_recording, survey_file
from ...engine.mapping.signs import check_signs
from ...engine.mapping.survey import Survey
from .arguments import ArgumentError
from .inputs import find_mapping, recording_files
from .output import print_table, print_warnings, require_place, write_file

MOST_ROWS = 200
"""Most columns that are printed; those that are channels come in any case."""


def channels(options: Namespace) -> None:
    """Print what each column is taken for and why, and write the mapping."""
    require_place(options.output, (options.mapping, *recording_files([options.recording])))
    given = find_mapping(options.mapping)
    found, warnings = survey_file(options.recording), []
    _require_mapped(options.flip, found.guess.mapping if given is None else given)
    if given is None:
        warnings += found.warnings
        found = replace(found, guess=found.guess.flipped(options.flip))
        mapping = found.guess.mapping
        try:
            if any(one.channel != "time" for one in mapping.columns):
                warnings += _findings(options.recording, mapping)
        except MeasurementError as error:
            warnings.append(str(error).removeprefix(f"{found.source}: "))
    else:
        mapping = given.flipped(options.flip)
        warnings += _findings(options.recording, mapping)
        found = found.with_templates({"--mapping": mapping})
    _print(found)
    print_warnings(dict.fromkeys(warnings))
    if options.output:
        text = json.dumps(mapping_to_json(found.guess.mapping), indent=2, ensure_ascii=False)
        write_file(options.output, text + "\n")
        print(f"Wrote {options.output}: look through it, then add --mapping {options.output}.")


def _require_mapped(flips: Sequence[str], mapping: ChannelMapping) -> None:
    """Refuse to turn over the sign of what has none."""
    known = [one.channel for one in mapping.columns if one.channel != "time"]
    for place, name in enumerate(flips):
        argument = f"--flip {name}"
        if name in flips[:place]:
            raise ArgumentError(f"{argument} is given twice; give it once.")
        if name not in known:
            near = get_close_matches(name, known, n=1) or known
            raise ArgumentError(
                f"{argument}: no column is taken for a channel {name} that has a sign; "
                + (f"name {' or '.join(near)}." if near else "map it first.")
            )


def _findings(path: str, mapping: ChannelMapping) -> list[str]:
    """What is doubtful in the run that a mapping makes, its signs included."""
    run = read_recording(path, mapping)
    return [*run.warnings, *(one.sentence for one in check_signs(run, mapping.sure_signs))]


def _print(found: Survey) -> None:
    """One row a column: what the file says, what its numbers do, what it is taken for."""
    rows = [
        ["column", "unit", "samples", "from", "to", "channel", "taken in", "sign", "sure", "why"]
    ]
    left_out = 0
    for index, column in enumerate(found.columns):
        chosen, known = found.guess.chosen.get(index), found.known.get(index)
        if chosen is None and len(rows) > MOST_ROWS:
            left_out += 1
            continue
        name = f"{column.group}/{column.name}" if column.group else column.name
        span = ("", "") if known is None else (f"{known.minimum:.4g}", f"{known.maximum:.4g}")
        taken = ["-", "", "", "", _may_be(found, index)]
        if chosen is not None:
            sure = f"{100.0 * chosen.confidence:.0f} %"
            taken = [chosen.channel, chosen.unit, f"{chosen.sign:+d}", sure, chosen.reason]
        rows.append([name, column.unit, str(column.samples), *span, *taken])
    print(f"{found.source}: {found.kind}, {len(found.columns)} columns")
    print_table(rows, right=(2, 3, 4, 7, 8))
    if left_out:
        print(f"and {left_out} more columns that are taken for no channel.")


def _may_be(found: Survey, index: int) -> str:
    """What a column that is taken for nothing may be."""
    if any(one.clock == index for one in found.columns):
        return "the time of others"
    names = [one.channel for one in found.guess.candidates[index][:2]]
    return f"may be {' or '.join(names)}" if names else ""
