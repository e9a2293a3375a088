"""A file of any kind as a table: what it says of its columns, and the numbers of each on demand."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..csv_table import LARGEST_NUMBER
from ..errors import MeasurementError, UnmappedError

Array = NDArray[np.float64]


MOST_NUMBERS = 25_000_000
"""Most numbers read from one file at once: samples times columns in use; 200 MB of memory."""


@dataclass(frozen=True, slots=True)
class Column:
    """What a file says of one column.

    name, unit : as the file has them; unit is "" where it has none
    group : the group, message or data set the column was recorded in
    clock : index of the column that is its time; None where start and step say it
    start, step : first time and time between samples, s, of an evenly sampled column without a
        column of time; step is None where the file tells no time at all
    """

    name: str
    unit: str
    samples: int
    group: str = ""
    clock: int | None = None
    start: float = 0.0
    step: float | None = None
    comment: str = ""


class Table(ABC):
    """An opened file.

    source : the file's name, which heads every message
    kind : what the file is, such as "CSV", "MDF4" or "MAT 5"
    columns : every column of numbers
    warnings : sentences about what is doubtful in the file, or was left out of `columns`
    comment : what the file says of itself as a whole, any text
    """

    source: str
    kind: str
    columns: tuple[Column, ...]
    warnings: tuple[str, ...]
    comment: str

    @abstractmethod
    def values(self, index: int) -> Array:
        """Physical values (samples,) of one column in its unit; may hold NaN.

        Raises MeasurementError naming the file and the column, with the remedy.
        """

    def part(self, index: int, begin: int, count: int) -> Array:
        """Some samples of one column, which need not load the others."""
        return self.values(index)[begin : begin + count]

    def titles(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of every column, known before its samples are counted."""
        return tuple((column.name, column.unit) for column in self.columns)

    def place(self, row: int) -> str:
        """Where a sample, counted from 0, stands in the file."""
        return f"sample {row + 1}"

    def in_si(self, columns: Sequence[tuple[int, float, float]]) -> Array:
        """Numbers (samples, len(columns)) as factor * number + offset, all finite.

        columns : index, factor and offset of each, all of one length
        """
        samples = self.columns[columns[0][0]].samples
        if samples * len(columns) > MOST_NUMBERS:
            raise MeasurementError(
                f"{self.source}: more than {MOST_NUMBERS // len(columns)} samples of"
                f" {len(columns)} columns; cut the recording or thin it out."
            )
        numbers = np.empty((samples, len(columns)))
        for place, (index, factor, offset) in enumerate(columns):
            values = self.values(index)
            with np.errstate(over="ignore", invalid="ignore"):
                numbers[:, place] = factor * values + offset
            finite = np.abs(numbers[:, place]) < LARGEST_NUMBER
            if not finite.all():
                raise self._not_finite(index, values, int(np.argmin(finite)))
        return numbers

    def _not_finite(self, index: int, values: Array, row: int) -> MeasurementError:
        what, error = "is not a finite number; repair it or cut the recording there", UnmappedError
        if np.isfinite(values[row]):
            what, error = "is too large; correct it or the column's unit", MeasurementError
        return error(
            f"{self.source}: {self.place(row)}, column {self.columns[index].name}: {values[row]:g}"
            f" {what}."
        )


@dataclass(frozen=True, eq=False)
class HeldTable(Table):
    """A table whose numbers are in memory.

    numbers : for each column its values (samples,), or None of a column that was not loaded
    """

    source: str
    kind: str
    columns: tuple[Column, ...]
    numbers: Sequence[Array | None]
    warnings: tuple[str, ...] = ()
    comment: str = ""

    def values(self, index: int) -> Array:
        """Physical values (samples,) of one column."""
        held = self.numbers[index]
        if held is None:
            raise MeasurementError(
                f"{self.source}: column {index + 1}, {self.columns[index].name}, was not loaded;"
                " ask for it when the file is opened."
            )
        return held
