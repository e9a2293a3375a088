"""A shape's road is the shape itself, on level ground. The splines keep to it within 1e-5."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.curves import SweptSine, smooth_step
from ridetune.engine.roads.road import LEFT, RIGHT
from ridetune.engine.roads.road_shapes import bump, pothole, sine_sweep


def test_a_bump_is_one_raised_cosine():
    road, x = bump(15.0, 1.2, 0.05), np.linspace(10.0, 20.0, 4001)
    s = np.clip((x - 15.0) / 1.2, 0.0, 1.0)
    expected = 0.025 * (1 - np.cos(2 * np.pi * s))
    assert_allclose(road.height(LEFT, x), expected, rtol=0, atol=0.05 * 1e-5)
    assert np.array_equal(road.left, road.right)


@pytest.mark.parametrize(("tracks", "flat"), [("left", RIGHT), ("right", LEFT)])
def test_a_bump_under_one_track_leaves_the_other_level(tracks, flat):
    road, x = bump(5.0, 1.0, -0.04, tracks), np.linspace(0, 10, 501)
    assert not road.height(flat, x).any()
    assert_allclose(road.height(1 - flat, x).min(), -0.04, rtol=1e-4)


def test_a_pothole_has_a_level_bottom_between_smooth_edges():
    road = pothole(10.0, 0.8, depth=0.06, edge=0.1, tracks="both")
    x = np.linspace(9.0, 12.0, 6001)
    expected = -0.06 * smooth_step((x - 10.0) / 0.1) * smooth_step((10.8 - x) / 0.1)
    assert_allclose(road.height(RIGHT, x), expected, rtol=0, atol=0.06 * 1e-5)
    bottom = (x > 10.1) & (x < 10.7)
    assert_allclose(road.height(RIGHT, x[bottom]), -0.06, atol=0.06 * 1e-5)


def test_opposed_tracks_of_a_sine_sweep_differ_in_sign_alone():
    sweep = SweptSine(span=60.0, first=0.05, last=1.0, amplitude=0.02, last_amplitude=0.002)
    together, opposed = sine_sweep(5.0, sweep), sine_sweep(5.0, sweep, "opposed")
    x = np.linspace(0, 70, 7001)
    assert_allclose(together.height(LEFT, x), sweep(x - 5.0), rtol=0, atol=0.002 * 1e-5)
    assert np.array_equal(together.left, together.right)
    assert np.array_equal(opposed.left, -opposed.right)
    assert np.array_equal(opposed.left, together.left)
