from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.channels import INPUT_CHANNELS, OUTPUT_CHANNELS, WHEEL_CHANNELS
from ridetune.engine.errors import MeasurementError, SimulationError
from ridetune.engine.run import Run
from ridetune.engine.simulation.recorded_motion import recorded_motion
from ridetune.engine.simulation.rims import for_car, prepare
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import simulate_rims
from ridetune.engine.vehicle import Brakes

from ...factories import paper_vehicle

CAR = paper_vehicle()
UNFILTERED = RimsSettings(a_x_cutoff_hz=None, rim_cutoff_hz=None)
CUBICS = np.array(
    [[0.0, 0.01, -0.02, 0.005], [0, 0, 0.03, 0], [0.01, 0, 0, -0.01], [0, 0.02, 0, 0]]
)
"""Polynomial coefficients of the four wheels' heights, rising powers."""


def cubic_run(time, **others):
    """Wheels on cubics in time, a_x a parabola: what cubic splines reproduce exactly."""
    channels = {
        name: np.polynomial.polynomial.polyval(time, coefficients)
        for name, coefficients in zip(WHEEL_CHANNELS, CUBICS, strict=True)
    }
    return Run("cubic", time, {**channels, "chassis.a_x": 0.3 - 0.2 * time**2, **others})


def still_run(time, **changed):
    """A car at rest, but for the channels given."""
    zero = np.zeros_like(time)
    return Run("still", time, {**dict.fromkeys(INPUT_CHANNELS, zero), **changed})


def stage_times(inputs):
    begin, end = inputs.node_time[:-1], inputs.node_time[1:]
    return np.stack([begin, 0.5 * (begin + end), end], axis=1)


@pytest.mark.parametrize("uniform", [True, False])
def test_stage_inputs_are_the_heights_and_their_true_derivatives(uniform):
    """Oracle: derivatives of the cubics; a spline through a cubic is the cubic."""
    time = np.linspace(0.0, 2.0, 401)
    if not uniform:
        time = time + 0.001 * np.sin(7.0 * time) * time * (2.0 - time)
    inputs = prepare(cubic_run(time), CAR, UNFILTERED)
    at = stage_times(inputs)
    for wheel, coefficients in enumerate(CUBICS):
        polynomial = np.polynomial.Polynomial(coefficients)
        for order in range(3):
            column = inputs.stage_inputs[:, :, 4 * order + wheel]
            expected = polynomial.deriv(order)(at) if order else polynomial(at)
            assert_allclose(column, expected, rtol=0, atol=1e-9)
    assert_allclose(inputs.stage_inputs[:, :, 12], 0.3 - 0.2 * at**2, rtol=0, atol=1e-9)


def test_speed_without_its_channel_is_the_integral_of_a_x():
    inputs = prepare(cubic_run(np.linspace(0.5, 1.2, 141)), CAR, UNFILTERED)
    at = stage_times(inputs)
    expected = 0.3 * (at - 0.5) - 0.2 / 3.0 * (at**3 - 0.5**3)
    assert_allclose(inputs.stage_inputs[:, :, 13], expected, rtol=0, atol=1e-9)


def test_speed_of_a_car_that_slows_down_never_falls_below_zero():
    """Oracle: v(t) = 20 - 2 t of a car that coasts from an unknown speed; what it lost is known."""
    time = np.linspace(0.0, 5.0, 501)
    inputs = prepare(still_run(time, **{"chassis.a_x": np.full_like(time, -2.0)}), CAR, UNFILTERED)
    expected = 10.0 - 2.0 * stage_times(inputs)
    assert_allclose(inputs.stage_inputs[:, :, 13], expected, rtol=0, atol=1e-9)
    assert "slows down by 10.0 m/s" in " ".join(inputs.warnings)


def test_measured_speed_is_taken_where_there_is_one():
    time = np.linspace(0.0, 2.0, 401)
    inputs = prepare(cubic_run(time, **{"chassis.v_x": 4.0 + time}), CAR, UNFILTERED)
    assert_allclose(inputs.stage_inputs[:, :, 13], 4.0 + stage_times(inputs), rtol=0, atol=1e-9)


def test_noise_on_the_wheels_is_filtered_before_it_is_differentiated():
    """Oracle: white noise s at f_s = 1 kHz behind |H|^2 = 1/(1 + (f/f_c)^6), zero-phase, has the
    second derivative's variance 2 s^2/f_s times the integral of (2 pi f)^4 |H|^4 df, with
    integral x^4/(1 + x^6)^2 dx = pi/18 from 0 to infinity. 3000 samples of a band of 50 Hz are
    some 300 independent ones: 4 sigma are 16 %."""
    time = 0.001 * np.arange(3001)
    noise = 1e-4 * np.random.default_rng(3).normal(size=(4, 3001))
    wheels = dict(zip(WHEEL_CHANNELS, noise, strict=True))
    inputs = prepare(still_run(time, **wheels), CAR)
    found = inputs.stage_inputs[50:-50, :, 8:12].std()
    expected = 1e-4 * np.sqrt(2.0 / 1000.0 * (2 * np.pi) ** 4 * 50.0**5 * np.pi / 18.0)
    assert found == pytest.approx(expected, rel=0.16)


@pytest.mark.parametrize(("sample_step", "steps_a_sample"), [(0.005, 1), (0.01, 2), (0.003, 1)])
def test_steps_fall_on_the_samples_where_they_can(sample_step, steps_a_sample):
    """5 ms is the longest step: 10 ms takes two a sample, and 3 ms none of its own."""
    time = sample_step * np.arange(301)
    inputs = prepare(cubic_run(time), CAR)
    assert np.diff(inputs.node_time).max() <= 0.005 * (1 + 1e-9)
    if sample_step == 0.003:
        assert not inputs.on_nodes
    else:
        assert inputs.on_nodes
        assert_allclose(inputs.sample_node, steps_a_sample * np.arange(301), rtol=0, atol=0)


def test_states_between_nodes_come_from_cubic_hermite_interpolation():
    """Oracle: Hermite interpolation reproduces cubics."""
    rng = np.random.default_rng(2)
    time = np.sort(rng.uniform(0.0, 2.0, 300))
    inputs = prepare(cubic_run(time), CAR)
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.3])
    values = np.stack([cubic(inputs.node_time), -cubic(inputs.node_time)], axis=-1)
    slope = cubic.deriv()(inputs.node_time)
    rates = np.stack([slope, -slope], axis=-1)
    carried = inputs.at_samples(values[np.newaxis], rates[np.newaxis])
    assert_allclose(carried[0, :, 0], cubic(time), rtol=0, atol=1e-12)
    assert_allclose(carried[0, :, 1], -cubic(time), rtol=0, atol=1e-12)


def test_a_measured_start_takes_states_and_rates_from_the_record():
    """Oracle: cubic motions, which the cubic through the first samples reproduces."""
    time = np.linspace(0.0, 2.0, 401)
    run = cubic_run(
        time,
        **{
            "chassis.z": 0.01 + 0.2 * time - 0.1 * time**3,
            "chassis.pitch": 0.02 - 0.1 * time + 0.3 * time**2,
            "chassis.roll": -0.01 + 0.05 * time,
        },
    )
    assert prepare(run, CAR).start_state is None
    state = prepare(run, CAR, RimsSettings(initial_state="measured")).start_state
    assert_allclose(state, [0.01, 0.02, -0.01, 0.2, -0.1, 0.05], rtol=0, atol=1e-9)
    with pytest.raises(MeasurementError, match=r"chassis\.roll.*equilibrium"):
        prepare(cubic_run(time, **{"chassis.z": time}), CAR, RimsSettings(initial_state="measured"))


def test_a_measured_start_needs_samples_to_see_the_rate():
    time = np.linspace(0.0, 4.0, 81)
    channels = dict.fromkeys(OUTPUT_CHANNELS, 0.01 * np.sin(8.0 * time))
    with pytest.raises(MeasurementError, match="5 samples in its first 0.2 s"):
        prepare(still_run(time, **channels), CAR, RimsSettings(initial_state="measured"))


def test_missing_channels_are_all_named():
    time = np.linspace(0.0, 2.0, 401)
    channels = dict(still_run(time).channels)
    del channels["wheel.rl.z"], channels["chassis.a_x"]
    with pytest.raises(MeasurementError, match=r"Run short lacks wheel\.rl\.z, chassis\.a_x"):
        prepare(Run("short", time, channels), CAR)


def test_a_run_too_short_for_the_filter_is_refused():
    with pytest.raises(MeasurementError, match="at least 10 samples over 0.2 s"):
        prepare(still_run(np.linspace(0.0, 0.1, 21)), CAR)
    with pytest.raises(MeasurementError, match="at least 10 samples over 0.2 s"):
        prepare(still_run(np.linspace(0.0, 1.0, 5)), CAR)


def test_a_run_too_short_for_the_high_pass_is_refused():
    """Three periods of 0.2 Hz are 15 s."""
    run = still_run(np.arange(0.0, 14.9, 0.01))
    with pytest.raises(MeasurementError, match=r"lasts 14\.9 s, too short .* that takes 15 s"):
        recorded_motion(run, RimsSettings(output_highpass_hz=0.2))


def test_gaps_in_an_input_are_refused():
    time = np.linspace(0.0, 2.0, 401)
    broken = np.where(time > 1.0, np.nan, 0.0)
    with pytest.raises(MeasurementError, match=r"not a number.*wheel\.fr\.z"):
        prepare(still_run(time, **{"wheel.fr.z": broken}), CAR)


def test_sampling_too_coarse_for_the_filter_is_said_and_left_unfiltered():
    time = np.arange(0.0, 4.0, 0.04)
    inputs = prepare(still_run(time), CAR)
    assert "too coarse for the 20 Hz low-pass of chassis.a_x" in " ".join(inputs.warnings)


def test_milliseconds_read_as_seconds_are_refused_with_the_remedy():
    with pytest.raises(MeasurementError, match="in ms under a header that says s"):
        prepare(still_run(np.arange(0.0, 500.0, 5.0)), paper_vehicle())


def test_a_pause_in_the_record_is_refused_with_its_place():
    """A day's pause would otherwise be integrated in steps of 5 ms."""
    time = np.concatenate([np.arange(0.0, 5.0, 0.01), 86400.0 + np.arange(0.0, 5.0, 0.01)])
    with pytest.raises(MeasurementError, match=r"pauses between 4\.99 and 86400\.00 s"):
        prepare(still_run(time), paper_vehicle())


def test_a_motion_serves_one_car_after_another_as_the_run_serves_each():
    """Oracle: the run prepared for each car by itself; the first car brakes, the other cannot."""
    time = np.arange(0.0, 8.0, 0.005)
    run = still_run(time, **{"chassis.a_x": np.where((time > 3) & (time < 6), -4.0, 0.0)})
    motion = recorded_motion(run, RimsSettings())
    for car in (replace(CAR, brakes=Brakes(front_share=0.65)), CAR):
        found, expected = for_car(motion, car), prepare(run, car)
        assert np.array_equal(found.stage_inputs, expected.stage_inputs)
        assert (found.braking, found.warnings) == (expected.braking, expected.warnings)
        followed, alone = simulate_rims(car, motion), simulate_rims(car, run)
        assert np.array_equal(followed.run["chassis.pitch"], alone.run["chassis.pitch"])
    assert motion.stage_inputs[:, :, 14].max() == 0.0


def test_a_motion_takes_no_other_settings():
    motion = recorded_motion(still_run(np.arange(0.0, 2.0, 0.005)), RimsSettings())
    with pytest.raises(SimulationError, match="made with settings of its own; leave them out"):
        simulate_rims(CAR, motion, settings=RimsSettings(step=0.001))
