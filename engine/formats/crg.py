"""OpenCRG roads, by pyopencrg: heights along two tracks beside the reference line.

The columns are u, the distance along the reference line, and z at v = left and v = right, m. z is
the surface's: the grid's height by linear interpolation across it, the reference line's own height
and its banking included. Where the reference line points is not taken. NaN is what the scan lacks.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import MeasurementError
from .listing import MOST_SAMPLES
from .table import Array, Column, Table

HALF_TRACK = 0.75
"""How far left and right of the reference line the wheels run unless it is told, m."""

LARGEST = 1_000_000_000
"""Longest OpenCRG file, bytes."""

DECLARED = 4096
"""Bytes of a file that must hold its definition's beginning."""

_DAMAGE = ("multiple of", "not correctly padded", "truncated")


class CrgFile(Table):
    """The two wheel tracks of an OpenCRG road."""

    def __init__(self, path: Path, source: str, kind: str, options: Mapping[str, float]):
        import pyopencrg

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
        except pyopencrg.CrgCheckError as error:
            raise self._refused(str(error), head) from error
        left, right = options.get("left", HALF_TRACK), options.get("right", -HALF_TRACK)
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
        self._numbers = [
            u - u[0],
            *(road.uv_to_z(u, np.full_like(u, v)) for v in (left, right)),
        ]
        self.columns = tuple(Column(name, "m", len(u)) for name in ("x", "left", "right"))
        self.warnings = (*_ignored(road, source),)

    def _refused(self, said: str, head: bytes) -> MeasurementError:
        if any(mark in said for mark in _DAMAGE):
            ends = (
                "; its line ends were converted as if it were text"
                if b"\r" in head or b"\n" not in head[80:]
                else ""
            )
            remedy = "transfer the file again in binary mode"
            return MeasurementError(
                f"{self.source}: the binary heights of this OpenCRG file are damaged, as by a"
                f" conversion of line ends or a transfer cut short{ends}; {remedy}."
            )
        first = next((line for line in said.splitlines()[1:] if line.strip()), said)
        return MeasurementError(
            f"{self.source}: this is no sound OpenCRG road ({first.strip(' -')[:150]}); export it"
            " again."
        )

    def values(self, index: int) -> Array:
        """One column."""
        return np.ascontiguousarray(self._numbers[index], dtype=np.float64)


def _ignored(road, source: str) -> list[str]:
    """Sentences on what the reference line does that the two tracks do not keep."""
    if road.is_straight:
        return []
    turned = float(np.degrees(np.ptp(np.unwrap(road.phi))))
    return [
        f"{source}: the reference line turns by {turned:.3g} deg; the road is driven straight,"
        " its heights taken along the line."
    ]
