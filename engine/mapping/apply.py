"""A table and a mapping become a Run in SI, with the checks of any measurement.

Every column has a clock: the column mapped as time, where it is of the same group and length, else
what the file says is its time. What several clocks recorded is joined (see `clocks`).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..channels import channel
from ..clocks import ROUNDING, Clocks, Series, clock_key, even_time, joined, way_of_time
from ..csv_table import LARGEST_NUMBER
from ..errors import MeasurementError
from ..formats.table import Column, Table
from ..plausibility import (
    doubtful_magnitude,
    doubtful_time,
    require_samples,
)
from ..run import Run
from ..run_notes import checked_noise, doubtful_noise
from ..units import to_si
from .mapping import ChannelMapping, MappedColumn, Places
from .numbers import statistics

Array = NDArray[np.float64]


def apply(
    mapping: ChannelMapping,
    table: Table,
    *,
    noise: Mapping[str, float] | None = None,
    description: str = "",
) -> Run:
    """The run that a mapping makes of a table.

    noise : standard deviations in SI by channel
    Raises MeasurementError naming the file, the column and the remedy.
    """
    source, found = table.source, _found(mapping, table)
    times = _Times(table, found.pop("time", None), mapping.step)
    if not found:
        raise MeasurementError(f"{source}: the mapping names no channel besides time; map some.")
    warnings = list(table.warnings)
    series = [
        _series(table, entry, index, times.of(entry, index), mapping.longest_gap, warnings)
        for entry, index in found.values()
    ]
    warnings += times.warnings
    if times.assumed:
        warnings.append(
            f"The file tells no time; its samples were taken every {mapping.step:g} s, as the"
            " mapping says."
        )
    time, numbers, said = joined(series, source, None if times.assumed else mapping.step)
    warnings += said
    require_samples(time.size, source)
    values = dict(zip(found, numbers, strict=True))
    doubts = doubtful_time(time)
    for name, (entry, _) in found.items():
        info = channel(name)
        factor, _ = to_si(entry.unit, info.unit)
        doubts += doubtful_magnitude(info, entry.unit, factor, time, values[name])
    # What makes the run useless goes before what is odd in the file.
    warnings = [*doubts, *warnings]
    known = checked_noise(noise or {}, source)
    warnings += doubtful_noise(known, values)
    return Run(source, time, values, known, tuple(warnings), description)


def _found(mapping: ChannelMapping, table: Table) -> dict[str, tuple[MappedColumn, int]]:
    """By channel its entry, and which column of the table that is."""
    found, places = {}, Places(table.columns)
    taken: dict[int, MappedColumn] = {}
    for entry in mapping.columns:
        where = places.of(entry.column, entry.group)
        if len(where) != 1:
            group = f" in the group '{entry.group}'" if entry.group else ""
            what = f"has {len(where)} columns" if where else "has no column"
            remedy = "name its group" if where else "map another one"
            raise MeasurementError(
                f"{table.source}: the file {what} called '{entry.column}'{group}, which the"
                f" mapping takes for {entry.channel}; {remedy}."
            )
        other = taken.setdefault(where[0], entry)
        if other is not entry:
            raise MeasurementError(
                f"{table.source}: the file has one column called '{entry.column}', which the"
                f" mapping takes for {other.channel} (group '{other.group}') and for"
                f" {entry.channel} (group '{entry.group}'); keep one of them."
            )
        found[entry.channel] = entry, where[0]
    return found


class _Times:
    """The times of the columns, s: of the column mapped as time, or their own.

    step : time between the samples where nothing in the file tells any time, s
    assumed : whether it was needed
    """

    def __init__(self, table: Table, mapped: tuple[MappedColumn, int] | None, step: float | None):
        self._table, self._step, self.assumed = table, step, False
        self._entry, self._index = mapped or (None, -1)
        self._clocks = Clocks(table.source)
        self.warnings = self._clocks.warnings

    def of(self, entry: MappedColumn, index: int) -> Array:
        """The time (samples,) of a column; nan where its clock has no number."""
        columns = self._table.columns
        one, mapped = columns[index], columns[self._index] if self._entry else None
        alike = mapped is not None and mapped.samples == one.samples
        near = mapped and (one.clock == self._index or one.group == mapped.group)
        key = clock_key(one)
        if alike and (near or not key):
            return self._clocks.kept("mapped", self._mapped, entry.column)
        if key:
            return self._clocks.kept(key, lambda: self._own(one), entry.column)
        step, untimed = self._step, not any(map(clock_key, columns))
        if step is not None and untimed and mapped is None:
            self.assumed = True
            even = replace(one, start=0.0, step=step)
            return self._clocks.kept(
                ("assumed", one.samples), lambda: even_time(even), entry.column
            )
        remedy = (
            'map the column that holds it as time, or write as "step" of the mapping how many'
            " seconds lie between samples if no column does"
        )
        if mapped is not None:
            remedy = (
                f"{mapped.name}, which is mapped as time, has {mapped.samples} samples and this"
                f" one {one.samples}: map another time or leave this column out"
            )
        raise MeasurementError(
            f"{self._table.source}: the file tells no time for {entry.column}; {remedy}."
        )

    def _mapped(self) -> Array:
        assert self._entry is not None
        factor, offset = self._entry.to_si()
        with np.errstate(over="ignore", invalid="ignore"):
            return factor * self._table.values(self._index) + offset

    def _own(self, column: Column) -> Array:
        if column.clock is None:
            return even_time(column)
        index, factor, offset = way_of_time(self._table, column.clock)
        with np.errstate(over="ignore", invalid="ignore"):
            return factor * self._table.values(index) + offset


def _series(
    table: Table,
    entry: MappedColumn,
    index: int,
    time: Array,
    longest_gap: float,
    warnings: list[str],
) -> Series:
    """A column's numbers where there are some, in SI; stand-ins and long gaps are refused."""
    place = f"{table.source}: {entry.column}, mapped as {entry.channel},"
    values = table.values(index)
    timed = np.isfinite(time)
    measured = np.isfinite(values) & timed
    if entry.missing is None:
        _refuse_stand_ins(values, place)
    else:
        measured &= ~np.isin(values, entry.missing)
    if np.count_nonzero(measured) < 2:
        raise MeasurementError(f"{place} has fewer than two numbers; leave it out.")
    _bridge(place, entry, time[timed], measured[timed], longest_gap, warnings)
    factor, offset = entry.to_si()
    with np.errstate(over="ignore", invalid="ignore"):
        numbers = factor * values[measured] + offset
    if not np.all(np.abs(numbers) < LARGEST_NUMBER):
        raise MeasurementError(f"{place} holds a number too large for its unit; correct it.")
    if numbers.min() == numbers.max():
        warnings.append(f"{entry.column}, mapped as {entry.channel}, never changes.")
    return Series(entry.column, time, time[measured], numbers)


def _refuse_stand_ins(values: Array, place: str) -> None:
    if found := statistics(values).stand_ins:
        listed = ", ".join(f"{one.value:g}" for one in found)
        counted = " and ".join(f"{one.value:g} in {one.samples} samples" for one in found)
        raise MeasurementError(
            f"{place} is {counted}, far outside the rest; if that stands for nothing measured,"
            f" give {listed} as missing, else say that no number is missing."
        )


def _bridge(
    place: str,
    entry: MappedColumn,
    time: Array,
    measured: NDArray[np.bool_],
    longest: float,
    warnings: list[str],
) -> None:
    """Warn of gaps that interpolation bridges, refuse a longer one.

    time, measured : (samples,), where the clock has a number
    """
    known = np.flatnonzero(measured)
    gaps = np.flatnonzero(np.diff(known) > 1)
    if not gaps.size:
        return
    spans = time[known[gaps + 1]] - time[known[gaps]]
    widest = int(np.argmax(spans))
    if spans[widest] > longest * (1.0 + ROUNDING):
        begin = time[known[gaps[widest]]]
        raise MeasurementError(
            f"{place} has no number between {begin:.4g} and {begin + spans[widest]:.4g} s, longer"
            f" than the {longest:g} s that are bridged; bridge more, cut the recording there or"
            " leave the column out."
        )
    bridged = int(known[-1] - known[0] + 1 - known.size)
    warnings.append(
        f"{entry.column}, mapped as {entry.channel}, has no number in {bridged} samples; the gaps,"
        f" up to {spans[widest]:.3g} s, were bridged by straight lines."
    )
