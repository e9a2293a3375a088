"""A file of any kind as a table: what it says of its columns, and the numbers of each on demand."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import MeasurementError


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


class Table(Protocol):
    """An opened file.

    source : the file's name, which heads every message
    kind : what the file is, such as "CSV", "MDF4" or "MAT 5"
    warnings : sentences about what is doubtful in the file, or was left out of `columns`
    """

    @property
    def source(self) -> str:
        """The file's name."""
        ...

    @property
    def kind(self) -> str:
        """What the file is."""
        ...

    @property
    def columns(self) -> tuple[Column, ...]:
        """Every column of numbers."""
        ...

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is doubtful."""
        ...

    def values(self, index: int) -> NDArray[np.float64]:
        """Physical values (samples,) of one column in its unit; may hold NaN.

        Raises MeasurementError naming the file and the column, with the remedy.
        """
        ...


@dataclass(frozen=True, eq=False)
class HeldTable:
    """A table whose numbers are in memory.

    numbers : for each column its values (samples,), or None of a column that was not loaded
    """

    source: str
    kind: str
    columns: tuple[Column, ...]
    numbers: Sequence[NDArray[np.float64] | None]
    warnings: tuple[str, ...] = ()

    def values(self, index: int) -> NDArray[np.float64]:
        """Physical values (samples,) of one column."""
        held = self.numbers[index]
        if held is None:
            raise MeasurementError(
                f"{self.source}: column {index + 1}, {self.columns[index].name}, was not loaded;"
                " ask for it when the file is opened."
            )
        return held


def time_of(table: Table, index: int) -> NDArray[np.float64] | None:
    """The time (samples,) of one column as its file has it; None where the file tells none.

    It is in the unit of the column of time where there is one, else in s.
    """
    column = table.columns[index]
    if column.clock is not None:
        return table.values(column.clock)
    if column.step is None:
        return None
    return column.start + column.step * np.arange(column.samples, dtype=np.float64)
