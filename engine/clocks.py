"""One time for what several clocks recorded.

The finest clock is kept, or equal steps of a stated length, over the time that all series share;
the others are interpolated linearly between their samples. Clocks that read alike but for the
rounding of a file are one. Where nobody chose the columns, a clock is refused that would lose what
happened between its samples, and so are clocks that hardly overlap.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .csv_table import LARGEST_NUMBER
from .errors import MeasurementError
from .formats.kinds import CSV
from .formats.table import MOST_NUMBERS, Column, Table
from .plausibility import require_increasing
from .units import UnitError, plain_unit, to_si

MOST_RATIO = 10.0
"""Most times a clock's step may be that of the finest where nobody chose the columns."""

LEAST_SHARE = 0.5
"""Least share of the longest record that such clocks must have in common."""

ALIKE = 1e-4
"""Share of a step by which the times of two clocks may differ and still be the same."""

ROUNDING = 1e-6
"""Share of a step by which a text file's times may be off."""

Array = NDArray[np.float64]
Way = tuple[int, float, float]


@dataclass(frozen=True, slots=True)
class Series:
    """Numbers on their own clock.

    name : what sentences call it
    clock : (samples,) all times, s, increasing; nan where the clock has no number
    time, values : (numbers,) those of the times that have a number, and the numbers
    """

    name: str
    clock: Array
    time: Array
    values: Array

    @property
    def step(self) -> float:
        """Median time between samples, s."""
        return _step(self.clock)


class Clocks:
    """The clocks of a table that were read, each once; those that read alike are one array."""

    def __init__(self, source: str):
        self._source = source
        self._read: dict[object, Array] = {}
        self.warnings: list[str] = []

    def kept(self, key: object, read: Callable[[], Array], names: str) -> Array:
        """The times (samples,) of a clock, s, nan where it has no number.

        key : what tells it from the other clocks of the table;  names : of what it times
        Raises MeasurementError for one that does not increase.
        """
        if key not in self._read:
            time = self._checked(read(), names)
            alike = (one for one in self._read.values() if _alike(one, time))
            self._read[key] = next(alike, time)
        return self._read[key]

    def _checked(self, time: Array, names: str) -> Array:
        time = np.where(np.abs(time) < LARGEST_NUMBER, time, np.nan)
        known = np.flatnonzero(np.isfinite(time))
        if known.size < 2:
            raise MeasurementError(
                f"{self._source}: the time of {names} has fewer than two numbers; record longer"
                " or choose another column for it."
            )
        if lost := time.size - known.size:
            self.warnings.append(
                f"The time of {names} has no number in {lost} of {time.size} samples, which were"
                " left out."
            )
        require_increasing(
            time[known],
            lambda row: f"sample {known[row] + 1}",
            f"{self._source}: the time of {names}",
        )
        return time


def clocks_of(table: Table) -> frozenset[int]:
    """The columns of a table that are the time of others; in text, time is a column like others."""
    if table.kind == CSV:
        return frozenset()
    return frozenset(column.clock for column in table.columns if column.clock is not None)


def clock_key(column: Column) -> tuple:
    """What tells a column's clock from others: a column of time, or start, step and length; empty
    where the file tells no time.
    """
    if column.clock is not None:
        return (column.clock,)
    return () if column.step is None else (column.start, column.step, column.samples)


def even_time(column: Column) -> Array:
    """The times (samples,) of an evenly sampled column, s."""
    assert column.step is not None
    return column.start + column.step * np.arange(column.samples, dtype=np.float64)


def way_of_time(table: Table, index: int) -> Way:
    """A column of time, with the factor and offset that make its numbers s."""
    column = table.columns[index]
    try:
        return (index, *to_si(plain_unit(column.unit) or "s", "s"))
    except UnitError as error:
        raise MeasurementError(
            f"{table.source}: column {index + 1}, {column.name}, is the time, but {error}; write a"
            " unit such as s or ms, or map the column as time with its unit."
        ) from error


def on_one_clock(
    table: Table, ways: Mapping[str, Way]
) -> tuple[Array, dict[str, Array], list[str]]:
    """Time (n,) in s, channels (n,) in SI by name, and sentences on what was interpolated, of
    columns that nobody chose.

    ways : index, factor and offset by channel
    Raises MeasurementError for a channel without a time, and for clocks too different.
    """
    named: dict[tuple, list[str]] = {}
    for name, (index, _, _) in ways.items():
        if not (key := clock_key(table.columns[index])):
            raise MeasurementError(
                f"{table.source}: nothing tells the time of {name}; record a column called time"
                " [s] of its length with it."
            )
        named.setdefault(key, []).append(name)
    clocks, series = Clocks(table.source), []
    for key, names in named.items():
        column = table.columns[ways[names[0]][0]]
        chosen = [ways[name] for name in names]
        if column.clock is None:
            time, values = even_time(column), table.in_si(chosen)
        else:
            numbers = table.in_si([way_of_time(table, column.clock), *chosen])
            time, values = numbers[:, 0], numbers[:, 1:]
        clock = clocks.kept(key, lambda: time, ", ".join(names))
        series += [Series(name, clock, clock, values[:, k]) for k, name in enumerate(names)]
    _refuse_unlike(series, table.source)
    time, values, said = joined(series, table.source)
    return time, dict(zip((one.name for one in series), values, strict=True)), said


def joined(
    series: Sequence[Series], source: str, step: float | None = None
) -> tuple[Array, list[Array], list[str]]:
    """The times (n,) of a run, s, the numbers (n,) of each series at them, and what to tell.

    step : s, where the run is to have equal steps; else its times are those of the finest clock
    Raises MeasurementError where no time has them all, and for absurdly many steps.
    """
    last = max(series, key=lambda one: one.time[0])
    first = min(series, key=lambda one: one.time[-1])
    begin, end = float(last.time[0]), float(first.time[-1])
    if end <= begin:
        raise MeasurementError(
            f"{source}: {first.name} ends at {end:.4g} s and {last.name} begins at {begin:.4g} s,"
            " so that no time has both; leave one of them out."
        )
    finest, said = min(series, key=lambda one: one.step), []
    if step is None:
        time = finest.clock[(finest.clock >= begin) & (finest.clock <= end)]
    else:
        if (end - begin) / step * (1 + len(series)) > MOST_NUMBERS:
            raise MeasurementError(
                f"{source}: steps of {step:g} s over {end - begin:.4g} s are too many; take longer"
                " ones."
            )
        count = int((end - begin) / step * (1.0 + ROUNDING)) + 1
        time = np.minimum(begin + step * np.arange(count), end)
    lost = max(
        max(one.time[-1] for one in series) - end, begin - min(one.time[0] for one in series)
    )
    if lost > 2.0 * max(one.step for one in series):
        said.append(
            f"Only the time from {begin:.4g} to {end:.4g} s has all the columns; the rest was left"
            " out."
        )
    said += _of_interpolation(series, finest, step)
    return time, [np.interp(time, one.time, one.values) for one in series], said


def _of_interpolation(series: Sequence[Series], finest: Series, step: float | None) -> list[str]:
    """Which columns are not at their own times, and where content folds into the run."""
    if step is None:
        used, target = finest.step, f"the times of {finest.name}"
        other = [one for one in series if one.clock is not finest.clock]
    else:
        used, target, other = step, f"equal steps of {step:g} s", list(series)
    said = []
    if other:
        listed = ", ".join(f"{one.name} (every {one.step:.3g} s)" for one in other)
        said.append(f"Interpolated to {target}: {listed}.")
    if folded := [one.name for one in other if one.step < 0.75 * used]:
        said.append(
            f"{', '.join(folded)} {'is' if len(folded) == 1 else 'are'} sampled finer than the"
            f" run; what moves faster than {0.5 / used:.3g} Hz appears at lower frequencies."
        )
    return said


def _refuse_unlike(series: Sequence[Series], source: str) -> None:
    """Refuse clocks that hardly overlap, and one much coarser than the finest."""
    finest = min(series, key=lambda one: one.step)
    ends = [(one.clock[0], one.clock[-1]) for one in series]
    shared = min(end for _, end in ends) - max(begin for begin, _ in ends)
    if shared < LEAST_SHARE * max(end - begin for begin, end in ends):
        apart = {id(one.clock): one for one in series}.values()
        spans = "; ".join(
            f"{one.name} from {one.clock[0]:.4g} to {one.clock[-1]:.4g} s"
            for one in list(apart)[:3]
        )
        raise MeasurementError(
            f"{source}: the clocks of its channels hardly overlap ({spans}); export the channels"
            " over one time."
        )
    for one in series:
        if one.step > MOST_RATIO * finest.step:
            raise MeasurementError(
                f"{source}: {one.name} is sampled every {one.step:.3g} s but {finest.name} every"
                f" {finest.step:.3g} s, more than {MOST_RATIO:g} times as often; export them at"
                " one rate, leave it out, or map the columns."
            )


def _alike(one: Array, other: Array) -> bool:
    """Whether two clocks read alike, but for the rounding of a file."""
    if one.shape != other.shape:
        return False
    timed = np.isfinite(one)
    if not np.array_equal(timed, np.isfinite(other)):
        return False
    return bool(np.all(np.abs(one[timed] - other[timed]) <= ALIKE * _step(one)))


def _step(time: Array) -> float:
    return float(np.median(np.diff(time[np.isfinite(time)])))
