"""OpenCRG roads, by pyopencrg: heights along two tracks beside the reference line.

The columns are x, the distance along the reference line from its beginning, and the grid's height
at v = left and at v = right, m, linear between the long sections. It counts from the reference
line: where the line turns, climbs or banks is not taken, as the car is driven straight and level,
and a sentence says so. NaN is what a scan lacks.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeasurementError
from .listing import MOST_SAMPLES, plain
from .table import Array, Column, Table

LARGEST = 1_000_000_000
"""Longest OpenCRG file, bytes."""

_DAMAGE = ("multiple of", "not correctly padded", "truncated")
_SHORT = re.compile(r"gives (\d+) cross sections but the file has (\d+)")


class CrgFile(Table):
    """The two wheel tracks of an OpenCRG road."""

    def __init__(self, path: Path, source: str, kind: str, options: Mapping[str, float]):
        import pyopencrg
        from pyopencrg.io import CrgFormatError

        self.source, self.kind, self.comment = source, kind, ""
        with path.open("rb") as stream:
            head = stream.read(200_000)
        if b"$ROAD_CRG_FILE" in head:
            raise MeasurementError(
                f"{source}: this OpenCRG file holds no road but names another file, which is not"
                " opened; give that one."
            )
        if path.stat().st_size > LARGEST:
            raise MeasurementError(
                f"{source}: an OpenCRG file of more than {LARGEST / 1e9:g} GB is not read; crop it."
            )
        try:
            road = pyopencrg.read(str(path))
        except (pyopencrg.CrgCheckError, CrgFormatError) as error:
            raise self._refused(str(error).removeprefix(f"{path}: ")) from error
        for said in road.read_warnings:
            if (found := _SHORT.search(said)) and int(found[2]) < int(found[1]):
                raise MeasurementError(
                    f"{source}: the file holds {found[2]} of the {found[1]} cross sections that it"
                    " declares; it is cut short, so transfer it again."
                )
        left, right = options["left"], options["right"]
        if not road.v_min <= right < left <= road.v_max:
            raise MeasurementError(
                f"{source}: the road reaches from v = {road.v_min:g} to {road.v_max:g} m across,"
                f" but the wheels run at {right:g} and {left:g} m; choose a smaller track."
            )
        if road.nu > MOST_SAMPLES:
            raise MeasurementError(
                f"{source}: the road has {road.nu} cross sections, more than {MOST_SAMPLES}; crop"
                " it."
            )
        u = np.asarray(road.u, dtype=np.float64)
        tracks = [road.uv_to_z(u, np.full_like(u, v), grid_only=True) for v in (left, right)]
        self._numbers = [u - u[0], *tracks]
        self.columns = tuple(Column(name, "m", len(u)) for name in ("x", "left", "right"))
        self.warnings = (*_ignored(road, source),)

    def _refused(self, said: str) -> MeasurementError:
        if any(mark in said for mark in _DAMAGE):
            return MeasurementError(
                f"{self.source}: the binary heights of this OpenCRG file are damaged, as a"
                " conversion of its line ends or a transfer cut short does; transfer it again in"
                " binary mode."
            )
        first = next((line for line in said.splitlines()[1:] if line.strip()), said)
        shown = plain(first.strip(" -").removeprefix("(reading) ").partition(" (use one")[0])[:150]
        return MeasurementError(
            f"{self.source}: this is no sound OpenCRG road: {shown}; export it again."
        )

    def values(self, index: int) -> Array:
        """One column."""
        return np.ascontiguousarray(self._numbers[index], dtype=np.float64)


def _ignored(road: Any, source: str) -> list[str]:
    """A sentence on what the reference line does and the two tracks do not."""
    does = []
    if not road.is_straight:
        turned = float(np.degrees(np.ptp(np.unwrap(road.phi))))
        does.append(f"turns by up to {turned:.3g} deg")
    for what, values in (("climbs", road.slope), ("banks", road.banking)):
        steepest = float(np.max(np.abs(values), initial=0.0))
        if steepest > 0.0:
            does.append(f"{what} by up to {100.0 * steepest:.3g} %")
    if not does:
        return []
    return [
        f"{source}: the road {', '.join(does)}; it is driven straight and level, with the heights"
        " over its reference line."
    ]
