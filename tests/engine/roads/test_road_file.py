"""Road files: what is read, and one sentence for what cannot be."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.errors import RoadError
from ridetune.engine.roads.road import LEFT, RIGHT
from ridetune.engine.roads.road_file import parse_road, read_road

HEAD = "x [m],left [m],right [m]\n"


def csv(*columns, head=HEAD):
    rows = (",".join(f"{value:.12g}" for value in row) for row in zip(*columns, strict=True))
    return (head + "\n".join(rows)).encode()


def test_a_uniform_profile_is_taken_point_by_point():
    x = np.arange(0, 20, 0.1)
    left, right = 0.01 * np.sin(x), 0.02 * np.sin(2 * x)
    road = parse_road(csv(x, left, right), "r.csv")
    assert_allclose([road.start, road.spacing], [0.0, 0.1], atol=1e-12)
    assert_allclose(road.left, left, atol=1e-12)
    assert_allclose(road.right, right, atol=1e-12)
    assert road.name == "r.csv"


@pytest.mark.parametrize("uneven", [False, True])
def test_a_kerb_stays_between_its_two_levels(uneven):
    """Oracle: the profile's own range, 0 to 50 mm; before and after the kerb it is level."""
    x = np.arange(0.0, 10.0, 0.1)
    if uneven:
        x = np.delete(x, [3, 4, 20, 51, 70])
    kerb = np.where(x > 4.95, 0.05, 0.0)
    road = parse_road(csv(x, kerb, -kerb), "r.csv")
    at = np.linspace(-1.0, 11.0, 12_001)
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        height = sign * road.height(side, at)
        assert height.min() >= 0.0
        assert height.max() <= 0.05 + 1e-15
        assert not height[at < 4.8].any()
        assert_allclose(height[at > 5.3], 0.05, rtol=0, atol=1e-15)


def test_no_height_leaves_the_range_of_the_points_beside_it():
    """Oracle: the definition of a monotone interpolant, on rough random points."""
    heights = np.random.default_rng(5).normal(scale=0.02, size=200)
    road = parse_road(csv(0.25 * np.arange(200), heights, 0 * heights), "r.csv")
    share = np.linspace(0.0, 1.0, 21)[:, np.newaxis]
    found = road.height(LEFT, road.x[:-1] + 0.25 * share)
    lower, upper = (
        np.minimum(road.left[:-1], road.left[1:]),
        np.maximum(road.left[:-1], road.left[1:]),
    )
    assert np.all(found >= lower - 1e-12)
    assert np.all(found <= upper + 1e-12)


def test_a_smooth_profile_at_uneven_points_is_approached_with_their_distance():
    """Oracle: the sine itself. A monotone cubic is level where the heights turn, so its order is
    2 there: halving the distance must take the greatest error down about fourfold."""
    errors = []
    for distance in (0.2, 0.1, 0.05):
        rng = np.random.default_rng(1)
        x = (
            np.arange(0.0, 30.0, distance)
            + rng.uniform(-0.2, 0.2, round(30.0 / distance)) * distance
        )
        left = 0.01 * np.sin(x)
        road = parse_road(csv(x, left, left), "r.csv")
        at = np.linspace(x[5], x[-6], 5001)
        errors.append(np.abs(road.height(LEFT, at) + left[0] - 0.01 * np.sin(at)).max())
    # The sag of a chord, h^2/8 of the curvature, bounds what a level top can cut off.
    assert errors[0] < 0.01 * (1.4 * 0.2) ** 2 / 8 * 2
    order = np.log2(errors[0] / errors[-1]) / 2
    assert 1.5 < order < 3.0


def test_units_order_and_other_columns_do_not_matter():
    data = b"note;right [mm];x [cm];left [in]\na;0;0;0\nb;3;50;1\nc;5;100;2\n"
    road = parse_road(data, "r.csv")
    assert_allclose(road.x, [0.0, 0.5, 1.0], atol=1e-12)
    assert_allclose(road.left, [0.0, 0.0254, 0.0508])
    assert_allclose(road.right, [0.0, 0.003, 0.005])


def test_elevation_above_the_sea_counts_from_the_beginning_and_keeps_the_cross_slope():
    road = parse_road(csv([0, 1, 2], [231.02, 231.0, 231.0], [230.98, 231.0, 231.0]), "r.csv")
    assert_allclose(road.left, [0.02, 0.0, 0.0], atol=1e-12)
    assert_allclose(road.right, [-0.02, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "empty"),
        (b"0,0,0\n1,0,0\n2,0,0\n", "there is no column x or left or right; begin the file"),
        (b"x [m],left [m]\n0,0\n1,0\n2,0\n", "there is no column right; begin the file"),
        (HEAD.encode() + b"0,0,0\n1,0,0\n", "holds 2 points, at least 3"),
        (HEAD.encode() + b"0,0,0\n1,nan,0\n2,0,0\n", "line 3, column left.*'nan' is not finite"),
        (HEAD.encode() + b"0,0,0\n1,,0\n2,0,0\n", "line 3, column left.*empty"),
        (HEAD.encode() + b"0,0,0\n1,x,0\n2,0,0\n", "line 3, column left.*not a number"),
        (HEAD.encode() + b"0,0,0\n1,0,0\n1,0,0\n", "line 4: x does not increase; sort"),
        (HEAD.encode() + b"\n0,0,0\n\n2,0,0\n1,0,0\n", "line 6: x does not increase"),
        (b"x [m],left [m],left [mm]\n0,0,0\n", "columns 2 and 3 are both left; keep one"),
        (b"x [s],left [m],right [m]\n0,0,0\n", r"column 1 \(x \[s\]\): .*write a length"),
        (HEAD.encode() + b"0,0,0\n1,5000,0\n2,0,0\n", r"left rises or falls by 5000 m.*unit"),
        (
            HEAD.encode() + b"0,0,0\n0.1,0,0\n0.2,0,8\n",
            r"right rises or falls by 8 m between x = 0.1 and 0.2 m; check its unit, e.g. right",
        ),
        (HEAD.encode() + b"0,0,0\n1e9,0,0\n2e9,0,0\n", "2e\\+09 m long, more than 100000 m"),
        (HEAD.encode() + b"0,0,0\n1e-7,0,0\n9e4,0,0\n", "thin out the closest points"),
        (
            b"x [km],left [m],right [m]\n0,0,0\n1e307,0,0\n2,0,0\n",
            r"line 3, column x \[km\]: '1e307' is too large; correct it or the column's unit",
        ),
        (bytes(range(256)) * 9, "binary"),
    ],
)
def test_a_bad_file_is_refused_with_place_and_remedy(data, sentence):
    with pytest.raises(RoadError, match=rf"^r\.csv: .*{sentence}"):
        parse_road(data, "r.csv")


def test_a_file_is_read_by_its_path(tmp_path):
    path = tmp_path / "road.csv"
    path.write_bytes(csv([0, 1, 2], [0, 0.01, 0], [0, 0, 0]))
    assert_allclose(read_road(path).left, [0, 0.01, 0])
    with pytest.raises(RoadError, match=r"none\.csv.*cannot be read.*check the path"):
        read_road(tmp_path / "none.csv")
