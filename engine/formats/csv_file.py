"""CSV and other text as a table: the columns are titled `name [unit]`, or carry a row of units."""

import io
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import BinaryIO

from ..csv_table import LARGEST_FILE, CsvTable, split_title
from ..errors import MeasurementError
from .listing import means_time, nearest_clocks
from .table import MOST_NUMBERS, Array, Column, Table


class CsvFile(Table):
    """A text file; its samples are only counted when `columns` is asked for."""

    kind = "CSV"
    comment = ""
    warnings = ()

    def __init__(self, stream: BinaryIO, source: str):
        self.source = source
        size = stream.seek(0, io.SEEK_END)
        if size > LARGEST_FILE:
            raise MeasurementError(
                f"{source}: the file has {size / 1e6:.0f} MB, more than {LARGEST_FILE / 1e6:.0f}"
                " MB; cut the recording or thin it out."
            )
        self._table = CsvTable(stream, source)
        self._whole: tuple[Array, dict[int, MeasurementError]] | None = None

    @classmethod
    def at(cls, path: Path, source: str, kind: str) -> "CsvFile":
        """Open the file at a path; it stays open as long as the table."""
        return cls(path.open("rb"), source)

    def titles(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of every column; s of times of day."""
        parts = map(split_title, self._table.header)
        clocks = self._table.clocks
        return tuple((name, "s" if k in clocks else unit) for k, (name, unit) in enumerate(parts))

    @cached_property
    def columns(self) -> tuple[Column, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Every column of the header."""
        samples, titles = self._table.count(), self.titles()
        clocks = nearest_clocks([((name,), samples) for name, _ in titles])
        if self._table.clocks and not any(means_time(name) for name, _ in titles):
            of_day = min(self._table.clocks)
            clocks = [None if index == of_day else of_day for index in range(len(titles))]
        return tuple(
            Column(name, unit, samples, clock=clock)
            for (name, unit), clock in zip(titles, clocks, strict=True)
        )

    def values(self, index: int) -> Array:
        """The numbers of one column; NaN for an empty cell."""
        if self._whole is None and len(self.columns) * self.columns[0].samples <= MOST_NUMBERS:
            # One pass through the text reads every column as fast as one.
            self._whole = self._table.with_gaps(range(len(self.columns)))
        place = index
        if (read := self._whole) is None:
            place, read = 0, self._table.with_gaps([index])
        numbers, bad = read
        if index in bad:
            raise bad[index]
        return numbers[:, place]

    def place(self, row: int) -> str:
        """The line that holds a sample."""
        return f"line {self._table.line_of(row)}"

    def in_si(self, columns: Sequence[tuple[int, float, float]]) -> Array:
        """Numbers (samples, len(columns)) as factor * number + offset, all finite."""
        return self._table.in_si(columns)
