"""Four tyres by themselves, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.tyres import Tyres, WheelMotion

TYRE = reference_car().tyre
NONE = np.zeros(4)
LOAD = np.full(4, 3000.0)


def rolling(speed=0.0, slip=0.0, aside=0.0, height=0.3):
    """Upright wheels along x; slip and aside in m/s."""
    return WheelMotion(
        centre=np.tile([0.0, 0.0, height], (4, 1)),
        velocity=np.tile([speed, aside, 0.0], (4, 1)),
        axle=np.tile([0.0, 1.0, 0.0], (4, 1)),
        spin=np.full(4, (speed - slip) / TYRE.rolling_radius),
    )


def test_a_wheel_and_a_road_1_mm_higher_carry_the_same():
    """Oracle: only the distance counts; 1 mm more of road alone adds k times it."""
    tyres = Tyres(TYRE)
    low = tyres.load(rolling(height=0.3), NONE, NONE)
    assert_allclose(low, TYRE.stiffness * (TYRE.free_radius - 0.3), rtol=1e-12)
    assert_allclose(tyres.load(rolling(height=0.301), NONE + 1e-3, NONE), low, rtol=1e-12)
    squeezed = tyres.load(rolling(height=0.3), NONE + 1e-3, NONE)
    assert_allclose(squeezed - low, TYRE.stiffness * 1e-3, rtol=1e-9)
    rising = tyres.load(rolling(height=0.3), NONE, NONE + 0.1)
    assert_allclose(rising - low, TYRE.damping * 0.1, rtol=1e-9)


def test_a_tyre_never_pulls():
    assert_allclose(Tyres(TYRE).load(rolling(height=0.5), NONE, NONE), 0.0)


def test_force_settles_at_stiffness_times_slip():
    """Oracle: the steady state F = -C v_slip / |v_x|, after many relaxation lengths."""
    tyres, motion = Tyres(TYRE), rolling(speed=10.0, slip=-0.05, aside=0.08)
    for _ in range(1000):
        force, _ = tyres.advance(motion, LOAD, 1e-3)
    assert_allclose(force[:, 0], TYRE.longitudinal.slip_stiffness * 0.005, rtol=1e-6)
    assert_allclose(force[:, 1], -TYRE.lateral.slip_stiffness * 0.008, rtol=1e-6)
    assert_allclose(force[:, 2], 0.0, atol=1e-12)


def test_it_builds_up_over_the_relaxation_length():
    """Oracle: 1 - exp(-x/s) of the steady force, to the first order of the step."""
    tyres, motion = Tyres(TYRE), rolling(speed=10.0, aside=0.05)
    length = TYRE.lateral.relaxation_length
    steps = round(length / 10.0 / 1e-4)
    for _ in range(steps):
        force, _ = tyres.advance(motion, LOAD, 1e-4)
    steady = -TYRE.lateral.slip_stiffness * 0.005
    assert_allclose(force[:, 1], steady * (1.0 - np.exp(-1.0)), rtol=2e-3)


def test_force_stays_within_friction_whatever_its_direction():
    tyres, motion = Tyres(TYRE), rolling(speed=10.0, slip=-3.0, aside=3.0)
    for _ in range(1000):
        force, _ = tyres.advance(motion, LOAD, 1e-3)
    assert_allclose(np.linalg.norm(force, axis=1), TYRE.friction * LOAD, rtol=1e-9)


@pytest.mark.parametrize("speed", [10.0, -10.0])
def test_rolling_resistance_turns_against_the_wheel(speed):
    """Oracle: fr W r about the axle, where nothing slips."""
    _, torque = Tyres(TYRE).advance(rolling(speed=speed), LOAD, 1e-3)
    expected = -np.sign(speed) * TYRE.rolling_resistance * LOAD * TYRE.rolling_radius
    assert_allclose(torque[:, 1], expected, rtol=1e-9)


def test_force_acts_at_the_rolling_radius_below_the_centre():
    """Oracle: torque = -r z x F."""
    tyre = replace(TYRE, rolling_resistance=0.0)
    force, torque = Tyres(tyre).advance(rolling(speed=10.0, slip=1.0, aside=0.5), LOAD, 1e-3)
    assert_allclose(torque, np.cross([0.0, 0.0, -tyre.rolling_radius], force), rtol=1e-12)
