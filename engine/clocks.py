"""One time for the columns of a table that were recorded by several clocks.

The finest clock is kept. Channels of the others are interpolated linearly onto it, within the time
that all of them share; a channel sampled much more coarsely would lose what happened between its
samples and is refused, and so are clocks that hardly overlap.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .errors import MeasurementError
from .formats.kinds import CSV
from .formats.table import Column, Table
from .units import UnitError, to_si

MOST_RATIO = 10.0
"""Most times a clock's step may be that of the finest."""

LEAST_SHARE = 0.5
"""Least share of the longest record that all clocks must have in common."""

ROUNDING = 1e-4
"""Share of a step by which the times of two clocks may differ and still be the same."""

Array = NDArray[np.float64]
Way = tuple[int, float, float]


def clocks_of(table: Table) -> frozenset[int]:
    """The columns of a table that are the time of others; in text, time is a column like others."""
    if table.kind == CSV:
        return frozenset()
    return frozenset(column.clock for column in table.columns if column.clock is not None)


def on_one_clock(
    table: Table, ways: Mapping[str, Way]
) -> tuple[Array, dict[str, Array], list[str]]:
    """Time (n,) in s, channels (n,) in SI by name, and sentences on what was interpolated.

    ways : index, factor and offset by channel
    Raises MeasurementError for a channel without a time, and for clocks too different.
    """
    clocks: dict[tuple, list[str]] = {}
    for name, (index, _, _) in ways.items():
        clocks.setdefault(_clock(table, name, table.columns[index]), []).append(name)
    found: list[tuple[Array, dict[str, Array]]] = []
    for key, names in clocks.items():
        time, values = _read(table, key, [ways[name] for name in names])
        channels = {name: values[:, place] for place, name in enumerate(names)}
        same = next((one for one in found if _same(one[0], time)), None)
        if same is None:
            found.append((time, channels))
        else:
            same[1].update(channels)
    found.sort(key=lambda one: _step(one[0]))
    time, values = found[0]
    if len(found) == 1:
        return time, values, []
    return _joined(table.source, found)


def _clock(table: Table, name: str, column: Column) -> tuple:
    """What tells one clock from another: a column of time, or start, step and length."""
    if column.clock is not None:
        return (column.clock,)
    if column.step is None:
        raise MeasurementError(
            f"{table.source}: nothing tells the time of {name}; record a column called time [s]"
            " of its length with it."
        )
    return (column.start, column.step, column.samples)


def _read(table: Table, key: tuple, ways: list[Way]) -> tuple[Array, Array]:
    """Time (n,) and numbers (n, channels) of one clock."""
    if len(key) == 3:
        start, step, samples = key
        return start + step * np.arange(samples, dtype=np.float64), table.in_si(ways)
    column = table.columns[key[0]]
    try:
        factor, offset = to_si(column.unit or "s", "s")
    except UnitError as error:
        raise MeasurementError(
            f"{table.source}: column {key[0] + 1}, {column.name}, is the time, but {error}; write a"
            " unit such as s or ms."
        ) from error
    numbers = table.in_si([(key[0], factor, offset), *ways])
    return numbers[:, 0], numbers[:, 1:]


def _same(one: Array, other: Array) -> bool:
    """Whether two clocks read alike, but for the rounding of a file."""
    if one.shape != other.shape:
        return False
    return bool(np.all(np.abs(one - other) <= ROUNDING * _step(one)))


def _step(time: Array) -> float:
    return float(np.median(np.diff(time))) if time.size > 1 else np.inf


def _joined(
    source: str, found: list[tuple[Array, dict[str, Array]]]
) -> tuple[Array, dict[str, Array], list[str]]:
    """Everything on the first clock, which is the finest."""
    for time, channels in found:
        if time.size < 2 or not np.all(np.diff(time) > 0.0):
            raise MeasurementError(
                f"{source}: the time of {', '.join(channels)} does not increase; export it again or"
                " leave these channels out."
            )
    time, values = found[0]
    fine, reference = _step(time), next(iter(values))
    begin, end = max(one[0][0] for one in found), min(one[0][-1] for one in found)
    longest = max(one[0][-1] - one[0][0] for one in found)
    if end - begin < LEAST_SHARE * longest:
        spans = "; ".join(
            f"{next(iter(channels))} from {clock[0]:.4g} to {clock[-1]:.4g} s"
            for clock, channels in found[:3]
        )
        raise MeasurementError(
            f"{source}: the clocks of its channels hardly overlap ({spans}); export the channels"
            " over one time."
        )
    said = []
    kept = (time >= begin) & (time <= end)
    joined = {name: one[kept] for name, one in values.items()}
    for clock, channels in found[1:]:
        if _step(clock) > MOST_RATIO * fine:
            raise MeasurementError(
                f"{source}: {', '.join(channels)} is sampled every {_step(clock):.3g} s but"
                f" {reference} every {fine:.3g} s, more than {MOST_RATIO:g} times as often; export"
                " them at one rate or leave it out."
            )
        joined |= {name: np.interp(time[kept], clock, one) for name, one in channels.items()}
        said.append(
            f"{', '.join(channels)}, sampled every {_step(clock):.3g} s by another clock, was"
            f" interpolated linearly onto that of {reference}, every {fine:.3g} s."
        )
    if not kept.all():
        said.append(
            f"The run was cut to the time its clocks share, from {begin:.4g} to {end:.4g} s."
        )
    return time[kept], joined, said
