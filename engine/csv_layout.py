"""Where a text file's header is and what parts its cells.

A file of ours begins with its header: the first line that is not blank names the columns, parted
by the comma, semicolon or tab that is found in it most often. Only where the line below it is
neither numbers nor a row of units of as many cells is the layout looked for: the first lines of
numbers under a line of as many texts, of which the lower may hold units. Bars and runs of spaces
are then separators too, and where there are no such lines, some cells may be remarks or dates.
"""

import csv
import re
from collections.abc import Callable, Iterator
from itertools import islice
from typing import NamedTuple

from .time_of_day import is_time_of_day

MOST_LINES = 200
"""Lines of other text that may stand above the header."""

_SEPARATOR_LINE = re.compile(r'"?sep=([,;\t|])"?\s*', re.IGNORECASE)
_NUMBER = re.compile(r"\s*[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?\s*", re.ASCII)
_UNIT_WORD = re.compile(
    r"[munkMcdG\u00b5\u03bc]?(s|m|g|N|V|A|W|J|Pa|Hz|bar|rad|Nm|C|K|l)|min|h|in|ft|mph|kmh|km/h"
    r"|kph|deg[CF]?|\u00b0[CF]?|%|rpm|rev|inch|sec|-|1|lbf?|psi|mg|kp|kgf|mil|g_?n|counts?",
)
_UNIT_PARTS = re.compile(r"[\s*/.\u00b7\u22c5()^\u00b2\u00b3]+|(?<=[a-zA-Z])-?\d\b|\*\*")


class Layout(NamedTuple):
    """The header of a text file.

    line : number of the last line of the header, counted from 1
    titles : its cells, trailing empty ones left off, each with its unit in brackets
    spaces : whether runs of spaces part the cells
    """

    delimiter: str
    line: int
    titles: list[str]
    spaces: bool = False


def find_layout(lines: Iterator[tuple[int, str]]) -> Layout | None:
    """The layout of a file by its lines with their numbers; None where all are blank."""
    filled = ((number, line) for number, line in lines if line.strip())
    head = list(islice(filled, 3))
    separator = None
    if head and (match := _SEPARATOR_LINE.fullmatch(head[0][1])):
        separator, head = match[1], [*head[1:], *islice(filled, 1)]
    if not head:
        return None
    plain = _plain(head, separator)
    if plain is not None:
        return plain
    head += islice(filled, MOST_LINES)
    delimiters = separator or ",;\t|"
    # More columns are better; of as many, the delimiter that comes first; spaces, which names
    # and units may hold, come after them, and rows with remarks or dates last.
    for several, holds in ((delimiters, _is_data), (" ", _is_data), (delimiters, _is_mixed)):
        if several == " " and separator is not None:
            continue
        found = [layout for one in several if (layout := _searched(head, one, holds))]
        if found:
            return max(found, key=lambda layout: len(layout.titles))
    return _first_line(head, separator)


def _first_line(head: list[tuple[int, str]], separator: str | None) -> Layout:
    number, line = head[0]
    if separator is None:
        bare = re.sub(r'"[^"]*"', "", line)
        separator = max(",;\t", key=bare.count)
    return Layout(separator, number, _trimmed(_cells(line, separator)))


def _plain(head: list[tuple[int, str]], separator: str | None) -> Layout | None:
    """The layout of a file that begins with its header, over numbers or one row of units."""
    layout = _first_line(head, separator)
    if len(head) == 1 or any(name.lower().startswith("time") for name in layout.titles):
        below = 1
    else:
        below = 2
    rows = [_trimmed(_cells(line, layout.delimiter)) for _, line in head[1:]]
    if not rows:
        return layout
    if _units(layout.titles, rows[0]):
        return Layout(layout.delimiter, head[1][0], _with_units(layout.titles, rows[0]))
    if below == 1 and len(layout.titles) > 1:
        return layout
    numeric = any(_NUMBER.fullmatch(cell) for cell in rows[0])
    return layout if numeric and len(layout.titles) > 1 and len(rows[0]) >= 2 else None


def _searched(
    head: list[tuple[int, str]], delimiter: str, holds: Callable[[list[str]], bool]
) -> Layout | None:
    """The header above the first two lines that `holds` takes for samples, if the cells are parted
    by `delimiter`.
    """
    rows = [_trimmed(_cells(line, delimiter)) for _, line in head]
    for place in range(1, len(rows)):
        if not all(map(holds, rows[place : place + 2])):
            continue
        width = len(rows[place])
        above, names = rows[place - 1], place - 1
        units = None
        if place >= 2 and _units(rows[place - 2], above):
            units, names = above, place - 2
        titles = [cell.lstrip("#%").strip() for cell in rows[names]]
        if delimiter == " ":
            titles = _joined(titles)
        if len(titles) < width or len(titles) < 2 or _is_mixed(titles):
            return None
        shown = titles if units is None else _with_units(titles, units)
        return Layout(delimiter, head[place - 1][0], shown, delimiter == " ")
    return None


def _joined(words: list[str]) -> list[str]:
    """Titles that spaces part: a unit in brackets belongs to the name before it."""
    titles: list[str] = []
    for word in filter(None, words):
        if titles and word[0] in "[(":
            titles[-1] += f" {word}"
        else:
            titles.append(word)
    return titles


def _cells(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except csv.Error:
        return [cell.strip() for cell in line.split(delimiter)]


def _trimmed(cells: list[str]) -> list[str]:
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _is_data(cells: list[str]) -> bool:
    """Whether every cell that is not empty is a number or a time of day, and at least two are."""
    filled = [cell for cell in cells if cell]
    return len(filled) >= 2 and all(
        _NUMBER.fullmatch(cell) or is_time_of_day(cell) for cell in filled
    )


def _is_mixed(cells: list[str]) -> bool:
    """Whether at least two cells, and half of those that are not empty, are such as in `_is_data`;
    the others may be remarks or dates.
    """
    filled = [cell for cell in cells if cell]
    data = sum(bool(_NUMBER.fullmatch(cell) or is_time_of_day(cell)) for cell in filled)
    return data >= 2 and 2 * data >= len(filled)


def _units(names: list[str], cells: list[str]) -> bool:
    """Whether a row below names holds units: texts alone, all of them of that kind."""
    filled = [cell for cell in cells if cell]
    if not filled or len(cells) > len(names) or len(names) < 2:
        return False
    if any(not name or _NUMBER.fullmatch(name) for name in names):
        return False
    # A 1 or - may be a unit, but a first sample may read 1;-;- just as well.
    numbers = [cell for cell in filled if _NUMBER.fullmatch(cell)]
    words = [cell for cell in filled if cell.strip("[]()- ") and cell not in numbers]
    return bool(words or not numbers) and all(_is_unit(cell) for cell in filled)


def _is_unit(cell: str) -> bool:
    bare = cell.strip("[]() ")
    if cell[:1] in "[(" and cell[-1:] in "])":
        return len(bare) <= 40
    words = [word for word in _UNIT_PARTS.split(bare) if word]
    return bool(words) and len(bare) <= 40 and all(_UNIT_WORD.fullmatch(word) for word in words)


def _with_units(names: list[str], units: list[str]) -> list[str]:
    bare = [unit.strip("[]() ") for unit in units] + [""] * (len(names) - len(units))
    return [
        f"{name} [{unit}]" if unit and unit != "-" and name[-1:] not in "])" else name
        for name, unit in zip(names, bare, strict=True)
    ]
