"""Measurement files: a CSV with `name [unit]` columns becomes a Run in SI, and back.

Names are those of the table of channels, in any case. A column of another name is left out with a
warning, unless it looks like a misspelling of a channel the file lacks. NAME.toml beside NAME.csv
may state noise and description (see `run_notes`).
"""

import io
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from .channels import (
    CHANNELS,
    INPUT_CHANNELS,
    OUTPUT_CHANNELS,
    ChannelInfo,
    Run,
    channel,
    find_channel,
)
from .csv_table import LARGEST_FILE, CsvTable, is_number, split_title
from .errors import MeasurementError
from .run_notes import RunNotes, checked_noise, doubtful_noise, notes_beside, read_notes
from .spikes import spikes
from .units import UnitError, to_si

FEWEST_SAMPLES = 10
"""Fewest samples a measurement may have."""

COARSEST_STEP = 0.2
"""Time between samples, s, from which on the unit of time is doubtful."""


@dataclass(frozen=True, slots=True)
class _Column:
    """A column of the file that is a channel of ours, with the way from its unit to SI."""

    index: int
    info: ChannelInfo
    unit: str
    factor: float
    offset: float


def read_run(path: str | Path, *, noise: Mapping[str, float] | None = None) -> Run:
    """Read a measurement file, and the notes beside it if there are any.

    noise : standard deviations in SI by channel; they go before those of the notes
    """
    path = Path(path)
    beside = notes_beside(path)
    notes = read_notes(beside) if beside.is_file() else RunNotes()
    try:
        with path.open("rb") as stream:
            run = _run(stream, path.name, {**notes.noise, **(noise or {})}, notes.description)
            return replace(run, conditioning=notes.conditioning)
    except OSError as error:
        raise MeasurementError(
            f"{path}: the file cannot be read ({error.strerror}); check the path."
        ) from error


def parse_run(data: bytes, name: str, *, noise: Mapping[str, float] | None = None) -> Run:
    """Read the bytes of a measurement file; `name` is the run's name and heads every message."""
    return _run(io.BytesIO(data), name, noise or {}, "")


def write_run(run: Run, path: str | Path) -> None:
    """Write a run as CSV in SI; `read_run` returns its values to 11 digits, its time to 14."""
    Path(path).write_text(run_to_csv(run), encoding="utf-8", newline="\n")


def run_to_csv(run: Run, units: Mapping[str, str] = MappingProxyType({})) -> str:
    """A run as CSV text, one row a sample, columns in the table's order.

    units : by channel, of those that are not to be in SI
    """
    shown = {name: in_unit(run, name, units) for name in ("time", *run.columns)}
    titles = [f"{name} [{unit}]" for name, (_, unit) in shown.items()]
    table = np.column_stack([values for values, _ in shown.values()])
    # A time counted from 1970 in seconds takes ten digits before the point.
    row = ",".join(["%.15g"] + ["%.12g"] * len(run.columns))
    return "\n".join([",".join(titles), *(row % tuple(values) for values in table.tolist()), ""])


def in_unit(run: Run, name: str, units: Mapping[str, str]) -> tuple[NDArray[np.float64], str]:
    """The time or a channel (n,) of a run in its unit, SI where none is told, and that unit."""
    si = channel(name).unit
    unit = units.get(name, si)
    return (run.time if name == "time" else run[name]) / to_si(unit, si)[0], unit


def missing_for_identification(run: Run) -> tuple[str, ...]:
    """What a run lacks to identify a car from it; the last entry may name alternatives."""
    missing = [name for name in INPUT_CHANNELS if name not in run]
    if not any(name in run for name in OUTPUT_CHANNELS):
        missing.append(" or ".join(OUTPUT_CHANNELS))
    return tuple(missing)


def _run(stream: BinaryIO, source: str, noise: Mapping[str, float], description: str) -> Run:
    size = stream.seek(0, io.SEEK_END)
    if size > LARGEST_FILE:
        raise MeasurementError(
            f"{source}: the file has {size / 1e6:.0f} MB, more than {LARGEST_FILE / 1e6:.0f} MB;"
            " cut the recording or thin it out."
        )
    table = CsvTable(stream, source)
    columns, warnings = _columns(table.header, source)
    numbers = table.in_si([(column.index, column.factor, column.offset) for column in columns])
    if len(numbers) < FEWEST_SAMPLES:
        raise MeasurementError(
            f"{source}: the file holds {len(numbers)} samples, at least {FEWEST_SAMPLES} are"
            " needed; record longer or sample faster."
        )
    values = {column.info.name: numbers[:, k] for k, column in enumerate(columns)}
    time = values.pop("time")
    _require_increasing(time, table, source)
    warnings += _doubtful_time(time)
    for column in columns[1:]:
        warnings += _doubtful_magnitude(column, time, values[column.info.name])
    known = checked_noise(noise, source)
    warnings += doubtful_noise(known, values)
    return Run(source, time, values, known, tuple(warnings), description)


def _columns(header: list[str], source: str) -> tuple[list[_Column], list[str]]:
    """The file's columns that are channels, time first, and warnings about the others."""
    if header and all(not title or is_number(title) for title in header):
        raise MeasurementError(
            f"{source}: the first line holds numbers where the column names belong; add a header"
            " line such as time [s],chassis.z [mm],wheel.fl.z [mm]."
        )
    found: dict[str, _Column] = {}
    others: list[tuple[int, str]] = []
    for index, title in enumerate(header):
        name, unit = split_title(title)
        info = find_channel(name.lower())
        if info is None:
            others.append((index, title))
        elif info.name in found:
            raise MeasurementError(
                f"{source}: columns {found[info.name].index + 1} and {index + 1} are both"
                f" {info.name}; keep one of them."
            )
        else:
            found[info.name] = _column(index, info, unit, source)
    for index, title in others:
        _refuse_misspelling(index, title, found, source)
    _require_channels(header, found, source)
    warnings = []
    if bare := [f"{name} in {one.info.unit}" for name, one in found.items() if not one.unit]:
        warnings.append(f"Columns without a unit were read as SI: {', '.join(bare)}.")
    if others:
        titles = [_shortened(title) if title else f"column {index + 1}" for index, title in others]
        more = f" and {len(titles) - 8} more" if len(titles) > 8 else ""
        warnings.append(
            f"Columns that are no channels were left out: {', '.join(titles[:8])}{more}."
        )
    return sorted(found.values(), key=lambda column: column.info.name != "time"), warnings


def _column(index: int, info: ChannelInfo, unit: str, source: str) -> _Column:
    try:
        factor, offset = to_si(unit or info.unit, info.unit)
    except UnitError as error:
        raise MeasurementError(
            f"{source}: column {index + 1}, {info.name}: {error}; write a unit of {info.quantity}"
            f" such as {info.name} [{info.display_unit}]."
        ) from error
    return _Column(index, info, unit, factor, offset)


def _require_channels(header: list[str], found: Collection[str], source: str) -> None:
    """Refuse a header without time or without any channel."""
    if "time" not in found:
        listed = ", ".join(_shortened(title) for title in header[:5])
        raise MeasurementError(
            f"{source}: no column is called time (the first line reads: {listed}); name the"
            " columns on the first line, such as time [s],chassis.z [mm]."
        )
    if len(found) == 1:
        raise MeasurementError(
            f"{source}: no column besides time is a known channel; name them like"
            " chassis.z [mm],wheel.fl.z [mm]."
        )


def _refuse_misspelling(index: int, title: str, found: Collection[str], source: str) -> None:
    name, _ = split_title(title)
    for known in CHANNELS:
        if len(name) < 2 * len(known) and known not in found and _misspells(name, known):
            raise MeasurementError(
                f"{source}: column {index + 1} is called {_shortened(title)}; did you mean"
                f" {known}? Rename it or remove it."
            )


def _misspells(name: str, known: str) -> bool:
    """Whether a column's name looks like a slip in writing a channel's.

    Words may be a little off and separators different. The short parts (z, a_x, fl) carry the
    meaning: they must hold the same letters, so that chassis.a_y is no slip for chassis.a_x.
    """
    parts, known_parts = (re.findall(r"[a-z0-9]+", text.lower()) for text in (name, known))
    if "".join(parts) == "".join(known_parts):
        return True
    words, known_words = ([part for part in one if len(part) > 2] for one in (parts, known_parts))
    short, known_short = (
        {letter for part in one if len(part) <= 2 for letter in part}
        for one in (parts, known_parts)
    )
    return (
        short == known_short
        and len(words) == len(known_words)
        and all(
            SequenceMatcher(None, word, right).ratio() >= 0.75
            for word, right in zip(words, known_words, strict=True)
        )
    )


def _shortened(title: str) -> str:
    return title if len(title) <= 40 else f"{title[:37]}..."


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


def _doubtful_magnitude(
    column: _Column, time: NDArray[np.float64], values: NDArray[np.float64]
) -> list[str]:
    """A warning when a channel's greatest value makes its stated unit, or itself, doubtful."""
    info = column.info
    if found := spikes(info, time, values):
        return found
    peak = float(np.max(np.abs(values)))
    shown = f"{peak / column.factor:.4g} {column.unit or info.unit}"
    if peak > info.largest:
        smaller = to_si(info.display_unit, info.unit)[0] < column.factor
        doubt = f"is it in {info.display_unit}?" if smaller else "check its unit and rest value."
        return [f"{info.name} reaches {shown}; {doubt}"]
    if 0.0 < peak < info.smallest:
        doubt = f"is it in {info.unit}?" if column.factor < 1.0 else "check its unit."
        return [f"{info.name} stays within {shown}; {doubt}"]
    return []
