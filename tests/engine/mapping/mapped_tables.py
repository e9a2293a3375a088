"""Tables made of a run that is known, under other names and in other units."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import ridetune.sample_runs
from ridetune.engine.channels import channel
from ridetune.engine.formats.table import Column, HeldTable
from ridetune.engine.mapping.guess import Guess, guess
from ridetune.engine.mapping.survey import survey
from ridetune.engine.measurement import read_run
from ridetune.engine.run import Run
from ridetune.engine.units import to_si

Names = Mapping[str, tuple[str, str, str]]
"""By channel the column's name, the unit it states, and the unit its numbers are in."""


@cache
def truth() -> Run:
    """A recording of a car on an uneven road: every channel moves."""
    return read_run(Path(ridetune.sample_runs.__path__[0]) / "twin/manoeuvre_2.csv")


def held(columns: Mapping[str, tuple[str, np.ndarray]], **common) -> HeldTable:
    """A table of columns, each by its name with unit and numbers, and a column of time if any."""
    time = next((k for k, name in enumerate(columns) if name in ("time", "Time", "Zeit")), None)
    described = tuple(
        Column(name, unit, len(numbers), **{"clock": time if k != time else None, **common})
        for k, (name, (unit, numbers)) in enumerate(columns.items())
    )
    return HeldTable("lap", "CSV", described, [numbers for _, numbers in columns.values()])


def renamed(run: Run, names: Names) -> HeldTable:
    """The run under other names, its numbers in other units."""
    columns = {}
    for one, (name, stated, unit) in names.items():
        factor, offset = to_si(unit, channel(one).unit)
        columns[name] = (stated, (run[one] - offset) / factor)
    return held(columns)


def guessed(table: HeldTable) -> Guess:
    """What is proposed for a table."""
    return survey(table).guess


def guessed_name(name: str, unit: str = "", comment: str = "") -> Guess:
    """What is proposed for a single column by its header alone."""
    return guess([Column(name, unit, 100, comment=comment)], {})


def proposed(name: str, unit: str = "") -> tuple[str, str] | None:
    """(channel, unit) that a header alone is proposed as, None for nothing."""
    one = guessed_name(name, unit).chosen.get(0)
    return one and (one.channel, one.unit)
