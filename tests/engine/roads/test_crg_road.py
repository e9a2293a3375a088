"""OpenCRG roads: the heights under two wheel tracks.

Oracle: pyopencrg's own evaluation of the road it wrote, and the grid's numbers themselves.
"""

from pathlib import Path

import numpy as np
import pyopencrg
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.errors import RoadError
from ridetune.engine.roads.road_file import read_road

DATA = Path(__file__).parents[2] / "data/opencrg"
V = np.linspace(-1.5, 1.5, 13)
U = 0.1 * np.arange(121)
FORMS = {"KRBI": 2.0**-24, "KDBI": 0.0, "LRFI": 1e-6, "LDFI": 1e-12}
"""How far a height below 1 m is off by the form of the file: its digits."""


def grid():
    return 0.03 * np.sin(3.0 * U[:, None]) * np.cos(0.7 * V) + 0.01 * V


def written(path, z=None, form="KRBI", **options):
    road = pyopencrg.CrgRoad(grid() if z is None else z, 0.1, V, **options)
    road.save(str(path), fmt=form)
    return road


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("track", [1.5, 1.37])
def test_two_tracks_are_those_that_pyopencrg_evaluates(tmp_path, form, track):
    theirs = written(tmp_path / "r.crg", form=form)
    road = read_road(tmp_path / "r.crg", track)
    assert_allclose(road.x, U, atol=1e-9)
    left, right = (theirs.uv_to_z(U, np.full_like(U, v)) for v in (0.5 * track, -0.5 * track))
    # Heights count from the mean of both tracks at the beginning.
    beginning = 0.5 * (left[0] + right[0])
    off = 3.0 * FORMS[form] + 1e-15
    assert_allclose(road.left, left - beginning, rtol=0, atol=off)
    assert_allclose(road.right, right - beginning, rtol=0, atol=off)
    assert road.warnings == ()


def test_what_the_reference_line_does_is_left_out_and_said():
    """Oracle: the grid of the hand-made file, on the long sections at +-1 m."""
    path = DATA / "handmade_curved_banked_sloped.crg"
    road = read_road(path, 2.0)
    (said,) = road.warnings
    assert "turns by up to 6.3 deg, climbs by up to 11 %, banks by up to 11 %" in said
    theirs = pyopencrg.read(str(path))
    assert_allclose(theirs.v[[4, 2]], [1.0, -1.0])
    left, right = theirs.z[:, [4, 2]].T
    beginning = 0.5 * (left[0] + right[0])
    assert_allclose(road.left, left - beginning, atol=1e-12)
    assert_allclose(road.right, right - beginning, atol=1e-12)


def test_a_short_gap_is_filled_by_a_straight_line_and_told(tmp_path):
    """Oracle: the line between the heights on either side."""
    z = grid()
    z[50, 8:11] = np.nan
    written(tmp_path / "r.crg", z, "KDBI")
    road = read_road(tmp_path / "r.crg")
    assert road.left[50] == pytest.approx(0.5 * (road.left[49] + road.left[51]), abs=1e-15)
    assert road.warnings == (
        "r.crg: 1 of 242 heights under the wheels are missing; straight lines fill the gaps.",
    )


def test_a_long_gap_is_refused_with_its_place(tmp_path):
    z = grid()
    z[50:54, 8:11] = np.nan
    written(tmp_path / "r.crg", z, "KDBI")
    with pytest.raises(RoadError, match=r"left wheels the heights from x = 4\.9 to 5\.4 m are mis"):
        read_road(tmp_path / "r.crg")


def refusal(path, **how):
    with pytest.raises(RoadError) as caught:
        read_road(path, **how)
    said = str(caught.value)
    assert said.startswith(path.name)
    assert said.endswith(".")
    assert "\n" not in said
    return said


def test_converted_line_ends_are_recognized(tmp_path):
    """Every line feed within the binary heights made two bytes, as a transfer of text does."""
    written(tmp_path / "r.crg", np.random.default_rng(3).normal(0.0, 0.01, (121, 13)))
    data = (tmp_path / "r.crg").read_bytes()
    (tmp_path / "r.crg").write_bytes(data.replace(b"\n", b"\r\n"))
    assert "a conversion of its line ends" in refusal(tmp_path / "r.crg")


@pytest.mark.filterwarnings("ignore::pyopencrg.CrgCheckWarning")
def test_a_text_cut_short_is_refused_with_what_is_left(tmp_path):
    """Oracle: the cross sections written, and the lines kept; 13 heights take two lines."""
    written(tmp_path / "r.crg", form="LRFI")
    head, mark, rows = (tmp_path / "r.crg").read_bytes().rpartition(b"$" * 72 + b"\n")
    kept = b"".join(rows.splitlines(keepends=True)[: 2 * 50])
    (tmp_path / "r.crg").write_bytes(head + mark + kept)
    assert "holds 50 of the 121 cross sections that it declares" in refusal(tmp_path / "r.crg")


def test_a_road_without_its_definitions_is_refused_by_what_it_lacks(tmp_path):
    written(tmp_path / "r.crg", form="LRFI")
    data = (tmp_path / "r.crg").read_bytes().replace(b"$KD_DEFINITION", b"$OTHER")
    (tmp_path / "r.crg").write_bytes(data)
    said = refusal(tmp_path / "r.crg")
    assert said.startswith("r.crg: this is no sound OpenCRG road: no $KD_DEFINITION block found")


def test_a_reference_to_another_file_is_not_followed(tmp_path):
    text = "$CT\ncomment\n$!****\n$ROAD_CRG_FILE\n$HOME/secret.crg\n$!****\n"
    (tmp_path / "r.crg").write_text(text)
    assert "names another file, which is not opened" in refusal(tmp_path / "r.crg")


def test_wheels_beside_the_road_are_refused(tmp_path):
    written(tmp_path / "r.crg")
    said = refusal(tmp_path / "r.crg", track=3.2)
    assert "reaches from v = -1.5 to 1.5 m across, but the wheels run at -1.6 and 1.6 m" in said


@pytest.mark.parametrize("share", [0.02, 0.5, 0.97])
def test_a_road_cut_short_is_refused(tmp_path, share):
    written(tmp_path / "r.crg")
    data = (tmp_path / "r.crg").read_bytes()
    (tmp_path / "r.crg").write_bytes(data[: int(share * len(data))])
    assert refusal(tmp_path / "r.crg")
