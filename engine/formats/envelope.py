"""What a long column looks like in few points, without all of it in memory."""

from dataclasses import dataclass

import numpy as np

from .table import Array, Table

WHOLE = 2_000_000
"""Samples up to which every one is looked at; of longer columns, windows are."""

WINDOW = 64
"""Samples of such a window."""


@dataclass(frozen=True, eq=False)
class Envelope:
    """Least and greatest value of a column in stretches of equal length.

    time : of the first sample of each stretch (k,), in the unit of the column's clock, in s of an
        evenly sampled one, else its number
    minimum, maximum : (k,), NaN where a stretch holds no number
    """

    time: Array
    minimum: Array
    maximum: Array


def envelope(table: Table, index: int, points: int) -> Envelope:
    """The envelope of one column in at most so many stretches, none where it has no samples."""
    column = table.columns[index]
    count = min(points, column.samples)
    if not count:
        return Envelope(*np.empty((3, 0)))
    begins = (np.arange(count) * column.samples) // count
    if column.samples <= WHOLE:
        low, high = _extremes(table.values(index), begins)
        time = None if column.clock is None else table.values(column.clock)[begins]
    else:
        stretches = [table.part(index, int(begin), WINDOW) for begin in begins]
        ends = np.cumsum([len(one) for one in stretches])[:-1]
        low, high = _extremes(np.concatenate(stretches), np.append(0, ends))
        time = None
        if column.clock is not None:
            clock = column.clock
            time = np.array([table.part(clock, int(begin), 1)[0] for begin in begins])
    if time is None:
        time = begins.astype(np.float64)
        if column.step is not None:
            time = column.start + column.step * time
    return Envelope(time, low, high)


def _extremes(values: Array, begins) -> tuple[Array, Array]:
    """Extremes between the begins, NaN left aside."""
    low = np.fmin.reduceat(values, begins)
    high = np.fmax.reduceat(values, begins)
    return low, high
