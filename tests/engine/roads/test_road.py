"""A road is one piecewise cubic a side, level beyond its ends."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.errors import RoadError
from ridetune.engine.roads.road import LEFT, RIGHT, Road
from scipy.interpolate import CubicSpline, PchipInterpolator


@pytest.fixture
def rng():
    return np.random.default_rng(8608)


@pytest.fixture
def road(rng):
    return Road(start=-1.3, spacing=0.07, left=rng.normal(size=41), right=rng.normal(size=41))


@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_heights_and_slopes_are_those_of_the_clamped_spline(road, side):
    """Oracle: scipy's spline on the metres themselves; slopes reach 1/spacing of the heights."""
    profile = (road.left, road.right)[side]
    spline = CubicSpline(road.x, profile, bc_type="clamped")
    x = np.linspace(road.start, road.end, 1001)
    assert_allclose(road.height(side, x), spline(x), rtol=0, atol=1e-12)
    assert_allclose(road.slope(side, x), spline(x, 1), rtol=0, atol=1e-12 / road.spacing)


def test_coefficients_follow_the_documented_layout(road):
    """The kernel's formula, evaluated by hand in one cell."""
    cell, s = 17, 0.3
    x = road.start + (cell + s) * road.spacing
    for side in (LEFT, RIGHT):
        c0, c1, c2, c3 = road.coefficients[side, cell]
        assert_allclose(road.height(side, x), ((c0 * s + c1) * s + c2) * s + c3, rtol=1e-12)
        slope = ((3 * c0 * s + 2 * c1) * s + c2) / road.spacing
        assert_allclose(road.slope(side, x), slope, rtol=1e-10)
    assert road.coefficients.shape == (2, 40, 4)
    assert road.coefficients.flags.c_contiguous


def test_cells_join_with_equal_height_slope_and_curvature(road):
    """Oracle: a cell's cubic at s = 1 against the next one's coefficients at s = 0."""
    c0, c1, c2, c3 = np.moveaxis(road.coefficients[:, :-1], -1, 0)
    following = road.coefficients[:, 1:]
    assert_allclose(c0 + c1 + c2 + c3, following[..., 3], atol=1e-12)
    assert_allclose(3 * c0 + 2 * c1 + c2, following[..., 2], atol=1e-12)
    assert_allclose(6 * c0 + 2 * c1, 2 * following[..., 1], atol=1e-11)


def test_beyond_its_ends_a_road_is_level_at_the_ends_height(road):
    outside = [(-100.0, road.left[0]), (-1.31, road.left[0]), (50.0, road.left[-1])]
    for x, height in outside:
        assert_allclose(road.height(LEFT, x), height, rtol=1e-14)
        assert road.slope(LEFT, x) == 0.0
    ends = road.slope(LEFT, [road.start, road.end])
    assert_allclose(ends, 0.0, atol=1e-12 / road.spacing)


def test_level_ground_is_level_everywhere():
    x = np.linspace(-1e3, 1e4, 57)
    for side in (LEFT, RIGHT):
        assert not Road.flat().height(side, x).any()
        assert not Road.flat().slope(side, x).any()


def test_a_monotone_road_joins_smoothly_and_ends_level(rng):
    """Oracle: scipy's PCHIP away from the ends; equal heights and slopes where cells meet."""
    heights = rng.normal(size=41)
    road = Road(0.0, 0.5, heights, -heights, interpolant="monotone")
    inner = np.linspace(road.x[1], road.x[-2], 501)
    assert_allclose(road.height(LEFT, inner), PchipInterpolator(road.x, heights)(inner), atol=1e-12)
    c0, c1, c2, c3 = np.moveaxis(road.coefficients[:, :-1], -1, 0)
    assert_allclose(c0 + c1 + c2 + c3, road.coefficients[:, 1:, 3], atol=1e-12)
    assert_allclose(3 * c0 + 2 * c1 + c2, road.coefficients[:, 1:, 2], atol=1e-12)
    assert_allclose(road.slope(LEFT, [road.start, road.end]), 0.0, atol=1e-12)


def test_a_road_keeps_its_own_copy_of_the_heights():
    heights = np.zeros(5)
    road = Road(0.0, 1.0, heights, heights)
    heights[2] = 1.0
    assert road.left[2] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        road.left[2] = 1.0


@pytest.mark.parametrize(
    ("start", "spacing", "left", "right", "sentence"),
    [
        (0.0, 1.0, [0, 1, 2], [0, 1], "as many heights on the left as on the right"),
        (0.0, 1.0, [0], [0], "at least two points"),
        (0.0, 1.0, [0, np.nan], [0, 1], "finite"),
        (0.0, 0.0, [0, 1], [0, 1], "positive spacing"),
        (np.inf, 1.0, [0, 1], [0, 1], "finite start"),
    ],
)
def test_impossible_roads_are_refused(start, spacing, left, right, sentence):
    with pytest.raises(RoadError, match=sentence):
        Road(start, spacing, left, right)
