"""What is in a file, before it is mapped: the numbers of its columns, and the guess."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ..errors import MeasurementError
from ..formats.kinds import CSV
from ..formats.table import Column, Table
from .guess import Guess, guess, named_like_channels, with_template
from .mapping import ChannelMapping, Places, told_apart
from .numbers import Statistics, statistics, unreadable

MOST_SURVEYED = 25_000_000
"""Numbers of a file up to which every column is looked at, not only those that may be channels."""


@dataclass(frozen=True, slots=True)
class Survey:
    """Columns of a file, what their numbers say, and what is proposed for them.

    known : by column, of those whose numbers were read
    doubts : sentences about what is doubtful in the file whatever its columns are taken for
    template : the name of the template whose mapping is proposed in place of a guess, "" for none
    """

    source: str
    kind: str
    columns: tuple[Column, ...]
    known: Mapping[int, Statistics]
    guess: Guess
    doubts: tuple[str, ...]
    template: str = ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about what needs a look, in the file and in what is proposed."""
        return (*self.doubts, *self.guess.warnings)

    def with_templates(self, templates: Mapping[str, ChannelMapping]) -> "Survey":
        """With the first of some templates that fits the columns in place of the guess."""
        places = Places(self.columns)
        for name, one in templates.items():
            if one.fits(places):
                found = with_template(self.guess, self.columns, self.known, one)
                return replace(self, guess=found, template=name)
        return self


def survey(table: Table) -> Survey:
    """What is in a table; text in which no column holds numbers is refused."""
    columns = table.columns
    clocks = {one.clock for one in columns if one.clock is not None}
    wanted = range(len(columns))
    if sum(one.samples for one in columns) > MOST_SURVEYED:
        wanted = sorted({*named_like_channels(columns), *clocks})
    known: dict[int, Statistics] = {}
    unread: dict[int, Statistics] = {}
    bad: list[str] = []
    for index in wanted:
        try:
            known[index] = statistics(table.values(index))
        except MeasurementError as error:
            unread[index] = unreadable(columns[index].samples)
            bad.append(str(error).removeprefix(f"{table.source}: "))
    if len(wanted) == len(columns) and all(one.empty for one in known.values()):
        why = f" ({bad[0].rstrip('.').split('; ')[0]})" if bad else ""
        raise MeasurementError(
            f"{table.source}: no table of numbers was found{why}; export the recording with the"
            " columns' names on one line and a row of numbers a sample."
        )
    found = guess(columns, known | unread, clocks_told=table.kind != CSV)
    doubts = tuple(dict.fromkeys((*table.warnings, *bad)))
    return Survey(table.source, table.kind, told_apart(columns), known, found, doubts)
