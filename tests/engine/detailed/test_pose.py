"""Positions and their rates from coordinates."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.detailed.pose import (
    point,
    point_acceleration,
    point_velocity,
    rotation,
    spin,
    spin_rate,
)
from ridetune.engine.detailed.tyres import wheel_motion
from scipy.spatial.transform import Rotation

STEP = 1e-5
OFFSET = np.array([0.3, -0.2, 0.5])


@pytest.fixture
def moving():
    """q(t), qd and qdd (8, 6) of random bodies at t = 0: q + t qd + t^2 qdd / 2."""
    q, qd, qdd = np.random.default_rng(3).normal(size=(3, 8, 6))
    return (lambda t: q + t * qd + t * t * qdd / 2.0), qd, qdd


def test_rotation_is_that_of_intrinsic_angles_xyz(moving):
    """Oracle: SciPy."""
    angles = moving[0](0.0)[:, 3:]
    assert_allclose(rotation(angles), Rotation.from_euler("XYZ", angles).as_matrix(), atol=1e-14)


def test_a_body_1_mm_higher_has_its_points_1_mm_higher():
    q = np.array([1.0, 2.0, 3.0, 0.4, -0.5, 0.6])
    up = np.array([0.0, 0.0, 1e-3])
    assert_allclose(point(q + [0, 0, 1e-3, 0, 0, 0], OFFSET) - point(q, OFFSET), up, atol=1e-15)


def test_spin_is_what_turns_the_body(moving):
    """Oracle: the rotation from shortly before to shortly after, over the time between."""
    q, qd, _ = moving
    before, after = (Rotation.from_euler("XYZ", q(t)[:, 3:]) for t in (-STEP, STEP))
    turned = (after * before.inv()).as_rotvec() / (2.0 * STEP)
    assert_allclose(spin(q(0.0)[:, 3:], qd[:, 3:]), turned, atol=1e-8)


def test_rates_are_differences(moving):
    """Oracle: central differences of position, velocity and spin, of second order in the step."""
    q, qd, qdd = moving

    def slope(function):
        return (function(STEP) - function(-STEP)) / (2.0 * STEP)

    def rate(t):
        return qd + t * qdd

    velocity = point_velocity(q(0.0), qd, OFFSET)
    assert_allclose(velocity, slope(lambda t: point(q(t), OFFSET)), atol=1e-8)
    acceleration = point_acceleration(q(0.0), qd, qdd, OFFSET)
    expected = slope(lambda t: point_velocity(q(t), rate(t), OFFSET))
    assert_allclose(acceleration, expected, atol=1e-7)
    turning = spin_rate(q(0.0)[:, 3:], qd[:, 3:], qdd[:, 3:])
    assert_allclose(turning, slope(lambda t: spin(q(t)[:, 3:], rate(t)[:, 3:])), atol=1e-7)


def test_a_wheel_moves_as_its_point_on_the_axle(moving):
    """Oracle: the general formulas, of a point at `offset` along the body's z."""
    q, qd, _ = moving
    offset = np.linspace(-0.1, 0.1, 8)
    motion = wheel_motion(q(0.0), qd, offset)
    for k, along in enumerate(offset):
        arm = np.array([0.0, 0.0, along])
        assert_allclose(motion.centre[k], point(q(0.0)[k], arm), atol=1e-14)
        assert_allclose(motion.velocity[k], point_velocity(q(0.0)[k], qd[k], arm), atol=1e-13)
        w = spin(q(0.0)[k, 3:], qd[k, 3:])
        assert motion.spin[k] == pytest.approx(w @ motion.axle[k], abs=1e-13)
