"""The columns of a file as a reader finds them, within limits, and what it leaves out."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import MeasurementError
from .table import MOST_NUMBERS, Array, Column

MOST_COLUMNS = 50_000
"""Most columns a file may have."""

MOST_SAMPLES = MOST_NUMBERS
"""Most samples of one column."""

SHORTEST_STEP, LONGEST_STEP, LATEST = 1e-12, 1e6, 1e12
"""Times between two samples, and first time, that are believed, s."""

WIDEST = 64
"""Most columns one array of two dimensions is taken for."""

LONGEST_TEXT = 200
"""Longest name, unit or comment that is kept, characters."""

CONVERTED = (
    "its numbers are damaged by a conversion of line ends, as a transfer of text does; transfer it"
    " again in binary mode"
)
"""The sentence behind a file's name."""

SPENT = ", as a damaged file may; export it again, shorter or with fewer channels"
"""What to do where reading takes too much time or memory."""

_TIME = re.compile(
    r"(time|t|zeit|uhrzeit|temps|timestamps?|time_?s(ec)?|abtastzeit)", re.IGNORECASE
)
_SHOWN = 5
_PIECE = 1 << 20
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]+")
"""Control characters, ends of lines, turns of the direction of writing, halves of characters."""


class Listing:
    """Columns with the places their numbers are read from."""

    def __init__(self, source: str, kind: str):
        self._source, self._kind = source, kind
        self._columns: list[Column] = []
        self._left: dict[str, list[str]] = {}
        self.places: list[Any] = []

    def add(self, column: Column, place: Any) -> int | None:
        """Take a column and where its numbers are; its index, or None where it is left out."""
        if len(self._columns) == MOST_COLUMNS:
            raise MeasurementError(
                f"{self._source}: the file has more than {MOST_COLUMNS} columns; export fewer."
            )
        if not self._takes(column):
            return None
        self._columns.append(_timed(column))
        self.places.append(place)
        return len(self._columns) - 1

    def add_timed(self, found: Iterable[tuple[tuple[str, ...], Column, Any]]) -> None:
        """Take columns, their time the nearest column of time unless they tell their own steps.

        found : path of groups and name, column, and where its numbers are
        """
        # What is left out is no column, and would shift the times of those behind it.
        taken = [(path, _timed(one), place) for path, one, place in found if self._takes(one)]
        clocks = nearest_clocks([(path, column.samples) for path, column, _ in taken])
        for (_, column, place), clock in zip(taken, clocks, strict=True):
            self.add(replace(column, clock=clock if column.step is None else None), place)

    def _takes(self, column: Column) -> bool:
        """Whether a column has as many samples as are read; it is left out where it has not."""
        if column.samples <= 0:
            self.leave_out(column.name, "holds no samples")
        elif column.samples > MOST_SAMPLES:
            self.leave_out(column.name, f"declares more than {MOST_SAMPLES} samples")
        return 0 < column.samples <= MOST_SAMPLES

    def leave_out(self, name: str, why: str) -> None:
        """Note what is not taken for a column, and why."""
        self._left.setdefault(why, []).append(plain(name))

    def columns(self) -> tuple[Column, ...]:
        """All that was found; refused when nothing was."""
        if not self._columns:
            reasons = "; ".join(self._reasons()) or "it holds no numbers"
            raise MeasurementError(
                f"{self._source}: this {self._kind} file has no column of numbers that can be"
                f" read: {reasons}; export the recording again as plain numbers over time."
            )
        return tuple(self._columns)

    def warnings(self) -> tuple[str, ...]:
        """One sentence a reason."""
        return tuple(f"Left out was what cannot be read: {reason}." for reason in self._reasons())

    def _reasons(self) -> list[str]:
        return [f"{_named(names)} {why}" for why, names in self._left.items()]


def _timed(column: Column) -> Column:
    """A column whose step is one, or that tells none."""
    step = column.step
    if step is None or (SHORTEST_STEP < step < LONGEST_STEP and abs(column.start) < LATEST):
        return column
    return replace(column, start=0.0, step=None)


def _named(names: Sequence[str]) -> str:
    shown = ", ".join(name or "a column without a name" for name in names[:_SHOWN])
    return shown + (f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else "")


def plain(text: Any) -> str:
    """A text of a file without control characters, on one line, of bounded length."""
    if isinstance(text, bytes):
        text = text[: 4 * LONGEST_TEXT].decode("utf-8", "replace")
    kept = str(text)[: 4 * LONGEST_TEXT]
    kept = _CONTROL.sub(" ", kept)
    return kept.strip()[:LONGEST_TEXT]


def means_time(name: str) -> bool:
    """Whether a column's name says that it is the time."""
    return bool(_TIME.fullmatch(name.strip()))


def nearest_clocks(found: Sequence[tuple[tuple[str, ...], int]]) -> list[int | None]:
    """For each column the index of its time: named so, of its length, in its group or above.

    found : path of groups and name, and number of samples, of each column
    """
    times: dict[tuple[tuple[str, ...], int], int] = {}
    for index, (path, samples) in enumerate(found):
        if means_time(path[-1]):
            times.setdefault((path[:-1], samples), index)
    clocks = []
    for index, (path, samples) in enumerate(found):
        above = (times.get((path[:depth], samples)) for depth in range(len(path) - 1, -1, -1))
        clock = next((one for one in above if one is not None), None)
        clocks.append(None if clock == index or means_time(path[-1]) else clock)
    return clocks


def numbers(values: Any, since: Any = None) -> Array:
    """An array of any kind of number as float64 (n,); of dates, seconds.

    since : the date that dates count from, a datetime64; their first where it is None
    """
    values = np.asarray(values).reshape(-1)
    if values.dtype.kind == "M":
        values = values - (earliest(values[:1]) if since is None else since)
    if values.dtype.kind == "m":
        seconds = values.astype("timedelta64[ns]").astype(np.float64) * 1e-9
        return np.where(np.isnat(values), np.nan, seconds)
    return np.ascontiguousarray(values, dtype=np.float64)


def earliest(dates: Iterable[Any]) -> Any:
    """The earliest of some datetime64, NaT where there is none."""
    known = [one for one in dates if not np.isnat(one)]
    return min(known) if known else np.datetime64("NaT")


def line_ends_converted(data: Any) -> int:
    """How many bytes a conversion of line ends has put in, where it looks like one; else 0.

    data : bytes of numbers, of which a few line feeds would follow other than a carriage return
    """
    added, last = 0, b""
    for begin in range(0, len(data), _PIECE):
        piece = last + data[begin : begin + _PIECE].tobytes()
        feeds = piece.count(b"\n") - last.count(b"\n")
        if feeds != piece.count(b"\r\n"):
            return 0
        added, last = added + feeds, piece[-1:]
    return added


def first_text(*texts: Any) -> str:
    """The first of some texts that says anything."""
    return next((said for text in texts if (said := plain(text if text is not None else ""))), "")


def matrix_columns(name: str, width: int) -> Iterable[str]:
    """Names of the columns that one array is taken for."""
    return [name] if width == 1 else [f"{name}({k + 1})" for k in range(width)]
