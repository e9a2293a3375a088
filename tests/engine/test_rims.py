from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.channels import Run
from ridetune.engine.errors import MeasurementError, SimulationError, VehicleError
from ridetune.engine.rims import (
    INPUT_CHANNELS,
    WHEEL_CHANNELS,
    RimsSettings,
    braking_weight,
    find_braking,
    prepare,
)
from ridetune.engine.vehicle import Brakes

from ..factories import paper_vehicle

CAR = paper_vehicle()
BRAKED = replace(CAR, brakes=Brakes(front_share=0.65))
UNFILTERED = RimsSettings(a_x_cutoff_hz=None)
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
    inputs = prepare(cubic_run(np.linspace(1.0, 3.0, 401)), CAR, UNFILTERED)
    at = stage_times(inputs)
    expected = 0.3 * (at - 1.0) - 0.2 / 3.0 * (at**3 - 1.0)
    assert_allclose(inputs.stage_inputs[:, :, 13], expected, rtol=0, atol=1e-9)


def test_measured_speed_is_taken_where_there_is_one():
    time = np.linspace(0.0, 2.0, 401)
    inputs = prepare(cubic_run(time, **{"chassis.v_x": 4.0 + time}), CAR, UNFILTERED)
    assert_allclose(inputs.stage_inputs[:, :, 13], 4.0 + stage_times(inputs), rtol=0, atol=1e-9)


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


def test_braking_is_found_where_the_car_decelerates_long_and_hard_enough():
    """Oracle: the begin and end of a stop; a 1 Hz low-pass shifts an edge of 4 m/s2 seen at a
    seventh of it by less than half a period."""
    time = np.arange(0.0, 20.0, 0.005)
    a_x = np.zeros_like(time)
    a_x[(time > 5.0) & (time < 9.0)] = -4.0
    a_x[(time > 12.0) & (time < 12.1)] = -4.0
    a_x[time > 15.0] = -0.4
    [(begin, end)] = find_braking(time, a_x, rolling_share=0.01)
    assert abs(begin - 5.0) < 0.5
    assert abs(end - 9.0) < 0.5


def test_braking_weight_ramps_over_a_tenth_of_a_second_outside_the_interval():
    time = np.array([4.8, 4.9, 4.95, 5.0, 7.0, 9.0, 9.05, 9.1, 9.2])
    expected = [0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 0.5, 0.0, 0.0]
    assert_allclose(braking_weight(time, [(5.0, 9.0)]), expected, rtol=0, atol=1e-12)


def test_a_braking_car_needs_brakes_to_brake_with():
    time = np.arange(0.0, 10.0, 0.005)
    run = still_run(time, **{"chassis.a_x": np.where((time > 3) & (time < 6), -4.0, 0.0)})
    assert prepare(run, BRAKED).stage_inputs[:, :, 14].max() == 1.0
    without = prepare(run, CAR)
    assert without.stage_inputs[:, :, 14].max() == 0.0
    assert "no brakes" in " ".join(without.warnings)


def test_marked_braking_goes_before_what_a_x_shows():
    time = np.arange(0.0, 10.0, 0.005)
    run = still_run(time, **{"chassis.a_x": np.where((time > 3) & (time < 6), -4.0, 0.0)})
    marked = RimsSettings(braking_intervals=((7.0, 8.0),))
    weight = prepare(run, BRAKED, marked).stage_inputs[:, 0, 14]
    begin = np.arange(len(weight)) * 0.005
    assert_allclose(weight, braking_weight(begin, [(7.0, 8.0)]), rtol=0, atol=1e-9)
    with pytest.raises(VehicleError, match="no brakes"):
        prepare(run, CAR, marked)


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
    state = prepare(run, CAR, RimsSettings(start="measured")).start_state
    assert_allclose(state, [0.01, 0.02, -0.01, 0.2, -0.1, 0.05], rtol=0, atol=1e-9)
    with pytest.raises(MeasurementError, match=r"chassis\.roll.*equilibrium"):
        prepare(cubic_run(time, **{"chassis.z": time}), CAR, RimsSettings(start="measured"))


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


def test_gaps_in_an_input_are_refused():
    time = np.linspace(0.0, 2.0, 401)
    broken = np.where(time > 1.0, np.nan, 0.0)
    with pytest.raises(MeasurementError, match=r"not a number.*wheel\.fr\.z"):
        prepare(still_run(time, **{"wheel.fr.z": broken}), CAR)


def test_sampling_too_coarse_for_the_filter_is_said_and_left_unfiltered():
    time = np.arange(0.0, 4.0, 0.04)
    inputs = prepare(still_run(time), CAR)
    assert "too coarse for the 20 Hz low-pass of chassis.a_x" in " ".join(inputs.warnings)


@pytest.mark.parametrize(
    "wrong",
    [
        {"a_x_cutoff_hz": 0.0},
        {"output_cutoff_hz": -1.0},
        {"start": "running"},
        {"step": 0.0},
        {"step": 0.1},
        {"braking_intervals": ((3.0, 2.0),)},
    ],
)
def test_settings_that_mean_nothing_are_refused(wrong):
    with pytest.raises(SimulationError):
        RimsSettings(**wrong)


def test_milliseconds_read_as_seconds_are_refused_with_the_remedy():
    with pytest.raises(MeasurementError, match="in ms under a header that says s"):
        prepare(still_run(np.arange(0.0, 500.0, 5.0)), paper_vehicle())


def test_a_pause_in_the_record_is_refused_with_its_place():
    """A day's pause would otherwise be integrated in steps of 5 ms."""
    time = np.concatenate([np.arange(0.0, 5.0, 0.01), 86400.0 + np.arange(0.0, 5.0, 0.01)])
    with pytest.raises(MeasurementError, match=r"pauses between 4\.99 and 86400\.00 s"):
        prepare(still_run(time), paper_vehicle())
