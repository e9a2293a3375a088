"""Measurement files: a CSV with `name [unit]` columns becomes a Run in SI, and back.

Names are those of the table of channels, in any case; a column of another name is left out with a
warning, unless it looks like a misspelling of a channel the file lacks. A file NAME.toml beside
NAME.csv may state what is known about the recording:

    description = "Manoeuvre 2, wet road"
    [noise]                      # standard deviation of the measurement noise, SI
    "chassis.z" = 0.0005
"""

import io
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import SequenceMatcher, get_close_matches
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from .channels import CHANNELS, ChannelInfo, Run, channel, find_channel
from .csv_table import LARGEST_FILE, CsvTable, is_number
from .errors import MeasurementError, RideError
from .frames import CORNERS
from .units import UnitError, to_si

FEWEST_SAMPLES = 10
"""Fewest samples a measurement may have."""

COARSEST_STEP = 0.2
"""Time between samples, s, from which on the unit of time is doubtful."""

INPUTS_FOR_IDENTIFICATION = (*(f"wheel.{corner}.z" for corner in CORNERS), "chassis.a_x")
OUTPUTS_FOR_IDENTIFICATION = ("chassis.z", "chassis.pitch", "chassis.roll")

_TITLE = re.compile(r"(?P<name>[^\[\]()]*?)\s*(?:[\[(]\s*(?P<unit>.*?)\s*[\])])?")
_LARGEST_NOTES = 1_000_000


@dataclass(frozen=True, slots=True)
class _Column:
    """A column of the file that is a channel of ours, with the way from its unit to SI."""

    index: int
    info: ChannelInfo
    title: str
    unit: str
    factor: float
    offset: float


def read_run(path: str | Path, *, noise: Mapping[str, float] | None = None) -> Run:
    """Read a measurement file, and the notes beside it if there are any.

    noise : standard deviations in SI by channel; they go before those of the notes
    """
    path = Path(path)
    notes = _read_notes(path.with_suffix(".toml"))
    try:
        with path.open("rb") as stream:
            return _run(
                stream,
                path.name,
                noise={**notes.get("noise", {}), **(noise or {})},
                description=notes.get("description", ""),
            )
    except OSError as error:
        raise MeasurementError(
            f"{path}: the file cannot be read ({error.strerror}); check the path."
        ) from error


def parse_run(data: bytes, name: str, *, noise: Mapping[str, float] | None = None) -> Run:
    """Read the bytes of a measurement file; `name` is the run's name and heads every message."""
    return _run(io.BytesIO(data), name, noise=noise or {}, description="")


def write_run(run: Run, path: str | Path) -> None:
    """Write a run as CSV in SI; `read_run` returns the same values to 1e-11 of each."""
    Path(path).write_text(run_to_csv(run), encoding="utf-8", newline="\n")


def run_to_csv(run: Run) -> str:
    """A run as CSV text in SI, one row a sample, columns in the table's order."""
    titles = [f"{name} [{channel(name).unit}]" for name in ("time", *run.columns)]
    table = np.column_stack([run.time, *(run[name] for name in run.columns)])
    row = ",".join(["%.12g"] * len(titles))
    return "\n".join([",".join(titles), *(row % tuple(values) for values in table.tolist()), ""])


def missing_for_identification(run: Run) -> tuple[str, ...]:
    """What a run lacks to identify a car from it; the last entry may name alternatives."""
    missing = [name for name in INPUTS_FOR_IDENTIFICATION if name not in run]
    if not any(name in run for name in OUTPUTS_FOR_IDENTIFICATION):
        missing.append(" or ".join(OUTPUTS_FOR_IDENTIFICATION))
    return tuple(missing)


def require_for_identification(run: Run) -> None:
    """Refuse a run from which no car can be identified."""
    missing = missing_for_identification(run)
    if missing:
        raise MeasurementError(
            f"{run.name}: an identification also needs {', '.join(missing)}; add"
            f" {'this column' if len(missing) == 1 else 'these columns'} to the recording."
        )


def _run(stream: BinaryIO, source: str, *, noise: Mapping[str, float], description: str) -> Run:
    size = stream.seek(0, io.SEEK_END)
    if size > LARGEST_FILE:
        raise MeasurementError(
            f"{source}: the file has {size / 1e6:.0f} MB, more than {LARGEST_FILE / 1e6:.0f} MB;"
            " cut the recording or thin it out."
        )
    table = CsvTable(stream, source)
    columns, warnings = _columns(table.header, source)
    numbers = table.numbers([column.index for column in columns])
    if len(numbers) < FEWEST_SAMPLES:
        raise MeasurementError(
            f"{source}: the file holds {len(numbers)} samples, at least {FEWEST_SAMPLES} are"
            " needed; record longer or sample faster."
        )
    values = {
        column.info.name: column.factor * numbers[:, position] + column.offset
        for position, column in enumerate(columns)
    }
    time = values.pop("time")
    _require_increasing(time, table, source)
    warnings += _doubtful_time(time)
    for column in columns[1:]:
        warnings += _doubtful_magnitude(column, values[column.info.name])
    return Run(source, time, values, _checked_noise(noise, source), tuple(warnings), description)


def _columns(header: list[str], source: str) -> tuple[list[_Column], list[str]]:
    """The file's columns that are channels, time first, and warnings about the others."""
    if header and all(not title or is_number(title) for title in header):
        raise MeasurementError(
            f"{source}: the first line holds numbers where the column names belong; add a header"
            " line such as time [s],chassis.z [mm],wheel.fl.z [mm]."
        )
    found: dict[str, _Column] = {}
    others: list[tuple[int, str]] = []
    without_unit: list[str] = []
    for index, title in enumerate(header):
        match = _TITLE.fullmatch(title)
        name = (match["name"] if match else title).strip().lower()
        info = find_channel(name)
        if info is None:
            others.append((index, title))
            continue
        if name in found:
            raise MeasurementError(
                f"{source}: columns {found[name].index + 1} and {index + 1} are both {name}; keep"
                " one of them."
            )
        unit = (match["unit"] if match else "") or ""
        if not unit:
            without_unit.append(name)
        try:
            factor, offset = to_si(unit or info.unit, info.unit)
        except UnitError as error:
            raise MeasurementError(
                f"{source}: column {index + 1} ({title}): {error}; write a unit of"
                f" {info.quantity} such as {name} [{info.display_unit}]."
            ) from error
        found[name] = _Column(index, info, title, unit, factor, offset)
    ignored = [_ignored(index, title, found, source) for index, title in others]
    if "time" not in found:
        listed = ", ".join(repr(title) for title in header[:5])
        raise MeasurementError(
            f"{source}: no column is called time (the first line reads {listed}); name the columns"
            " on the first line, such as time [s],chassis.z [mm]."
        )
    if len(found) == 1:
        raise MeasurementError(
            f"{source}: no column besides time is a known channel; name them like"
            " chassis.z [mm], wheel.fl.z [mm]."
        )
    warnings = []
    if without_unit:
        units = ", ".join(f"{name} in {found[name].info.unit}" for name in without_unit)
        warnings.append(f"No unit is given for some columns; read were {units}.")
    if ignored:
        shown = ", ".join(ignored[:8]) + (", ..." if len(ignored) > 8 else "")
        warnings.append(f"Columns that are no channels were left out: {shown}.")
    columns = sorted(found.values(), key=lambda column: column.info.name != "time")
    return columns, warnings


def _ignored(index: int, title: str, found: Mapping[str, Any], source: str) -> str:
    """The title of a column to leave out; one that misspells a lacking channel is refused."""
    match = _TITLE.fullmatch(title)
    name = match["name"] if match else title
    for known in CHANNELS:
        if known not in found and _misspells(name, known):
            raise MeasurementError(
                f"{source}: column {index + 1} is called {title!r}; did you mean {known}? Rename it"
                " or remove it."
            )
    return title or f"number {index + 1}"


def _misspells(name: str, known: str) -> bool:
    """Whether a column's name looks like a slip in writing a channel's.

    Words may be a little off and separators different. The short parts (z, a_x, fl) carry the
    meaning: they must hold the same letters, so that chassis.a_y is no slip for chassis.a_x.
    """
    words, short = _parts(name)
    known_words, known_short = _parts(known)
    if "".join(re.findall(r"\w+", name.lower())) == "".join(re.findall(r"\w+", known)):
        return True
    return (
        short == known_short
        and len(words) == len(known_words)
        and all(
            SequenceMatcher(None, word, right).ratio() >= 0.75
            for word, right in zip(words, known_words, strict=True)
        )
    )


def _parts(name: str) -> tuple[list[str], set[str]]:
    """The words of a name, and the letters of its parts of one or two letters."""
    parts = re.findall(r"[a-z0-9]+", name.lower())
    return [part for part in parts if len(part) > 2], set(
        "".join(part for part in parts if len(part) <= 2)
    )


def _require_increasing(time: NDArray[np.float64], table: CsvTable, source: str) -> None:
    backwards = np.flatnonzero(np.diff(time) <= 0.0)
    if backwards.size:
        row = int(backwards[0]) + 1
        raise MeasurementError(
            f"{source}: line {table.line_of(row)}: time {time[row]:.10g} s does not come after"
            f" {time[row - 1]:.10g} s of the line before; sort the lines by time and keep one for"
            " each time."
        )


def _doubtful_time(time: NDArray[np.float64]) -> list[str]:
    step = float(np.median(np.diff(time)))
    if step <= COARSEST_STEP:
        return []
    return [f"time advances by {step:.3g} s a sample; is it in ms?"]


def _doubtful_magnitude(column: _Column, values: NDArray[np.float64]) -> list[str]:
    """A warning when a channel's greatest value makes its stated unit doubtful."""
    info, peak = column.info, float(np.max(np.abs(values)))
    unit = column.unit or info.unit
    shown = f"{peak / column.factor:.4g} {unit}"
    if peak > info.largest:
        other = info.display_unit if to_si(info.display_unit, info.unit)[0] < column.factor else ""
        question = f"is it in {other}?" if other else "check its unit and that rest reads zero."
        return [f"{info.name} reaches {shown}; {question}"]
    if 0.0 < peak < info.smallest:
        question = f"is it in {info.unit}?" if column.factor < 1.0 else "check its unit."
        return [f"{info.name} stays within {shown}; {question}"]
    return []


def _checked_noise(noise: Mapping[str, float], source: str) -> dict[str, float]:
    for name, value in noise.items():
        try:
            info = channel(name)
        except MeasurementError as error:
            raise MeasurementError(f"{source}: noise: {error}") from error
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not 0.0 < value < float("inf"):
            raise MeasurementError(
                f"{source}: noise of {name} is {value!r}; give a positive number in {info.unit}."
            )
    return {name: float(value) for name, value in noise.items()}


def _read_notes(path: Path) -> dict[str, Any]:
    """The notes beside a recording: a table `noise`, a text `description`, and what others read."""
    try:
        text = path.read_bytes()[:_LARGEST_NOTES].decode("utf-8-sig")
        notes = tomllib.loads(text)
    except OSError:
        return {}
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise MeasurementError(f"{path.name}: not valid TOML ({error}); correct it.") from error
    for name in notes:
        near = get_close_matches(name, ("noise", "description"), n=1, cutoff=0.75)
        if near and near[0] != name:
            raise MeasurementError(f"{path.name}: {name} is unknown; did you mean {near[0]}?")
    if not isinstance(notes.get("description", ""), str):
        raise MeasurementError(f"{path.name}: description must be a text in quotes.")
    if not isinstance(notes.get("noise", {}), dict):
        raise MeasurementError(f"{path.name}: noise must be a table [noise] of channel = number.")
    try:
        _checked_noise(notes.get("noise", {}), path.name)
    except RideError as error:
        raise MeasurementError(str(error)) from error
    return notes
