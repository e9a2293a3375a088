"""RPC III (MTS): rigs and road load data; the header by rpc3, the samples from where they lie.

After the header lie groups of PTS_PER_GROUP samples, within each one channel after the other.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeasurementError
from .listing import CONVERTED, Listing, first_text, line_ends_converted, plain
from .table import Array, Column, Table


class RpcFile(Table):
    """A time history of RPC III."""

    def __init__(self, path: Path, source: str, kind: str):
        import rpc3

        self.source, self.kind, self.comment = source, kind, ""
        try:
            listed: Any = rpc3.read(str(path), header_only=True)
        except rpc3.FileFormatError as error:
            # What stands in place of a number says nothing.
            said = re.sub(r"(Format error for `\w+`)=.*", r"\1", plain(error)).rstrip(".")
            raise MeasurementError(
                f"{source}: this is no sound RPC III file: {said}; export it again."
            ) from error
        channels, facts = listed
        frame, group = int(facts["PTS_PER_FRAME"]), int(facts["PTS_PER_GROUP"])
        whole = facts.get("DATA_TYPE", "SHORT_INTEGER") == "SHORT_INTEGER"
        samples = int(facts.get("SAMPLES", int(facts["FRAMES"]) * frame))
        listing = Listing(source, kind)
        for number, channel in enumerate(channels):
            column = Column(
                plain(channel.name),
                first_text(channel.unit),
                samples,
                step=float(channel.dt),
            )
            listing.add(column, (number, float(channel.resolution) if whole else 1.0))
        self.columns, self.warnings = listing.columns(), listing.warnings()
        self._places = listing.places
        form = np.dtype("<i2" if whole else "<f4")
        groups = -(-int(facts["FRAMES"]) * frame // group)
        head, declared = 512 * int(facts["NUM_HEADER_BLOCKS"]), groups * len(channels) * group
        file = np.memmap(path, np.uint8, "r")
        end = head + declared * form.itemsize
        surplus = len(file) - end
        if surplus and surplus == line_ends_converted(file):
            raise MeasurementError(f"{source}: {CONVERTED}.")
        self._data = file[head:end].view(form).reshape(groups, len(channels), group)

    def values(self, index: int) -> Array:
        """The numbers of one channel, scaled."""
        return self.part(index, 0, self.columns[index].samples)

    def part(self, index: int, begin: int, count: int) -> Array:
        """Some numbers of one channel; only the groups that hold them are read."""
        number, scale = self._places[index]
        group = self._data.shape[2]
        first, last = begin // group, -(-(begin + count) // group)
        held = self._data[first:last, number].astype(np.float64).reshape(-1)
        end = min(begin + count, self.columns[index].samples)
        return scale * held[begin - first * group : end - first * group]
