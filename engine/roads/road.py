"""Road: the height under the left and the right wheels as a smooth function of distance.

Each side is piecewise cubic through heights on a uniform grid along X (inertial frame, X = 0 is
where the car's centre of gravity stands at t = 0). Its slope is zero at both ends and outside the
height is held, so the road is C1 everywhere. On cell k, with s = (X - start)/spacing - k in [0, 1),

    z = ((c0 s + c1) s + c2) s + c3,    dz/dX = ((3 c0 s + 2 c1) s + c2) / spacing
"""

from dataclasses import dataclass, field
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator

from ..errors import RoadError

Interpolant = Literal["spline", "monotone"]

LEFT, RIGHT = 0, 1
"""Sides of a road, in the order of its coefficients."""


@dataclass(frozen=True, eq=False)
class Road:
    """Two profiles on a uniform grid.

    start : X of the first point, m
    spacing : distance between points, m
    left, right : heights, m, shape (n,), n >= 2
    name : what a chart calls it
    interpolant : "spline" is C2, for heights that are smooth on the grid; "monotone" is C1 and
        never leaves the range of the two heights beside X, for heights that may hold kerbs
    warnings : sentences about what is doubtful in where it comes from
    coefficients : (2, n - 1, 4), C-contiguous; c0 ... c3 of each cell of left and right

    Raises RoadError for heights that are not finite or unequal in number.
    """

    start: float
    spacing: float
    left: NDArray[np.float64]
    right: NDArray[np.float64]
    name: str = ""
    interpolant: Interpolant = "spline"
    warnings: tuple[str, ...] = ()
    coefficients: NDArray[np.float64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the profiles and join their points."""
        profiles = [np.array(side, dtype=float) for side in (self.left, self.right)]
        if profiles[LEFT].ndim != 1 or profiles[LEFT].shape != profiles[RIGHT].shape:
            raise RoadError("A road needs as many heights on the left as on the right.")
        if profiles[LEFT].size < 2:
            raise RoadError("A road needs at least two points; lengthen it.")
        if not np.isfinite(profiles).all():
            raise RoadError("A road's heights must all be finite numbers.")
        if not (np.isfinite(self.start) and 0 < self.spacing < np.inf):
            raise RoadError("A road needs a finite start and a positive spacing.")
        join = level_spline if self.interpolant == "spline" else level_monotone
        cells = np.stack([join(profile) for profile in profiles])
        for array in (*profiles, cells):
            array.flags.writeable = False
        object.__setattr__(self, "left", profiles[LEFT])
        object.__setattr__(self, "right", profiles[RIGHT])
        object.__setattr__(self, "coefficients", cells)

    @classmethod
    @cache
    def flat(cls) -> "Road":
        """Level ground at height 0, as far as any car goes."""
        return cls(start=0.0, spacing=1.0, left=np.zeros(2), right=np.zeros(2), name="flat")

    @property
    def x(self) -> NDArray[np.float64]:
        """X of the grid points, m, shape (n,)."""
        return self.start + self.spacing * np.arange(self.left.size, dtype=np.float64)

    @property
    def end(self) -> float:
        """X of the last point, m."""
        return self.start + self.spacing * (self.left.size - 1)

    def height(self, side: int, x: ArrayLike) -> NDArray[np.float64]:
        """Height of one side at X, m; `side` is LEFT or RIGHT."""
        (c0, c1, c2, c3), s, _ = self._cell(side, x)
        return ((c0 * s + c1) * s + c2) * s + c3

    def slope(self, side: int, x: ArrayLike) -> NDArray[np.float64]:
        """Slope dz/dX of one side at X; zero beyond the ends."""
        (c0, c1, c2, _), s, inside = self._cell(side, x)
        return np.where(inside, ((3.0 * c0 * s + 2.0 * c1) * s + c2) / self.spacing, 0.0)

    def _cell(self, side: int, x: ArrayLike):
        """Coefficients and local coordinate of X, and whether X lies on the grid."""
        position = (np.asarray(x, dtype=float) - self.start) / self.spacing
        count = self.left.size - 1
        held = np.clip(position, 0.0, count)
        cell = np.minimum(held.astype(np.intp), count - 1)
        rows = np.moveaxis(self.coefficients[side, cell], -1, 0)
        return rows, held - cell, (position >= 0.0) & (position <= count)


def level_spline(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients (n - 1, 4) of the C2 spline on a unit grid with zero slope at both ends."""
    spline = CubicSpline(np.arange(heights.size), heights, bc_type="clamped")
    return np.ascontiguousarray(spline.c.T)


def level_monotone(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients (n - 1, 4) of the monotone C1 cubic on a unit grid, level at both ends.

    Slopes are those of Fritsch and Butland (PCHIP), zero wherever the heights turn; a zero slope
    at the ends keeps every cell monotone.
    """
    grid = np.arange(heights.size, dtype=np.float64)
    slopes = np.append(PchipInterpolator(grid, heights).c[2], 0.0)
    slopes[0] = 0.0
    return np.ascontiguousarray(CubicHermiteSpline(grid, heights, slopes).c.T)
