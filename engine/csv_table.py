"""A table of numbers in a text file, as spreadsheets and test benches write them.

Read are UTF-8 (with or without its mark), UTF-16 and UTF-32; commas, semicolons or tabs between
the columns, the last two also with decimal commas; quotes, blank lines, Excel's `sep=` line and
any line ending. The names may also stand below lines of other text, above a row of units, and be
parted by bars or spaces: see `csv_layout`. The file is read as a stream and its numbers by numpy,
so memory is that of the numbers. Only when numpy refuses, or reads something that is not finite,
is the file gone through once more to name the first bad cell.
"""

import csv
import io
import math
import re
from array import array
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, suppress
from functools import partial
from itertools import chain, islice
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from .csv_layout import Layout, find_layout
from .errors import MeasurementError

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

_HEAD = 65_536
_NO_SAMPLES = "no samples stand below the header; export them with it"
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x19\x1b-\x1f]")
_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)
_TITLE = re.compile(r"\s*(?P<name>[^\[\]()]*?)\s*(?:[\[(]\s*(?P<unit>[^\[\]]*?)\s*[\])])?\s*")
_GAPS = ("", "nan", "-nan", "n/a", "null")
_SWAPPED = ("\u0a0d", "\u0a00")
"""What a line end of UTF-16 is where a byte was put in; no characters of any script."""

_MARKS = (
    (b"\xff\xfe\x00\x00", "utf-32"),
    (b"\x00\x00\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)


class CsvTable:
    """The header of a text file and, on demand, the numbers below it.

    header : texts of the header's cells, trailing empty ones left off
    Raises MeasurementError naming the file, the line and the column, with the remedy.
    """

    def __init__(self, stream: BinaryIO, source: str):
        self._stream = stream
        self._source = source
        self._encoding = self._find_encoding()
        layout = self._layout()
        self._delimiter, self._spaces = layout.delimiter, layout.spaces
        self._header_line, self.header = layout.line, layout.titles
        self._blank = self._delimiter + " \t\r\n\x1a\ufeff"

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
        for line, text in self._rows(columns):
            cells = text.split(self._delimiter)
            try:
                if "_" in text:  # Python takes 1_000 for a number
                    raise ValueError
                row = [float(cells[column]) for column in columns]
            except ValueError:
                row = [self._number_or_gap(column, line, text, bad) for column in columns]
            numbers.extend(row)
        return np.frombuffer(numbers, dtype=np.float64).reshape(-1, len(columns)), bad

    def _number_or_gap(
        self, column: int, line: int, text: str, bad: dict[int, MeasurementError]
    ) -> float:
        cell = text.split(self._delimiter)[column].strip()
        if _NUMBER.fullmatch(cell):
            return float(cell)
        if cell.lower() not in _GAPS and column not in bad:
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

    def _find_encoding(self) -> str:
        self._stream.seek(0)
        head = self._stream.read(_HEAD)
        if not head.strip():
            raise self._refuse("the file is empty; export the recording again")
        for mark, encoding in _MARKS:
            if head.startswith(mark):
                return encoding
        if head.count(0) > 0.3 * len(head) and not _CONTROL.search(head.replace(b"\0", b"")):
            return "utf-16-le" if head[1::2].count(0) > head[0::2].count(0) else "utf-16-be"
        if head.startswith(b"PK\x03\x04"):
            raise self._refuse(
                "this is a workbook or a zip archive, not text; save the sheet as CSV"
            )
        if _CONTROL.search(head):
            raise self._refuse("this is a binary file, not text; export the recording as CSV")
        return "utf-8-sig"

    def _text(self) -> io.TextIOWrapper:
        self._stream.seek(0)
        strict = self._encoding == "utf-8-sig"
        errors = "surrogateescape" if strict else "replace"
        return io.TextIOWrapper(self._stream, self._encoding, errors, newline=None)

    def _lines(self) -> Iterator[tuple[int, str]]:
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
                yield number, line
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

    def _rows(self, used: Sequence[int]) -> Generator[tuple[int, str], None, None]:
        """Line number and text of every row with data, quotes and decimal commas resolved."""
        delimiter, blank, width = self._delimiter, self._blank, len(self.header)
        commas = delimiter != ","
        for number, line in self._lines():
            if number <= self._header_line or not line.strip(blank):
                continue
            if self._spaces:
                line = f"{' '.join(line.split())}\n"
            if '"' in line:
                line = self._unquoted(number, line, used)
            if commas and "," in line:
                line = self._pointed(number, line, used)
            if line.count(delimiter) != width - 1:
                self._require_width(number, line)
            yield number, line

    def _unquoted(self, number: int, line: str, used: Sequence[int]) -> str:
        """A line with its quotes taken off; a comma between quotes would be an ambiguous number."""
        try:
            cells = next(csv.reader([line.rstrip("\n")], delimiter=self._delimiter, strict=True))
        except csv.Error as error:
            raise self._refuse(
                " has a quote that is not closed; close it or remove it", number
            ) from error
        for index, cell in enumerate(cells):
            if self._delimiter in cell:
                if index in used:
                    raise self._bad_number(
                        number, index, cell, "write numbers with a decimal point and no other sign"
                    )
                cells[index] = ""
        return self._delimiter.join(cells) + "\n"

    def _pointed(self, number: int, line: str, used: Sequence[int]) -> str:
        """A line with decimal points for its decimal commas, if it has no points already."""
        if "." in line:
            cells = line.split(self._delimiter)
            for index in used:
                if index < len(cells) and "." in cells[index]:
                    raise self._bad_number(
                        number,
                        index,
                        cells[index],
                        "the line mixes decimal commas and points; write one of them and no"
                        " thousands separators",
                    )
        return line.replace(",", ".")

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
        """The sentence about the first cell of a line that holds no finite number."""
        cells = text.split(self._delimiter)
        uneven = "(samples need not be evenly spaced)"
        for index in columns:
            cell = cells[index].strip()
            if not cell:
                return self._refuse(
                    f", column {self._title(index)}: the cell is empty; fill it or remove the line"
                    f" {uneven}",
                    line,
                )
            if cell.lower().lstrip("+-") in ("nan", "inf", "infinity"):
                remedy = f"repair it or remove the line {uneven}"
                return self._bad_number(line, index, cell, remedy, "not finite")
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
