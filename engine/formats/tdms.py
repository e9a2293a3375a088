"""TDMS (National Instruments), by npTDMS: LabVIEW and DAQmx.

The unit is the channel's unit_string, the time its wf_increment, wf_start_offset and wf_start_time
or, where the channel has none, the channel of its group called time. Dates, those at which
waveforms begin among them, count in s from the earliest of the file. Scaling is the file's, done by
npTDMS.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .listing import Listing, earliest, first_text, numbers, plain
from .table import Array, Column, Table


class TdmsTable(Table):
    """A TDMS file, read channel by channel."""

    def __init__(self, path: Path, source: str, kind: str):
        from nptdms import TdmsFile

        self.source, self.kind, self.comment = source, kind, ""
        file = TdmsFile.open(str(path))
        listing, size = Listing(source, kind), path.stat().st_size
        channels = [channel for group in file.groups() for channel in group.channels()]
        taken = []
        for channel in channels:
            if channel.data_type is None or len(channel) == 0:
                listing.leave_out(channel.name, "holds no samples")
            elif channel.dtype.kind not in "iufbM":
                listing.leave_out(channel.name, "holds no plain numbers")
            elif len(channel) > size:  # a sample takes a byte at least
                listing.leave_out(channel.name, "declares more samples than the file holds")
            else:
                taken.append(channel)
        begins = [_begin(one) for one in taken]
        self._since = earliest(begins)
        found, undated = [], []
        for channel, begin in zip(taken, begins, strict=True):
            column = _column(channel)
            if column.step is not None and not np.isnat(begin):
                later = float((begin - self._since) / np.timedelta64(1, "ns")) * 1e-9
                column = replace(column, start=column.start + later)
            elif column.step is not None and not np.isnat(self._since):
                undated.append(column.name)
            found.append((_path(channel), column, channel))
        listing.add_timed(found)
        self.columns, self.warnings = listing.columns(), listing.warnings()
        if undated:
            self.warnings += (
                f"When {', '.join(undated[:5])} began (wf_start_time) is not stated, unlike that of"
                " other channels; it is taken to be when the first of them began.",
            )
        self._channels = listing.places

    def values(self, index: int) -> Array:
        """Scaled values of one channel."""
        return numbers(self._channels[index].read_data(scaled=True), self._since)

    def part(self, index: int, begin: int, count: int) -> Array:
        """Some scaled values of one channel."""
        read = self._channels[index].read_data(offset=begin, length=count, scaled=True)
        return numbers(read, self._since)


def _begin(channel: Any) -> np.datetime64:
    """When a channel begins, NaT where nothing tells: its first date, or what its waveform says."""
    if channel.dtype.kind == "M":
        return earliest(channel.read_data(offset=0, length=1))
    said = channel.properties.get("wf_start_time")
    # LabVIEW's zero is 1904.
    if not isinstance(said, np.datetime64) or said < np.datetime64("1904-01-02"):
        return np.datetime64("NaT")
    return said


def _path(channel: Any) -> tuple[str, str]:
    return plain(channel.group_name), plain(channel.name)


def _column(channel: Any) -> Column:
    group, name = _path(channel)
    start, step = _waveform(channel.properties)
    comment = first_text(channel.properties.get("description"))
    return Column(
        name, _unit(channel), len(channel), group, start=start, step=step, comment=comment
    )


def _waveform(properties: Any) -> tuple[float, float | None]:
    """First time and step, s, where a channel states them."""
    try:
        step = float(properties["wf_increment"])
        start = float(properties.get("wf_start_offset", 0.0))
    except (KeyError, TypeError, ValueError):
        return 0.0, None
    return (start, step) if math.isfinite(start) and 0.0 < step < math.inf else (0.0, None)


def _unit(channel: Any) -> str:
    if channel.dtype.kind == "M":
        return "s"
    properties = channel.properties
    return first_text(properties.get("unit_string"), properties.get("NI_UnitDescription"))
