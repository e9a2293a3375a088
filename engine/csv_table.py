"""A table of numbers in a text file, as spreadsheets and test benches write them.

Read are UTF-8 (with or without its mark), UTF-16 and UTF-32; commas, semicolons or tabs between
the columns, the last two also with decimal commas; quotes, blank lines, Excel's `sep=` line and
any line ending. Times of day count in s from the first. The names may also stand below lines of
other text, above a row of units, and be parted by bars or spaces: see `csv_layout`. The file is
read as a stream and its numbers by numpy, so memory is that of the numbers. Only when numpy
refuses, or reads something that is not finite, is the file gone through once more to name the
first bad cell.
"""

import csv
import io
import math
import re
from array import array
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from functools import partial
from itertools import chain, islice
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from .csv_encoding import find_encoding
from .csv_layout import Layout, find_layout
from .errors import MeasurementError, UnmappedError
from .time_of_day import SecondsFromFirst, is_time_of_day

LARGEST_FILE = 200_000_000
"""Longest file that is read, bytes."""

MOST_COLUMNS = 1000
"""Most columns a file may have."""

MOST_NUMBERS = 25_000_000
"""Most numbers read from one file: samples times columns in use; 200 MB of memory."""

LARGEST_NUMBER = 1e100
"""Beyond it a number is no measurement, and the square of its square no number."""

LONGEST_LINE = 100_000
"""Longest line, characters."""

LONGEST_TITLE = 200
"""Longest title of a column that is taken apart, characters."""

_NO_SAMPLES = "no samples stand below the header; export them with it"
_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)
_DIGITS = re.compile(r"\s*[+-]?[\d.,]*\d[\d.,]*([eE][+-]?\d+)?\s*", re.ASCII)
_WITH_COMMA = re.compile(r"\s*[+-]?\d+,\d+([eE][+-]?\d+)?\s*", re.ASCII)
_THOUSANDS = re.compile(r"\s*[+-]?[1-9]\d{0,2},\d{3}\s*", re.ASCII)
_LOOKED_AT = 1000
"""Lines that are looked at for what a comma between quotes is."""

_TITLE = re.compile(r"\s*(?P<name>[^\[\]()]*?)\s*(?:[\[(]\s*(?P<unit>[^\[\]]*?)\s*[\])])?\s*")
_GAPS = ("", "nan", "-nan", "n/a", "null", "-", "--", "---")
_SWAPPED = ("\u0a0d", "\u0a00")
"""What a line end of UTF-16 is where a byte was put in; no characters of any script."""


class CsvTable:
    """The header of a text file and, on demand, the numbers below it.

    header : texts of the header's cells, trailing empty ones left off
    clocks : the columns of times of day, whose numbers are s from the first
    Raises MeasurementError naming the file, the line and the column, with the remedy.
    """

    def __init__(self, stream: BinaryIO, source: str):
        self._stream = stream
        self._source = source
        self._encoding = find_encoding(stream, source)
        layout = self._layout()
        self._delimiter, self._spaces = layout.delimiter, layout.spaces
        self._header_line, self.header = layout.line, layout.titles
        self._blank = self._delimiter + " \t\r\n\x1a\ufeff"
        self._quoted_decimals = self._delimiter == "," and self._find_quoted_decimals()
        self.clocks: frozenset[int] = frozenset()
        self.clocks = self._find_clocks()

    def numbers(self, columns: Sequence[int]) -> NDArray[np.float64]:
        """The numbers of some columns, (samples, len(columns)), all finite."""
        columns, last = list(columns), (0, "")
        most = MOST_NUMBERS // max(len(columns), 1)

        def texts(rows: Iterator[tuple[int, str]]) -> Iterator[str]:
            nonlocal last
            for count, last in enumerate(rows, start=1):
                if count > most:
                    raise self._refuse(
                        f": more than {most} samples of {len(columns)} columns; cut the recording"
                        " or thin it out",
                        last[0],
                    )
                yield last[1]

        with closing(self._rows(columns)) as rows:
            first = next(rows, None)
            if first is None:
                raise self._refuse(_NO_SAMPLES)
            try:
                table = np.loadtxt(
                    texts(chain([first], rows)),
                    delimiter=self._delimiter,
                    comments=None,
                    usecols=columns,
                    ndmin=2,
                )
            except ValueError as error:
                raise self._bad_cell(columns, *last) from error
        finite = np.isfinite(table).all(axis=1)
        if not finite.all():
            raise self._bad_cell(columns, *self._row(int(np.argmin(finite)), columns))
        return table

    def in_si(self, columns: Sequence[tuple[int, float, float]]) -> NDArray[np.float64]:
        """Numbers (samples, len(columns)) as factor * number + offset, all finite.

        columns : index, factor and offset of each
        """
        indices, factors, offsets = zip(*columns, strict=True)
        table = self.numbers(indices)
        with np.errstate(over="ignore"):
            table *= factors
            table += offsets
        finite = np.abs(table) < LARGEST_NUMBER
        if not finite.all():
            row, column = divmod(int(np.argmin(finite)), len(columns))
            line, text = self._row(row, indices)
            cell = text.split(self._delimiter)[indices[column]]
            remedy = "correct it or the column's unit"
            raise self._bad_number(line, indices[column], cell, remedy, "too large")
        return table

    def with_gaps(
        self, columns: Sequence[int]
    ) -> tuple[NDArray[np.float64], dict[int, MeasurementError]]:
        """The numbers of some columns (samples, len(columns)), NaN where a cell is empty; and by
        column the error of its first cell that holds something else.
        """
        with suppress(MeasurementError):
            return self.numbers(columns), {}
        numbers, bad = array("d"), {}
        for line, text in self._rows(columns, bad):
            cells = text.split(self._delimiter)
            try:
                if "_" in text:  # Python takes 1_000 for a number
                    raise ValueError
                row = [float(cells[column]) for column in columns]
            except ValueError:
                row = [
                    math.nan if column in bad else self._number_or_gap(column, line, text, bad)
                    for column in columns
                ]
            numbers.extend(row)
        return np.frombuffer(numbers, dtype=np.float64).reshape(-1, len(columns)), bad

    def _number_or_gap(
        self, column: int, line: int, text: str, bad: dict[int, MeasurementError]
    ) -> float:
        cell = text.split(self._delimiter)[column].strip()
        if _NUMBER.fullmatch(cell):
            return float(cell)
        if cell.lower() not in _GAPS:
            bad[column] = self._bad_cell([column], line, text)
        return math.nan

    def count(self) -> int:
        """Number of rows with data, at least one."""
        rows = sum(1 for _ in self._rows([]))
        if rows == 0:
            raise self._refuse(_NO_SAMPLES)
        return rows

    def line_of(self, row: int) -> int:
        """The line of the file, counted from 1, that holds a row of `numbers`, counted from 0."""
        return self._row(row, [])[0]

    def _row(self, row: int, columns: Sequence[int]) -> tuple[int, str]:
        return next(islice(self._rows(columns), row, None))

    def _refuse(self, sentence: str, line: int | None = None) -> MeasurementError:
        """The error whose sentence follows the file's name, or the number of the line in it."""
        place = f"{self._source}: " if line is None else f"{self._source}: line {line}"
        return MeasurementError(f"{place}{sentence}.")

    def _text(self) -> io.TextIOWrapper:
        self._stream.seek(0)
        strict = self._encoding == "utf-8-sig"
        errors = "surrogateescape" if strict else "replace"
        return io.TextIOWrapper(self._stream, self._encoding, errors, newline=None)

    def _lines(self) -> Generator[tuple[int, str], None, None]:
        """Every line of the file with its number, counted from 1."""
        text, wide = self._text(), self._encoding.startswith("utf-16")
        try:
            for number, line in enumerate(iter(partial(text.readline, LONGEST_LINE + 1), ""), 1):
                if len(line) > LONGEST_LINE:
                    raise self._refuse(
                        f" is longer than {LONGEST_LINE} characters; export fewer columns, one row"
                        " a sample",
                        number,
                    )
                if wide and (_SWAPPED[0] in line or _SWAPPED[1] in line):
                    raise self._refuse(
                        ": the text is damaged by a conversion of line ends; transfer it again in"
                        " binary mode",
                        number,
                    )
                yield number, line.replace("\u2212", "-")
        finally:
            text.detach()

    def _layout(self) -> Layout:
        """Where the header is, what parts its cells, and their texts."""
        lines = ((number, _mended(line.rstrip("\n"))) for number, line in self._lines())
        with closing(lines):
            layout = find_layout(lines)
        if layout is None:
            raise self._refuse("the file is blank; export the recording again")
        if len(layout.titles) > MOST_COLUMNS:
            raise self._refuse(
                f" names {len(layout.titles)} columns, more than {MOST_COLUMNS}; export fewer",
                layout.line,
            )
        return layout

    def _find_clocks(self) -> frozenset[int]:
        """The columns whose first cell is a time of day; what is wrong there is told later."""
        with suppress(MeasurementError), closing(self._rows([])) as rows:
            _, text = next(rows, (0, ""))
            cells = text.split(self._delimiter)[: len(self.header)]
            return frozenset(index for index, cell in enumerate(cells) if is_time_of_day(cell))
        return frozenset()

    def _rows(
        self, used: Sequence[int], bad: dict[int, MeasurementError] | None = None
    ) -> Generator[tuple[int, str], None, None]:
        """Line number and text of every row with data, quotes and decimal commas resolved.

        used : columns whose cells must be clear
        bad : takes the first error of each of them, in place of an exception; None for exceptions
        """
        delimiter, blank, width = self._delimiter, self._blank, len(self.header)
        commas = delimiter != ","
        clocks = {index: SecondsFromFirst() for index in self.clocks}
        for number, line in self._lines():
            if number <= self._header_line or not line.strip(blank):
                continue
            if self._spaces:
                line = f"{' '.join(line.split())}\n"
            if '"' in line:
                line = self._unquoted(number, line, used, bad)
            if commas and "," in line:
                line = self._pointed(number, line, used, bad)
            if line.count(delimiter) != width - 1:
                self._require_width(number, line)
            if clocks:
                line = self._counted(line, clocks)
            yield number, line

    def _counted(self, line: str, clocks: Mapping[int, SecondsFromFirst]) -> str:
        """A line with seconds for its times of day."""
        cells = line.rstrip("\n").split(self._delimiter)
        for index, clock in clocks.items():
            seconds = clock.of(cells[index])
            cells[index] = cells[index] if seconds is None else f"{seconds:.9f}"
        return self._delimiter.join(cells) + "\n"

    def _unquoted(
        self, number: int, line: str, used: Sequence[int], bad: dict[int, MeasurementError] | None
    ) -> str:
        """A line with its quotes taken off; a separator between quotes is no part of a number,
        unless it is a decimal comma.
        """
        try:
            cells = next(csv.reader([line.rstrip("\n")], delimiter=self._delimiter, strict=True))
        except csv.Error as error:
            raise self._refuse(
                " has a quote that is not closed; close it or remove it", number
            ) from error
        for index, cell in enumerate(cells):
            if self._delimiter in cell:
                if self._quoted_decimals and _WITH_COMMA.fullmatch(cell):
                    cells[index] = cell.replace(",", ".")
                    continue
                remedy = "write numbers with a decimal point and no other sign"
                self._unclear(number, index, cell, remedy, used, bad)
                cells[index] = ""
        return self._delimiter.join(cells) + "\n"

    def _find_quoted_decimals(self) -> bool:
        """Whether commas part the columns, and between quotes are decimal ones: one of the first
        numbers can be nothing else (0,5 but not 1,250), and none has a point.
        """
        clear = False
        with suppress(MeasurementError, csv.Error), closing(self._lines()) as lines:
            below = (line for number, line in lines if number > self._header_line)
            for cell in chain.from_iterable(csv.reader(islice(below, _LOOKED_AT), strict=True)):
                if _DIGITS.fullmatch(cell) and ("." in cell or cell.count(",") > 1):
                    return False
                clear |= bool(_WITH_COMMA.fullmatch(cell) and not _THOUSANDS.fullmatch(cell))
        return clear

    def _pointed(
        self, number: int, line: str, used: Sequence[int], bad: dict[int, MeasurementError] | None
    ) -> str:
        """A line with decimal points for its decimal commas; a number with a point beside them may
        have it for its thousands.
        """
        if "." not in line:
            return line.replace(",", ".")
        cells = line.rstrip("\n").split(self._delimiter)
        if not any("," in cell and _DIGITS.fullmatch(cell) for cell in cells):
            return line  # commas in texts alone
        for index, cell in enumerate(cells):
            if "." in cell and _DIGITS.fullmatch(cell) and ("," in cell or cell.count(".") == 1):
                remedy = (
                    "the line mixes decimal commas and points; write one of them and no thousands"
                    " separators"
                )
                self._unclear(number, index, cell, remedy, used, bad)
                cell = ""
            cells[index] = cell.replace(",", ".")
        return self._delimiter.join(cells) + "\n"

    def _unclear(
        self,
        number: int,
        index: int,
        cell: str,
        remedy: str,
        used: Sequence[int],
        bad: dict[int, MeasurementError] | None,
    ) -> None:
        """Refuse a cell that is used, or note that its column has such a one."""
        if index not in used:
            return
        error = self._bad_number(number, index, cell, remedy)
        if bad is None:
            raise error
        bad.setdefault(index, error)

    def _require_width(self, number: int, line: str) -> None:
        """Refuse a row with another number of cells than the header; empty ones may trail."""
        cells, width = line.split(self._delimiter), len(self.header)
        if len(cells) > width and not any(cell.strip() for cell in cells[width:]):
            return
        if not any(map(is_number, cells)):  # prose, not a row that lacks a cell
            raise self._refuse(
                " holds no number; give the columns' names on one line and below it nothing but"
                " rows of numbers",
                number,
            )
        hint = ""
        if self._delimiter == "," and len(cells) > width:
            hint = " (with decimal commas, separate the columns by semicolons)"
        raise self._refuse(
            f" holds {len(cells)} cells where the header names {width} columns; complete the line"
            f" or remove it{hint}",
            number,
        )

    def _bad_cell(self, columns: Sequence[int], line: int, text: str) -> MeasurementError:
        """The sentence about the first cell of a line that holds no finite number; UnmappedError
        for a gap.
        """
        cells = text.split(self._delimiter)
        uneven = "(samples need not be evenly spaced)"
        for index in columns:
            cell = cells[index].strip()
            if not cell:
                said = self._refuse(
                    f", column {self._title(index)}: the cell is empty; fill it or remove the line"
                    f" {uneven}",
                    line,
                )
                return UnmappedError(str(said))
            bare, remedy = cell.lower().lstrip("+-"), f"repair it or remove the line {uneven}"
            if bare in ("nan", "inf", "infinity"):
                said = self._bad_number(line, index, cell, remedy, "not finite")
                return UnmappedError(str(said)) if bare == "nan" else said
            if cell.lower() in _GAPS:
                return UnmappedError(str(self._bad_number(line, index, cell, remedy)))
            if not _NUMBER.fullmatch(cell):
                return self._bad_number(line, index, cell, "write a plain decimal number")
            if math.isinf(float(cell)):
                remedy = "correct it or remove the line"
                return self._bad_number(line, index, cell, remedy, "too large")
        return self._refuse(" cannot be read; correct it or remove it", line)

    def _bad_number(
        self, line: int, index: int, cell: str, remedy: str, what: str = "not a number"
    ) -> MeasurementError:
        text = "".join(one if one.isprintable() else "\ufffd" for one in cell.strip())
        text = text if len(text) <= 30 else f"{text[:27]}..."
        return self._refuse(f", column {self._title(index)}: '{text}' is {what}; {remedy}", line)

    def _title(self, index: int) -> str:
        return self.header[index][:LONGEST_TITLE] or f"number {index + 1}"


def _mended(line: str) -> str:
    """A header line in which bytes that are not UTF-8 are read as Windows wrote them."""
    try:
        line.encode("utf-8")
    except UnicodeEncodeError:
        return line.encode("utf-8", "surrogateescape").decode("cp1252", "replace")
    return line


def split_title(title: str) -> tuple[str, str]:
    """Name and unit of a column's title `name [unit]` or `name (unit)`; "" where none is given."""
    match = _TITLE.fullmatch(title) if len(title) <= LONGEST_TITLE else None
    return (match["name"], match["unit"] or "") if match else (title, "")


def is_number(text: str) -> bool:
    """Whether a cell holds a plain decimal number, with a decimal point or comma."""
    return bool(_NUMBER.fullmatch(text.replace(",", ".")))
