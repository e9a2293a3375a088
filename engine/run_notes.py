"""What is known about a recording, in a TOML file beside it:

    description = "Manoeuvre 2, wet road"
    vehicle = "BMW 320i"     # that was driven, as its file names it
    plant = "detailed"       # the virtual car that drove, in a campaign

    [noise]                  # standard deviation of the measurement noise by channel, SI
    "chassis.z" = 0.0005     # the quotes may be left off

    [[conditioning]]         # what `ridetune condition` did, step by step

Other keys are for other readers.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .channels import LARGEST_NOISE, SMALLEST_NOISE, channel, find_channel
from .errors import MeasurementError
from .run import Run
from .short_file import read_short
from .step_record import StepRecord, step_record_to_json, step_records_from_json
from .toml_text import LARGEST_FILE, parse_toml, toml_table, toml_value

DEFAULT_NOISE = {
    "chassis.z": 0.5e-3,
    "chassis.pitch": math.radians(0.02),
    "chassis.roll": math.radians(0.02),
}
"""Standard deviation of a channel's noise where neither the run nor the caller states one, SI."""

LOUDEST = 3
"""Multiple of a channel's standard deviation beyond which a stated noise is doubtful ..."""

SHARE_OF_LARGEST = 0.01
"""... if it also exceeds this share of the greatest value of a real recording."""

_TEXTS = ("description", "vehicle", "plant")
"""Notes that are a text each."""

_NOISE_LINE = re.compile(
    r"^noise of (\S+): (\d+(?:\.\d+)?(?:[eE][+-]?\d+)?) (.+?)\s*$", re.MULTILINE
)


@dataclass(frozen=True, slots=True)
class RunNotes:
    """Noise in SI by channel, a text for a person, what conditioning did to the recording, the
    name of the car that was driven, and which virtual one drove.
    """

    noise: Mapping[str, float] = field(default_factory=dict)
    description: str = ""
    conditioning: tuple[StepRecord, ...] = ()
    vehicle: str = ""
    plant: str = ""

    def of_car(self, run: Run) -> Run:
        """The run, of the car that the notes name where they do."""
        return replace(run, vehicle=self.vehicle or run.vehicle, plant=self.plant or run.plant)


def notes_beside(recording: Path) -> Path:
    """Where the notes of a recording lie, if it has any."""
    return recording.parent / f"{recording.stem}.toml"


def manoeuvre_beside(recording: Path) -> Path:
    """Where the manoeuvre of a recording lies, if it is known."""
    return recording.parent / f"{recording.stem}.manoeuvre.json"


def read_notes(path: Path) -> RunNotes:
    """The notes in a file, checked; every message starts with the file's name."""
    return parse_notes(read_short(path, LARGEST_FILE, MeasurementError), path.name)


def parse_notes(data: bytes, source: str) -> RunNotes:
    """The notes in the bytes of a file; `source` heads every message."""
    notes = parse_toml(data, source)
    for name in notes:
        near = get_close_matches(name.lower(), ("noise", *_TEXTS), n=1, cutoff=0.75)
        if near and near[0] != name:
            raise MeasurementError(f"{source}: {name} is not known; did you mean {near[0]}?")
    noise = notes.get("noise", {})
    texts = {name: notes.get(name, "") for name in _TEXTS}
    for name, text in texts.items():
        if not isinstance(text, str):
            raise MeasurementError(f"{source}: {name} must be a text in quotes.")
    if not isinstance(noise, dict):
        raise MeasurementError(
            f'{source}: noise must be a table: [noise] and lines such as "chassis.z" = 0.0005.'
        )
    done = step_records_from_json(notes.get("conditioning", []), source)
    return RunNotes(checked_noise(_flat(noise), source), conditioning=done, **texts)


def notes_of(run: Run) -> str:
    """What a run knows of itself as the text of a file that `parse_notes` reads."""
    lines = [f"description = {toml_value(run.description)}"]
    known = {"vehicle": run.vehicle, "plant": run.plant}
    lines += [f"{name} = {toml_value(text)}" for name, text in known.items() if text]
    lines += toml_table("[noise]", run.noise)
    for record in map(step_record_to_json, run.conditioning):
        lists = {name: one for name, one in record.items() if isinstance(one, list)}
        lines += toml_table("[[conditioning]]", lists)
        for name, one in record.items():
            if name not in lists:
                lines += toml_table(f"[conditioning.{name}]", one)
    return "\n".join([*lines, ""])


def notes_in(comment: str) -> RunNotes:
    """The notes that a recording of ours carries in its own header, one a line; see `mdf4`."""
    said = re.findall(rf"^({'|'.join(_TEXTS)}): (.*)$", comment, re.MULTILINE)
    texts = dict(reversed(said))  # the first of each counts
    noise = {}
    for name, value, unit in _NOISE_LINE.findall(comment):
        info = find_channel(name)
        if info is not None and info.unit == unit:
            noise[name] = float(value)
    return RunNotes(noise, **{name: text.strip() for name, text in texts.items()})


def checked_noise(noise: Mapping[str, Any], source: str) -> dict[str, float]:
    """Standard deviations by channel, each a positive number for a known channel."""
    for name, value in noise.items():
        try:
            info = channel(name)
        except MeasurementError as error:
            raise MeasurementError(f"{source}: noise: {error}") from error
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not SMALLEST_NOISE <= value <= LARGEST_NOISE:
            plain = toml_value(value) if isinstance(value, int | float) else "no number"
            shown = f"'{value}'" if isinstance(value, str) else plain
            raise MeasurementError(
                f"{source}: noise of {name} is {shown}; give a positive number in {info.unit}, "
                f"from {SMALLEST_NOISE:g} to {LARGEST_NOISE:g}."
            )
    return {name: float(value) for name, value in noise.items()}


def doubtful_noise(
    noise: Mapping[str, float], values: Mapping[str, NDArray[np.float64]]
) -> list[str]:
    """A warning for each noise that is so large that its channel would count for nothing.

    noise : standard deviations by channel;  values : the recording's own, both in SI
    """
    warnings = []
    for name in sorted(noise.keys() & values.keys()):
        info, scatter = channel(name), float(np.std(values[name]))
        if noise[name] > max(LOUDEST * scatter, SHARE_OF_LARGEST * info.largest):
            other = info.display_unit != info.unit
            doubt = f"is this one in {info.display_unit}?" if other else "check the number."
            warnings.append(
                f"The stated noise of {name}, {noise[name]:g} {info.unit}, is more than {LOUDEST}"
                f" times all its variation ({scatter:.3g} {info.unit}), so that {name} counts for"
                f" nothing; noise is stated in {info.unit}, {doubt}"
            )
    return warnings


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """A table whose dotted keys were written without quotes, with the dots back in its keys."""
    found: dict[str, Any] = {}
    for name, value in table.items():
        nested = isinstance(value, dict)
        found |= _flat(value, f"{prefix}{name}.") if nested else {prefix + name: value}
    return found
