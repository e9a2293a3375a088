"""A mapping: which column of a file is which channel, in which unit and with which sign.

It is kept as JSON and used again for every file whose columns have the same names:

    {"columns": [{"column": "Car.Pitch", "group": "", "channel": "chassis.pitch", "unit": "deg",
                  "sign": -1, "gain": 1.0, "missing": [-64], "note": "name and unit",
                  "sign_sure": false}],
     "longest_gap": 0.1, "step": null}
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from ..channels import channel
from ..errors import MeasurementError
from ..formats.table import Column
from ..json_record import RecordReader, record_to_json
from ..json_text import read_json
from ..units import UnitError, to_si
from ..vehicle import Range

MOST_MAPPED = 1000
"""Most columns of a mapping."""

LONGEST_GAP = 0.1
"""Time without samples that is bridged unless told, s."""


@dataclass(frozen=True, slots=True)
class MappedColumn:
    """One column of a file as a channel.

    unit : what its numbers are in, whatever the file says
    value in SI = sign * (number * gain in `unit`)
    missing : numbers that stand for "nothing measured"; None where nobody has looked for such
        numbers, so that they are refused where there are some
    note : how the entry came about
    sign_sure : whether somebody has confirmed the sign, so that no more doubt of it is told
    """

    column: str
    channel: str
    unit: str
    group: str = ""
    sign: int = 1
    gain: Annotated[float, Range("1", 1e-9, 1e9)] = 1.0
    missing: tuple[float, ...] | None = None
    note: str = ""
    sign_sure: bool = False

    def __post_init__(self) -> None:
        """Refuse a channel, a unit or a sign that does not exist."""
        if self.sign not in (1, -1):
            raise MeasurementError(f"{self.channel}: the sign is {self.sign}; give 1 or -1.")
        self.to_si()

    def to_si(self) -> tuple[float, float]:
        """Factor and offset that turn a number of the column into the channel's SI unit."""
        info = channel(self.channel)
        try:
            factor, offset = to_si(self.unit, info.unit)
        except UnitError as error:
            raise MeasurementError(
                f"{self.channel}: {error}; give a unit of {info.quantity} such as"
                f" {info.display_unit}."
            ) from error
        return self.sign * self.gain * factor, self.sign * offset


@dataclass(frozen=True, slots=True)
class ChannelMapping:
    """Columns as channels, each channel once.

    longest_gap : time between two samples, s, over which missing ones are interpolated
    step : time between the samples of the run, s; None for that of its finest channel
    """

    columns: tuple[MappedColumn, ...]
    longest_gap: Annotated[float, Range("s", 0.0, 10.0)] = LONGEST_GAP
    step: Annotated[float, Range("s", 1e-5, 1.0)] | None = None

    def __post_init__(self) -> None:
        """Refuse a channel or a column that is taken twice."""
        if len(self.columns) > MOST_MAPPED:
            raise MeasurementError(f"columns are more than {MOST_MAPPED}; map those that are used.")
        channels: dict[str, str] = {}
        columns: dict[tuple[str, str], str] = {}
        for one in self.columns:
            if one.channel in channels:
                raise MeasurementError(
                    f"columns {channels[one.channel]} and {one.column} are both {one.channel};"
                    " keep one of them."
                )
            if (one.group, one.column) in columns:
                raise MeasurementError(
                    f"column {one.column} is both {columns[one.group, one.column]} and"
                    f" {one.channel}; keep one of them."
                )
            channels[one.channel] = one.column
            columns[one.group, one.column] = one.channel

    @property
    def sure_signs(self) -> frozenset[str]:
        """Channels whose signs somebody has confirmed."""
        return frozenset(one.channel for one in self.columns if one.sign_sure)

    def flipped(self, channels: Collection[str]) -> "ChannelMapping":
        """With the signs of some channels turned over, which nobody has confirmed yet."""
        return replace(
            self,
            columns=tuple(
                replace(one, sign=-one.sign, sign_sure=False) if one.channel in channels else one
                for one in self.columns
            ),
        )

    def fits(self, columns: "Places") -> bool:
        """Whether a file has every column, each another one."""
        found = [columns.of(one.column, one.group) for one in self.columns]
        alone = {where[0] for where in found if len(where) == 1}
        return bool(found) and len(alone) == len(found)


def told_apart(columns: Sequence[Column]) -> tuple[Column, ...]:
    """Columns of which those of one name and group are numbered: z, z (2), z (3)."""
    taken = {(one.group, one.name) for one in columns}
    seen: dict[tuple[str, str], int] = {}
    named = []
    for one in columns:
        key = one.group, one.name
        seen[key] = number = seen.get(key, 0) + 1
        name = one.name
        while number > 1 and (one.group, name) in taken:
            name, number = f"{one.name} ({number})", number + 1
        if name != one.name:
            seen[key] = number - 1
            taken.add((one.group, name))
            one = replace(one, name=name)
        named.append(one)
    return tuple(named)


class Places:
    """Where the columns of a file are, by name, numbered where it is there again, and group."""

    def __init__(self, columns: Sequence[Column]):
        self._named: dict[str, list[int]] = {}
        self._groups = [one.group for one in columns]
        for index, one in enumerate(told_apart(columns)):
            self._named.setdefault(one.name, []).append(index)

    def of(self, name: str, group: str) -> list[int]:
        """Where a column is: in its group, else by its name alone."""
        named = self._named.get(name, [])
        grouped = [index for index in named if self._groups[index] == group]
        return grouped or ([] if group and len(named) > 1 else named)


def read_mapping(path: str | Path) -> ChannelMapping:
    """The mapping in a JSON file; every message starts with the file's name."""
    path = Path(path)
    return mapping_from_json(read_json(path, MeasurementError), path.name)


def mapping_from_json(data: Any, source: str = "mapping") -> ChannelMapping:
    """A mapping from its JSON; `source` heads every message."""
    return RecordReader(source, MeasurementError).record(ChannelMapping, data)


def mapping_to_json(mapping: ChannelMapping) -> Mapping[str, Any]:
    """A mapping as JSON."""
    return record_to_json(mapping)
