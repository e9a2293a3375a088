"""Torques over time and the car as a point mass under them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.demand import PiecewiseLinear, point_mass_motion, rolling_resistance
from ridetune.engine.frames import CREEP_SPEED

from ..factories import paper_vehicle

G = 9.81


def without_rolling_resistance(vehicle):
    axles = {
        name: replace(axle, tyre=replace(axle.tyre, rolling_resistance=0.0))
        for name, axle in (("front", vehicle.front), ("rear", vehicle.rear))
    }
    return replace(vehicle, **axles)


def on_rear(time, torque):
    return PiecewiseLinear(np.array(time), np.outer(torque, [0.0, 0.0, 1.0, 1.0]))


def test_between_knots_the_value_is_linear_and_outside_held():
    """Oracle: numpy.interp."""
    time, rng = np.array([0.5, 1.0, 2.5]), np.random.default_rng(0)
    values = rng.normal(size=(3, 4))
    function, t = PiecewiseLinear(time, values), np.linspace(-1, 4, 101)
    for corner in range(4):
        expected = np.interp(t, time, values[:, corner])
        for side in ("left", "right"):
            assert_allclose(function.at(t, side)[:, corner], expected, atol=1e-15)
    assert function.at(1.7).shape == (4,)
    assert_allclose(function.knots, time)


def test_a_doubled_knot_is_a_jump_with_both_sides():
    function = on_rear([0.0, 1.0, 1.0, 2.0], [0.0, 3.0, 7.0, 9.0])
    assert function.at(1.0, "left")[2] == 3.0
    assert function.at(1.0, "right")[2] == 7.0
    assert_allclose(function.at([0.5, 1.5])[:, 2], [1.5, 8.0])
    assert_allclose(function.knots, [0.0, 1.0, 2.0])


@pytest.mark.parametrize("times", [[0.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
def test_a_jump_at_either_end_is_taken_on_its_side(times):
    function = on_rear(times, [1.0, 2.0, 3.0])
    first, last = function.at(times[0], "left")[2], function.at(times[-1], "right")[2]
    assert (first, last) == (1.0, 3.0)
    assert function.at(-5.0)[2] == 1.0
    assert function.at(5.0)[2] == 3.0
    assert function.at(5.0, "left")[2] == 3.0


def test_no_torque_is_zero_at_all_times():
    assert not PiecewiseLinear.zero(3.0).at(np.linspace(-1, 5, 50)).any()


def test_constant_traction_without_resistance_is_uniform_acceleration():
    """Oracle: x = a t^2/2 with a = 2 T/(r M); the solver is asked for 1e-8."""
    vehicle = without_rolling_resistance(paper_vehicle())
    a = 2 * 300.0 / 0.30 / 1240.0
    motion = point_mass_motion(
        vehicle, on_rear([0.0, 10.0], [300.0, 300.0]), PiecewiseLinear.zero(10.0), 2.0, 10.0, 500
    )
    assert motion.time.size == 501
    assert_allclose(motion.v, 2.0 + a * motion.time, rtol=1e-7)
    assert_allclose(motion.x, 2.0 * motion.time + a * motion.time**2 / 2, rtol=1e-7, atol=1e-9)
    assert_allclose(motion.a, a, rtol=1e-12)


def test_coasting_to_rest_follows_the_closed_form():
    """Oracle: dv/dt = -fr g tanh(v/v0) integrates to sinh(v/v0) = sinh(u/v0) exp(-fr g t/v0)."""
    vehicle, none = paper_vehicle(), PiecewiseLinear.zero(12.0)
    motion = point_mass_motion(vehicle, none, none, 0.8, 12.0, 600)
    decay = np.exp(-0.01 * G * motion.time / CREEP_SPEED)
    expected = CREEP_SPEED * np.arcsinh(np.sinh(0.8 / CREEP_SPEED) * decay)
    assert_allclose(motion.v, expected, rtol=0, atol=1e-7)
    assert_allclose(motion.distance(6.0), np.trapezoid(expected[:301], dx=0.02), rtol=1e-4)


def test_a_jump_of_torque_is_not_smeared():
    """Oracle: a ramp's and a jump's speed, 4 N m s and 2 N m s of impulse on each rear wheel."""
    vehicle = without_rolling_resistance(paper_vehicle())
    torque = on_rear([0.0, 2.0, 2.0, 3.0, 3.0], [0.0, 4.0, 2.0, 2.0, 0.0])
    motion = point_mass_motion(vehicle, torque, PiecewiseLinear.zero(5.0), 0.0, 5.0)
    per_impulse = 2 / (0.30 * 1240.0)
    assert_allclose(motion.v[-1], per_impulse * (4.0 + 2.0), rtol=1e-7)
    assert_allclose(np.interp(2.0, motion.time, motion.v), per_impulse * 4.0, rtol=1e-7)


def test_braking_ends_at_rest_and_stays_there():
    vehicle = paper_vehicle()
    brake = PiecewiseLinear(np.array([0.0, 10.0]), np.full((2, 4), 300.0))
    motion = point_mass_motion(vehicle, PiecewiseLinear.zero(10.0), brake, 10.0, 10.0)
    level = 4 * 300.0 / 0.30 / 1240.0 + 0.01 * G
    assert_allclose(motion.x[-1], 10.0**2 / (2 * level), rtol=0, atol=2 * CREEP_SPEED**2)
    assert_allclose(motion.v[-1], 0.0, atol=1e-6)
    assert np.all(np.diff(motion.v) <= 1e-9)


def test_rolling_resistance_weighs_the_axles_by_their_load():
    """Oracle: moments; 1.36/2.66 of the sprung weight and its own wheels are on the front axle."""
    vehicle = paper_vehicle()
    assert_allclose(rolling_resistance(vehicle), 0.01, rtol=1e-12)
    front = replace(vehicle.front, tyre=replace(vehicle.front.tyre, rolling_resistance=0.03))
    share = (1090 * 1.36 / 2.66 + 72) / 1240
    expected = 0.01 + 0.02 * share
    assert_allclose(rolling_resistance(replace(vehicle, front=front)), expected, rtol=1e-12)


def test_knots_that_differ_by_rounding_are_one():
    """A duration or a doubled knot off by one unit in the last place changes nothing."""
    vehicle, end = paper_vehicle(), 1.003
    torque = on_rear([0.0, 0.5, np.nextafter(0.5, 1.0), end], [100.0, 100.0, 0.0, 0.0])
    exact = on_rear([0.0, 0.5, 0.5, end], [100.0, 100.0, 0.0, 0.0])
    none = PiecewiseLinear.zero(end)
    one = point_mass_motion(vehicle, torque, none, 5.0, np.nextafter(end, 2.0))
    other = point_mass_motion(vehicle, exact, none, 5.0, end)
    assert_allclose(one.x, other.x, rtol=1e-7)


def test_knots_closer_than_the_motions_own_times_are_passed_over():
    """Oracle: v = F t / M of a constant force, given by knots of 1 ms over 600 s."""
    car = without_rolling_resistance(paper_vehicle())
    knots = [0.0, 10.0, 10.001, 10.002, 600.0]
    drive = on_rear(knots, np.full(5, 30.0))
    motion = point_mass_motion(car, drive, PiecewiseLinear.zero(600.0), 0.0, 600.0)
    expected = 2 * 30.0 / car.rear.wheel.radius / car.total_mass * motion.time
    assert_allclose(motion.v, expected, rtol=1e-6, atol=1e-9)
