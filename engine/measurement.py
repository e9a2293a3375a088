"""Measurement files: a table whose columns are channels becomes a Run in SI; a Run becomes CSV.

Names are those of the table of channels, in any case. A column of another name is left out with a
warning, unless it looks like a misspelling of a channel the file lacks. NAME.toml beside NAME.csv
may state noise and description (see `run_notes`). Which kinds of file are read is in `formats`.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from .channels import (
    CHANNELS,
    INPUT_CHANNELS,
    OUTPUT_CHANNELS,
    ChannelInfo,
    channel,
    find_channel,
)
from .clocks import clocks_of, on_one_clock
from .csv_table import is_number, split_title
from .errors import MeasurementError, UnmappedError
from .formats.child import BOUNDS, Bounds
from .formats.kinds import CSV
from .formats.opening import opened, opened_bytes
from .formats.table import Table
from .plausibility import (
    doubtful_magnitude,
    doubtful_time,
    require_increasing,
    require_samples,
)
from .run import Run
from .run_notes import (
    RunNotes,
    checked_noise,
    doubtful_noise,
    notes_beside,
    notes_in,
    read_notes,
)
from .units import UnitError, to_si


@dataclass(frozen=True, slots=True)
class Chosen:
    """A column of the file that is a channel of ours, with the way from its unit to SI.

    unit : as the file has it, "" where it has none
    """

    index: int
    info: ChannelInfo
    unit: str
    factor: float
    offset: float


def read_run(path: str | Path, *, noise: Mapping[str, float] | None = None) -> Run:
    """Read a measurement file of any kind, and the notes beside it if there are any.

    noise : standard deviations in SI by channel; they go before those of the notes
    """
    path = Path(path)
    beside = notes_beside(path)
    notes = read_notes(beside) if beside.is_file() else RunNotes()
    try:
        with opened(path, path.name) as table:
            run = named_run(table, {**notes.noise, **(noise or {})}, notes.description)
            return notes.of_car(replace(run, conditioning=notes.conditioning))
    except OSError as error:
        raise MeasurementError(
            f"{path}: the file cannot be read ({error.strerror}); check the path."
        ) from error


def parse_run(
    data: bytes,
    name: str,
    *,
    noise: Mapping[str, float] | None = None,
    apart: bool = False,
    bounds: Bounds = BOUNDS,
) -> Run:
    """Read the bytes of a measurement file; `name` is the run's name and heads every message.

    apart : whether a child reads text, too, as for what strangers send
    bounds : what the child may take
    """
    with opened_bytes(data, name, apart=apart, bounds=bounds) as table:
        return named_run(table, noise or {}, "")


BLOCK = 4096
"""Samples that are written at once, so that the text of a long run is never in memory whole."""


def write_run(run: Run, path: str | Path) -> None:
    """Write a run as CSV in SI; `read_run` returns its values to 11 digits, its time to 14."""
    with Path(path).open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(csv_blocks(run))


def run_to_csv(run: Run, units: Mapping[str, str] = MappingProxyType({})) -> str:
    """A run as CSV text; `units` as of `csv_blocks`."""
    return "".join(csv_blocks(run, units))


def csv_blocks(run: Run, units: Mapping[str, str] = MappingProxyType({})) -> Iterator[str]:
    """A run as CSV text, some lines at a time: a row a sample, columns in the table's order.

    units : by channel, of those that are not to be in SI
    """
    names = ("time", *run.columns)
    scales, shown = zip(*(_scale(name, units) for name in names), strict=True)
    yield ",".join(f"{name} [{unit}]" for name, unit in zip(names, shown, strict=True)) + "\n"
    columns = [run.time if name == "time" else run[name] for name in names]
    # A time counted from 1970 in seconds takes ten digits before the point.
    row = ",".join(["%.15g"] + ["%.12g"] * len(run.columns)) + "\n"
    for begin in range(0, len(run.time), BLOCK):
        block = np.column_stack([values[begin : begin + BLOCK] for values in columns]) / scales
        yield "".join(row % tuple(values) for values in block.tolist())


def in_unit(run: Run, name: str, units: Mapping[str, str]) -> tuple[NDArray[np.float64], str]:
    """The time or a channel (n,) of a run in its unit, SI where none is told, and that unit."""
    scale, unit = _scale(name, units)
    return (run.time if name == "time" else run[name]) / scale, unit


def _scale(name: str, units: Mapping[str, str]) -> tuple[float, str]:
    """What one of a channel's unit is in SI, and that unit."""
    si = channel(name).unit
    unit = units.get(name, si)
    return to_si(unit, si)[0], unit


def missing_for_identification(run: Run) -> tuple[str, ...]:
    """What a run lacks to identify a car from it; the last entry may name alternatives."""
    missing = [name for name in INPUT_CHANNELS if name not in run]
    if not any(name in run for name in OUTPUT_CHANNELS):
        missing.append(" or ".join(OUTPUT_CHANNELS))
    return tuple(missing)


def named_run(table: Table, noise: Mapping[str, float], description: str) -> Run:
    """The run in a table whose titles are our channels' names."""
    chosen, warnings = _columns(table)
    if table.kind == CSV:
        return run_from_table(
            table, chosen, noise=noise, description=description, warnings=warnings
        )
    said = notes_in(table.comment)
    run = run_from_table(
        table,
        chosen,
        noise={**said.noise, **noise},
        description=description or said.description,
        warnings=[*table.warnings, *warnings],
    )
    return said.of_car(run)


def run_from_table(
    table: Table,
    chosen: Sequence[Chosen],
    *,
    noise: Mapping[str, float] | None = None,
    description: str = "",
    warnings: Sequence[str] = (),
) -> Run:
    """The run that some columns of a table make, checked.

    chosen : the columns, each another channel; without one for the time, it is that of the
        columns' clocks, the finest where they differ (see `on_one_clock`)
    warnings : what is already known to be doubtful, which goes first
    """
    source, found = table.source, list(warnings)
    ways = {one.info.name: (one.index, one.factor, one.offset) for one in chosen}
    if "time" in ways:
        time, values = _timed(table, ways)
    else:
        time, values, said = on_one_clock(table, ways)
        found += said
    require_samples(len(time), source)
    require_increasing(time, table.place, source)
    found += doubtful_time(time)
    for one in chosen:
        if one.info.name != "time":
            unit = one.unit or one.info.unit
            found += doubtful_magnitude(one.info, unit, one.factor, time, values[one.info.name])
    known = checked_noise(noise or {}, source)
    found += doubtful_noise(known, values)
    return Run(source, time, values, known, tuple(found), description)


def _timed(
    table: Table, ways: Mapping[str, tuple[int, float, float]]
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    """Time and channels where a column of the file is chosen for the time."""
    if table.kind != CSV:
        samples = table.columns[ways["time"][0]].samples
        for name, (index, _, _) in ways.items():
            if table.columns[index].samples != samples:
                raise MeasurementError(
                    f"{table.source}: {name} has {table.columns[index].samples} samples, but the"
                    f" time has {samples}; choose columns of one clock."
                )
    numbers = table.in_si(list(ways.values()))
    values = {name: numbers[:, place] for place, name in enumerate(ways)}
    return values.pop("time"), values


def _columns(table: Table) -> tuple[list[Chosen], list[str]]:
    """The table's columns that are channels, time first, and warnings about the others."""
    titles, source = table.titles(), table.source
    names = [name for name, _ in titles]
    if table.kind == CSV and names and all(not name or is_number(name) for name in names):
        raise MeasurementError(
            f"{source}: the first line holds numbers where the column names belong; add a header"
            " line such as time [s],chassis.z [mm],wheel.fl.z [mm]."
        )
    clocks = clocks_of(table)
    found: dict[str, Chosen] = {}
    others: list[tuple[int, str]] = []
    for index, (name, unit) in enumerate(titles):
        if index in clocks:
            continue
        info = find_channel(name.lower())
        if info is None:
            others.append((index, _titled(name, unit)))
        elif info.name in found:
            raise MeasurementError(
                f"{source}: columns {found[info.name].index + 1} and {index + 1} are both"
                f" {info.name}; keep one of them."
            )
        else:
            found[info.name] = _column(index, info, unit, source)
    _require_channels(table, found)
    for index, title in others:
        _refuse_misspelling(index, title, found, source)
    warnings = []
    if bare := [f"{name} in {one.info.unit}" for name, one in found.items() if not one.unit]:
        warnings.append(f"Columns without a unit were read as SI: {', '.join(bare)}.")
    if others:
        shown = [_shortened(title) if title else f"column {index + 1}" for index, title in others]
        more = f" and {len(shown) - 8} more" if len(shown) > 8 else ""
        warnings.append(
            f"Columns that are no channels were left out: {', '.join(shown[:8])}{more}."
        )
    return sorted(found.values(), key=lambda column: column.info.name != "time"), warnings


def _column(index: int, info: ChannelInfo, unit: str, source: str) -> Chosen:
    try:
        factor, offset = to_si(unit or info.unit, info.unit)
    except UnitError as error:
        raise MeasurementError(
            f"{source}: column {index + 1}, {info.name}: {error}; write a unit of {info.quantity}"
            f" such as {info.name} [{info.display_unit}]."
        ) from error
    return Chosen(index, info, unit, factor, offset)


def _require_channels(table: Table, found: Collection[str]) -> None:
    """Refuse a file without time or without any channel: its names are not ours."""
    if table.kind == CSV and "time" not in found:
        listed = ", ".join(_shortened(_titled(*title)) for title in table.titles()[:5])
        raise UnmappedError(
            f"{table.source}: no column is called time (the first line reads: {listed}); name the"
            " columns on the first line, such as time [s],chassis.z [mm]."
        )
    if not set(found) - {"time"}:
        raise UnmappedError(
            f"{table.source}: no column besides time is a known channel; name them like"
            " chassis.z [mm],wheel.fl.z [mm]."
        )


def _titled(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _refuse_misspelling(index: int, title: str, found: Collection[str], source: str) -> None:
    name, _ = split_title(title)
    for known in CHANNELS:
        if len(name) < 2 * len(known) and known not in found and _misspells(name, known):
            raise UnmappedError(
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
