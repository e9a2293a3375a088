"""A table and a mapping become a Run in SI, with the checks of any measurement.

Every column has a clock: the column mapped as time, where it is of the same group and length, else
what the file says is its time. Where the clocks are not the same, the run takes the finest one, or
equal steps of a stated length, over the time that all columns share, and the others are
interpolated between their samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..channels import ChannelInfo, Run, channel
from ..csv_table import MOST_NUMBERS
from ..errors import MeasurementError
from ..formats.table import Table, time_of
from ..plausibility import (
    doubtful_magnitude,
    doubtful_time,
    require_increasing,
    require_samples,
)
from ..run_notes import checked_noise, doubtful_noise
from ..units import UnitError, to_si
from .mapping import ChannelMapping, MappedColumn, Places
from .numbers import statistics
from .sizes import plain_unit

Array = NDArray[np.float64]

ROUNDING = 1e-6
"""Share of a gap's length by which a text file's times may be off."""


@dataclass(frozen=True, slots=True)
class _Series:
    """One channel on its own clock: all times, and those that have values, which are in SI."""

    entry: MappedColumn
    info: ChannelInfo
    clock: Array
    time: Array
    values: Array

    @property
    def step(self) -> float:
        """Median time between samples, s."""
        return float(np.median(np.diff(self.clock)))


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
    clocks = _Clocks(table, found.pop("time", None), mapping.step)
    if not found:
        raise MeasurementError(f"{source}: the mapping names no channel besides time; map some.")
    warnings = list(table.warnings)
    series = [
        _series(table, entry, index, clocks.of(entry, index), mapping.longest_gap, warnings)
        for entry, index in found.values()
    ]
    warnings += clocks.warnings
    if clocks.assumed:
        warnings.append(
            f"The file tells no time; its samples were taken every {mapping.step:g} s, as the"
            " mapping says."
        )
    step = None if clocks.assumed else mapping.step
    time = _common_time(series, step, source, warnings)
    require_samples(time.size, source)
    warnings += doubtful_time(time)
    values = {}
    for one in series:
        values[one.info.name] = np.interp(time, one.time, one.values)
        factor, _ = to_si(one.entry.unit, one.info.unit)
        warnings += doubtful_magnitude(
            one.info, one.entry.unit, factor, time, values[one.info.name]
        )
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
            group = f" in the group {entry.group!r}" if entry.group else ""
            what = f"has {len(where)} columns" if where else "has no column"
            remedy = "name its group" if where else "map another one"
            raise MeasurementError(
                f"{table.source}: the file {what} called {entry.column!r}{group}, which the"
                f" mapping takes for {entry.channel}; {remedy}."
            )
        other = taken.setdefault(where[0], entry)
        if other is not entry:
            raise MeasurementError(
                f"{table.source}: the file has one column called {entry.column!r}, which the"
                f" mapping takes for {other.channel} (group {other.group!r}) and for"
                f" {entry.channel} (group {entry.group!r}); keep one of them."
            )
        found[entry.channel] = entry, where[0]
    return found


class _Clocks:
    """The times of the columns, s, each read and checked once.

    step : time between the samples where nothing in the file tells any time, s
    assumed : whether it was needed
    """

    def __init__(self, table: Table, mapped: tuple[MappedColumn, int] | None, step: float | None):
        self._table, self._step, self.assumed = table, step, False
        self._entry, self._index = mapped or (None, -1)
        self._read: dict[object, Array] = {}
        self.warnings: list[str] = []

    def of(self, entry: MappedColumn, index: int) -> Array:
        """The time (samples,) of a column; nan where its clock has no number."""
        columns = self._table.columns
        one, mapped = columns[index], columns[self._index] if self._entry else None
        alike = mapped is not None and mapped.samples == one.samples
        if alike and mapped and (one.clock == self._index or one.group == mapped.group):
            return self._kept("mapped", self._mapped)
        own = one.clock if one.clock is not None else (one.start, one.step, one.samples)
        if one.clock is not None or one.step is not None:
            return self._kept(own, lambda: self._own(index))
        if alike:
            return self._kept("mapped", self._mapped)
        step, untimed = self._step, all(c.clock is None and c.step is None for c in columns)
        if step is not None and untimed and mapped is None:
            self.assumed = True
            return self._kept(one.samples, lambda: step * np.arange(one.samples, dtype=float))
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

    def _kept(self, key: object, read) -> Array:
        if key not in self._read:
            self._read[key] = self._checked(read())
        return self._read[key]

    def _mapped(self) -> Array:
        assert self._entry is not None
        factor, offset = self._entry.to_si()
        return factor * self._table.values(self._index) + offset

    def _own(self, index: int) -> Array:
        time, clock = time_of(self._table, index), self._table.columns[index].clock
        assert time is not None
        unit = "" if clock is None else plain_unit(self._table.columns[clock].unit)
        if clock is None or not unit:
            return time
        try:
            factor, offset = to_si(unit, "s")
        except UnitError as error:
            raise MeasurementError(
                f"{self._table.source}: {self._table.columns[clock].name}, the time of"
                f" {self._table.columns[index].name}: {error}; map it as time with its unit."
            ) from error
        return factor * time + offset

    def _checked(self, time: Array) -> Array:
        """The time, refused where its numbers do not increase."""
        known = np.flatnonzero(np.isfinite(time))
        if known.size < 2:
            raise MeasurementError(
                f"{self._table.source}: the time has fewer than two numbers; map another column."
            )
        if lost := time.size - known.size:
            self.warnings.append(
                f"The time has no number in {lost} of {time.size} samples, which were left out."
            )
        require_increasing(time[known], lambda row: f"sample {known[row] + 1}", self._table.source)
        return time


def _series(
    table: Table,
    entry: MappedColumn,
    index: int,
    time: Array,
    longest_gap: float,
    warnings: list[str],
) -> _Series:
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
    if not np.isfinite(numbers).all():
        raise MeasurementError(f"{place} holds a number too large for its unit; correct it.")
    if numbers.min() == numbers.max():
        warnings.append(f"{entry.column}, mapped as {entry.channel}, never changes.")
    return _Series(entry, channel(entry.channel), time[timed], time[measured], numbers)


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


def _common_time(
    series: Sequence[_Series], step: float | None, source: str, warnings: list[str]
) -> Array:
    """The times (samples,) of the run, s: over what all channels share."""
    last, first = (
        max(series, key=lambda one: one.time[0]),
        min(series, key=lambda one: one.time[-1]),
    )
    begin, end = float(last.time[0]), float(first.time[-1])
    if end <= begin:
        raise MeasurementError(
            f"{source}: {first.entry.column} ends at {end:.4g} s and {last.entry.column} begins at"
            f" {begin:.4g} s, so that no time has all the mapped columns; leave one of them out."
        )
    finest = min(series, key=lambda one: one.step)
    if step is None:
        within = (finest.clock >= begin) & (finest.clock <= end)
        time, used = finest.clock[within], finest.step
    else:
        if (end - begin) / step * (1 + len(series)) > MOST_NUMBERS:
            raise MeasurementError(
                f"{source}: steps of {step:g} s over {end - begin:.4g} s are too many; take longer"
                " ones."
            )
        count = int((end - begin) / step * (1.0 + ROUNDING)) + 1
        time, used = np.minimum(begin + step * np.arange(count), end), step
    lost = max(
        max(one.time[-1] for one in series) - end, begin - min(one.time[0] for one in series)
    )
    if lost > 2.0 * max(one.step for one in series):
        warnings.append(
            f"Only the time from {begin:.4g} to {end:.4g} s has all the mapped columns; the rest"
            " was left out."
        )
    _warn_of_interpolation(series, finest, step, used, warnings)
    return time


def _warn_of_interpolation(
    series: Sequence[_Series],
    finest: _Series,
    step: float | None,
    used: float,
    warnings: list[str],
) -> None:
    """Say which columns are not at their own times, and where content folds into the run."""
    if step is None:
        other = [one for one in series if not np.array_equal(one.clock, finest.clock)]
        target = f"the times of {finest.entry.column}"
    else:
        other, target = list(series), f"equal steps of {step:g} s"
    if other:
        listed = ", ".join(f"{one.entry.column} (every {one.step:.3g} s)" for one in other)
        warnings.append(f"Interpolated to {target}: {listed}.")
    folded = [one.entry.column for one in other if one.step < 0.75 * used]
    if folded:
        warnings.append(
            f"{', '.join(folded)} {'is' if len(folded) == 1 else 'are'} sampled finer than the"
            f" run; what moves faster than {0.5 / used:.3g} Hz appears at lower frequencies."
        )
