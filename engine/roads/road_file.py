"""Road files: CSV with the columns `x [m]`, `left [m]` and `right [m]`, in any order and unit.

The points are joined by a monotone C1 cubic (PCHIP), which never leaves the range of the two
heights beside it: a kerb stays a kerb, where a C2 spline would ring. X need not be uniform: the
cubic is then sampled on a uniform grid whose spacing is the file's least one. X = 0 is where the
car's CG stands at the start. Heights count from the road's beginning (the mean of both tracks
there), so a survey's elevations above the sea do as well.

OpenCRG files are read, too: see `formats.crg`. The wheels run half a track beside the reference
line, X = 0 is its beginning, and the spacing is the file's own. What a scan lacks is filled by
straight lines along X where that is short.
"""

import io
import re
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from ..csv_table import LARGEST_FILE, CsvTable
from ..errors import MeasurementError, RoadError
from ..formats.child import ChildTable
from ..formats.readers import HALF_TRACK, ROAD
from ..formats.table import Table
from ..units import UnitError, to_si
from .road import Road

COLUMNS = ("x", "left", "right")

FEWEST_POINTS = 3
"""Fewest points of a road file."""

LONGEST = 100_000.0
"""Longest road that is read, m."""

MOST_POINTS = 1_000_000
"""Most points of the uniform grid; 64 MB of spline coefficients."""

TALLEST = 20.0
"""Greatest height (m) above or below the road's beginning: beyond it, a unit is wrong."""

HIGHEST_STEP, STEEPEST = 0.5, 1.0
"""Greatest rise (m) between two points steeper than the second number: beyond both, a unit is
wrong."""

LONGEST_GAP = 0.2
"""Longest piece (m) of an OpenCRG road without heights that is filled: a tyre's contact is as
long."""

UNIFORM_TOLERANCE = 1e-3
"""X that is within this share of a step of a uniform grid counts as uniform."""

_TITLE = re.compile(r"\s*(?P<name>\w+)\s*(?:[\[(]\s*(?P<unit>.*?)\s*[\])])?\s*")


def read_road(path: str | Path, track: float = 2.0 * HALF_TRACK) -> Road:
    """Read a road file; raises RoadError with the file, the place and the remedy.

    track : how far apart the wheels run on an OpenCRG road, m
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            if stream.read(1) == b"$" or path.suffix.lower() == ".crg":
                return _crg(path, 0.5 * track)
            return _road(stream, path.name)
    except OSError as error:
        raise RoadError(
            f"{path}: the road file cannot be read ({error.strerror}); check the path."
        ) from error


def parse_road(data: bytes, name: str) -> Road:
    """Read the bytes of a road file; `name` heads every message."""
    return _road(io.BytesIO(data), name)


def _road(stream: BinaryIO, source: str) -> Road:
    if stream.seek(0, io.SEEK_END) > LARGEST_FILE:
        raise RoadError(
            f"{source}: the file has more than {LARGEST_FILE / 1e6:.0f} MB; cut the road or thin"
            " it out."
        )
    try:
        table = CsvTable(stream, source)
        columns = _columns(table.header, source)
        x, left, right = table.in_si([(index, factor, 0.0) for index, factor in columns]).T
    except MeasurementError as error:
        raise RoadError(str(error)) from error
    if x.size < FEWEST_POINTS:
        raise RoadError(
            f"{source}: the file holds {x.size} points, at least {FEWEST_POINTS} are needed; give"
            " the profile more points."
        )
    steps = np.diff(x)
    if not np.all(steps > 0.0):
        line = table.line_of(int(np.argmin(steps > 0.0)) + 1)
        raise RoadError(
            f"{source}: line {line}: x does not increase; sort the points by x and remove doubled"
            " ones."
        )
    beginning = 0.5 * (left[0] + right[0])
    left, right = left - beginning, right - beginning
    # What lies between the points neither is higher nor rises more than they do.
    _check_magnitudes(x, left, right, source)
    grid, spacing = _uniform_grid(x, source)
    if grid is not x:
        left, right = PchipInterpolator(x, np.stack([left, right]), axis=1)(grid)
    return Road(float(x[0]), spacing, left, right, name=source, interpolant="monotone")


def _crg(path: Path, half_track: float) -> Road:
    """The two wheel tracks of an OpenCRG road."""
    options = {"left": half_track, "right": -half_track}
    try:
        with ChildTable(path, path.name, kind=ROAD, options=options) as table:
            return crg_road(table)
    except MeasurementError as error:
        raise RoadError(str(error)) from error


def crg_road(table: Table) -> Road:
    """The road in a table of `formats.crg`; RoadError and MeasurementError name the file."""
    source, warnings = table.source, list(table.warnings)
    x, left, right = (table.values(index) for index in range(3))
    if x.size < FEWEST_POINTS:
        raise RoadError(f"{source}: the road has {x.size} cross sections; export a longer one.")
    left, filled_left = _filled(x, left, "left", source)
    right, filled_right = _filled(x, right, "right", source)
    if filled := filled_left + filled_right:
        warnings.append(
            f"{source}: {filled} of {2 * x.size} heights under the wheels are missing; straight"
            " lines fill the gaps."
        )
    beginning = 0.5 * (left[0] + right[0])
    left, right = left - beginning, right - beginning
    _check_magnitudes(x, left, right, source)
    spacing = float(x[-1] - x[0]) / (x.size - 1)
    return Road(0.0, spacing, left, right, source, "monotone", tuple(warnings))


def _filled(x: NDArray, heights: NDArray, side: str, source: str) -> tuple[NDArray, int]:
    """Heights without gaps, and how many were missing; held at both ends, straight between."""
    known = np.flatnonzero(np.isfinite(heights))
    if known.size == 0:
        raise RoadError(
            f"{source}: there are no heights under the {side} wheels; choose another track."
        )
    beside = x[np.concatenate([[0], known, [x.size - 1]])]
    # From one known height to the next, and from either end to the nearest one.
    gaps = np.diff(beside)
    widest = int(np.argmax(gaps))
    if known.size < x.size and gaps[widest] > LONGEST_GAP + float(np.median(np.diff(x))):
        raise RoadError(
            f"{source}: under the {side} wheels the heights from x = {beside[widest]:g} to"
            f" {beside[widest + 1]:g} m are missing, more than {LONGEST_GAP:g} m in one piece; fill"
            " the gap, crop the road or choose another track."
        )
    return np.interp(x, x[known], heights[known]), int(x.size - known.size)


def _columns(header: list[str], source: str) -> list[tuple[int, float]]:
    """Index and factor to metres of the columns x, left and right."""
    found: dict[str, tuple[int, float]] = {}
    for index, title in enumerate(header):
        match = _TITLE.fullmatch(title)
        name = match["name"].lower() if match else ""
        if name not in COLUMNS:
            continue
        if name in found:
            raise RoadError(
                f"{source}: columns {found[name][0] + 1} and {index + 1} are both {name}; keep one"
                " of them."
            )
        try:
            factor, _ = to_si((match and match["unit"]) or "m", "m")
        except UnitError as error:
            raise RoadError(
                f"{source}: column {index + 1} ({title}): {error}; write a length such as"
                f" {name} [m]."
            ) from error
        found[name] = (index, factor)
    missing = [name for name in COLUMNS if name not in found]
    if missing:
        raise RoadError(
            f"{source}: there is no column {' or '.join(missing)}; begin the file with the line"
            " x [m],left [m],right [m]."
        )
    return [found[name] for name in COLUMNS]


def _check_magnitudes(x: NDArray, left: NDArray, right: NDArray, source: str) -> None:
    """Raise RoadError for a road so long, high or rough that its unit must be wrong."""
    if x[-1] - x[0] > LONGEST:
        raise RoadError(
            f"{source}: the road is {x[-1] - x[0]:g} m long, more than {LONGEST:g} m; check the"
            " unit of x or cut the road."
        )
    for name, heights in (("left", left), ("right", right)):
        highest = float(np.max(np.abs(heights)))
        if highest > TALLEST:
            raise RoadError(
                f"{source}: {name} rises or falls by {highest:g} m, more than {TALLEST:g} m; check"
                f" its unit, e.g. {name} [mm]."
            )
        rises = np.abs(np.diff(heights))
        rises[rises <= STEEPEST * np.diff(x)] = 0.0
        if rises.max() > HIGHEST_STEP:
            at = int(np.argmax(rises))
            raise RoadError(
                f"{source}: {name} rises or falls by {rises[at]:g} m between x = {x[at]:g} and"
                f" {x[at + 1]:g} m; check its unit, e.g. {name} [mm]."
            )


def _uniform_grid(x: NDArray, source: str) -> tuple[NDArray, float]:
    """The file's own x where it is uniform, else a uniform grid as fine as its closest points."""
    steps = np.diff(x)
    mean = float(x[-1] - x[0]) / (x.size - 1)
    if np.max(np.abs(x - np.linspace(x[0], x[-1], x.size))) <= UNIFORM_TOLERANCE * mean:
        return x, mean
    cells = int(np.ceil((x[-1] - x[0]) / steps.min()))
    if cells > MOST_POINTS:
        raise RoadError(
            f"{source}: points as close as {steps.min():g} m would make {cells} cells of the whole"
            f" road, more than {MOST_POINTS}; thin out the closest points."
        )
    grid = np.linspace(x[0], x[-1], cells + 1)
    return grid, float(grid[1] - grid[0])
