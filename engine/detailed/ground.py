"""The road as tyres feel it: averaged over the contact patch, under four wheels."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PPoly

from ..frames import Corner, side_of
from ..roads.road import LEFT, RIGHT, Road

Array = NDArray[np.float64]

POINTS_PER_PATCH = 4
"""Grid points of the averaged road to a patch, at least."""


def patch_road(road: Road, length: float) -> Road:
    """The mean height over `length` around each X, as a road.

        mean(X) = (A(X + l/2) - A(X - l/2)) / l,    dA/dX = height

    exact on the new grid, beyond both ends of which the ground is level.
    """
    if not road.left.any() and not road.right.any():
        return road
    spacing = min(road.spacing, length / POINTS_PER_PATCH)
    start = road.start - length
    grid = start + spacing * np.arange(
        int(np.ceil((road.end + length - start) / spacing)) + 1, dtype=np.float64
    )
    sides = [_mean(road, side, grid, length) for side in (LEFT, RIGHT)]
    return Road(float(start), spacing, sides[0], sides[1], road.name)


def _mean(road: Road, side: int, grid: Array, length: float) -> Array:
    # The coefficients count from the cell's beginning in cells, PPoly's in metres.
    powers = road.spacing ** np.arange(3, -1, -1)
    cells = PPoly((road.coefficients[side] / powers).T, road.x)
    area = cells.antiderivative()
    first, last = road.height(side, road.start), road.height(side, road.end)

    def integral(x: Array) -> Array:
        held = np.clip(x, road.start, road.end)
        before, after = np.minimum(x - road.start, 0.0), np.maximum(x - road.end, 0.0)
        return area(held) + before * first + after * last

    return (integral(grid + length / 2) - integral(grid - length / 2)) / length


class Ground:
    """Height and slope under four wheels, each on its side of a road.

    corners (4,) : which wheels, in the order of every argument
    """

    def __init__(self, road: Road, corners: list[Corner]):
        self._road = road
        self._side = np.array([LEFT if side_of(corner) > 0 else RIGHT for corner in corners])

    def under(self, x: Array) -> tuple[Array, Array]:
        """Height, m, and slope (4,) at the wheels' X (4,); as `Road.height` and `Road.slope`."""
        position = (x - self._road.start) / self._road.spacing
        count = self._road.left.size - 1
        held = np.minimum(np.maximum(position, 0.0), count)
        cell = np.minimum(held.astype(np.intp), count - 1)
        c0, c1, c2, c3 = self._road.coefficients[self._side, cell].T
        s = held - cell
        slope = ((3.0 * c0 * s + 2.0 * c1) * s + c2) / self._road.spacing
        return ((c0 * s + c1) * s + c2) * s + c3, np.where(held == position, slope, 0.0)
