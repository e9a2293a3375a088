"""Road files: what is read, and one sentence for what cannot be."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.errors import RoadError
from ridetune.engine.road import LEFT, RIGHT
from ridetune.engine.road_file import parse_road, read_road
from scipy.interpolate import CubicSpline

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


def test_a_profile_at_other_points_keeps_its_smooth_shape():
    """Oracle: the sine itself. A spline of steps up to 0.3 m errs by 0.3^4/384 of its 10 mm, and
    what the level ends disturb fades by half a point at the least."""
    rng = np.random.default_rng(1)
    x = np.cumsum(rng.uniform(0.1, 0.3, 200))
    left, right = 0.01 * np.sin(x), 0.01 * np.cos(x)
    road = parse_road(csv(x, left, right), "r.csv")
    at = np.linspace(x[20], x[-21], 500)
    beginning = (left[0] + right[0]) / 2
    assert_allclose(road.height(LEFT, at), 0.01 * np.sin(at) - beginning, rtol=0, atol=1e-6)
    assert_allclose(road.height(RIGHT, at), 0.01 * np.cos(at) - beginning, rtol=0, atol=1e-6)


def test_resampling_follows_the_spline_through_the_points():
    """Oracle: scipy's clamped spline through the file's points, at the road's own grid."""
    x, left = np.array([0.0, 1.0, 1.5, 2.5, 4.0]), np.array([0.0, 0.01, -0.01, 0.02, 0.0])
    road = parse_road(csv(x, left, 0 * x), "r.csv")
    assert road.spacing <= 0.5
    assert_allclose(road.left, CubicSpline(x, left, bc_type="clamped")(road.x), atol=1e-14)


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
        (HEAD.encode() + b"0,0,0\n1e9,0,0\n2e9,0,0\n", "2e\\+09 m long, more than 100000 m"),
        (HEAD.encode() + b"0,0,0\n1e-7,0,0\n9e4,0,0\n", "thin out the closest points"),
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


def test_opencrg_is_refused_with_what_is_read_instead(tmp_path):
    with pytest.raises(RoadError, match=r"block\.crg: OpenCRG files are not read; .*CSV"):
        read_road(tmp_path / "block.crg")
