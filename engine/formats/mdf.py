"""MDF 3 and MDF 4 (ASAM), by asammdf: loggers and calibration tools.

Each group of channels has its clock, the master channel, in s. Conversions to physical values are
asammdf's. Channels of text, bytes and arrays are left out, and those that a damaged description
places outside the record, for which asammdf writes and reads beyond its memory. Invalid samples
become NaN.
"""

import html
import re
from pathlib import Path
from typing import Any

import numpy as np

from .listing import MOST_SAMPLES, Listing, first_text, numbers, plain
from .table import Array, Column, Table

_TEXT_CONVERSIONS = {3: {11, 12}, 4: {7, 8, 9, 10}}
"""Types of conversion, by version, whose physical value is a text."""

_TX = re.compile(r"<TX[^>]*>(.*?)</TX>", re.DOTALL)

_PLAIN_DATA = {3: {0, 1, 2, 3, 9, 10, 11, 13, 14, 15, 16}, 4: {0, 1, 2, 3, 4, 5}}
"""Types of data, by version, that are whole numbers or floats."""

_VIRTUAL = {3, 6}
"""Types of channel of MDF 4 that count the samples and take no room in the record."""

_INVALIDATION = 0b10
"""Flag of a channel of MDF 4 that has a bit for invalid samples."""


PACKED = 1032
"""How many times shorter deflate makes what says nothing; asammdf takes memory for whole records
before it looks whether they are there.
"""


class MdfFile(Table):
    """An MDF file of either version."""

    def __init__(self, path: Path, source: str, kind: str):
        from asammdf import MDF

        self.source, self.kind = source, kind
        self._file: Any = MDF(path)
        self._version = 3 if kind == "MDF3" else 4
        self._most_in_a_record = PACKED * path.stat().st_size
        listing = Listing(source, kind)
        for number in range(len(self._file.groups)):
            self._list(listing, number)
        self.columns, self.warnings = listing.columns(), listing.warnings()
        self._places: list[tuple[int, int]] = listing.places
        self.comment = _text(self._file.header.comment)

    def _list(self, listing: Listing, number: int) -> None:
        group = self._file.groups[number]
        samples = int(group.channel_group.cycles_nr)
        named = first_text(
            getattr(group.channel_group, "acq_name", ""), _text(group.channel_group.comment)
        )
        label = named or f"group {number + 1}"
        if samples == 0:
            return
        if group.channel_group.samples_byte_nr > self._most_in_a_record:
            for channel in group.channels:
                listing.leave_out(plain(channel.name), "lies in records longer than the file")
            return
        master, clock = self._file.masters_db.get(number), None
        if master is not None and self._is_clock(group.channels[master], group.channel_group):
            clock = listing.add(
                Column(plain(group.channels[master].name), "s", samples, label), (number, master)
            )
        for index, channel in enumerate(group.channels):
            if index == master and clock is not None:
                continue
            name = plain(channel.name)
            if self._is_text(channel):
                listing.leave_out(name, "holds no plain numbers")
                continue
            if self._is_outside(channel, group.channel_group):
                listing.leave_out(name, "lies outside its record")
                continue
            conversion = channel.conversion
            unit = first_text(conversion.unit if conversion else "", channel.unit)
            column = Column(
                name, unit, samples, label, clock=clock, comment=plain(_text(channel.comment))
            )
            listing.add(column, (number, index))

    def _is_clock(self, channel: Any, record: Any) -> bool:
        is_time = self._version == 3 or channel.sync_type == 1
        return is_time and not self._is_outside(channel, record)

    def _is_outside(self, channel: Any, record: Any) -> bool:
        room = 8 * record.samples_byte_nr
        if self._version == 3:
            begin = channel.start_offset + 8 * getattr(channel, "additional_byte_offset", 0)
            return begin + channel.bit_count > room
        if channel.flags & _INVALIDATION:
            flags = 8 * record.invalidation_bytes_nr
            if 0 < flags <= channel.pos_invalidation_bit:
                return True
        begin = 8 * channel.byte_offset + channel.bit_offset
        return channel.channel_type not in _VIRTUAL and begin + channel.bit_count > room

    def _is_text(self, channel: Any) -> bool:
        conversion = channel.conversion
        return (
            channel.data_type not in _PLAIN_DATA[self._version]
            or (conversion and conversion.conversion_type in _TEXT_CONVERSIONS[self._version])
            or getattr(channel, "component_addr", 0) != 0
        )

    def values(self, index: int) -> Array:
        """Physical values of one channel."""
        return self.part(index, 0, self.columns[index].samples)

    def part(self, index: int, begin: int, count: int) -> Array:
        """Some samples of one channel; only the blocks that hold them are read."""
        group, channel = self._places[index]
        count = min(count, self.columns[index].samples - begin, MOST_SAMPLES)
        samples, invalid = self._file.get(
            group=group,
            index=channel,
            samples_only=True,
            record_offset=begin,
            record_count=count,
            ignore_invalidation_bits=True,
        )
        values = numbers(samples)
        if invalid is not None and len(invalid) == len(values):
            values[np.asarray(invalid, dtype=bool)] = np.nan
        return values


def _text(comment: str | None) -> str:
    """A comment's own text, which MDF 4 may keep in XML."""
    if not (comment or "").lstrip().startswith("<"):
        return comment or ""
    found = _TX.search(comment or "")
    return html.unescape(found[1]) if found else ""
