import threading

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.channels import OUTPUT_CHANNELS
from ridetune.engine.errors import Cancelled
from ridetune.engine.filters import low_pass
from ridetune.engine.identification.problem import Problem
from ridetune.engine.identification.residuals import FAILED_TRIAL, Residuals
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.simulation.rims_settings import RimsSettings

from ... import stand_in

CAR = stand_in.REFERENCE
ELSEWHERE = {name: 1.2 * CAR.value(name) for name in PARAMETER_NAMES}


def problem(runs, **named):
    return Problem.build(CAR, runs, start=ELSEWHERE, **named)


def start_of(asked):
    return np.array([one.variable(one.start) for one in asked.free])


def exact_jacobian(asked, run):
    """Blocks of the stand-in's derivative: its basis over the noise, angles by their scale."""
    slopes = [1.0 if one.logarithmic else 10.0 * one.scale for one in asked.free]
    basis = stand_in.basis(run.time)[:, :, :-1] * np.array(slopes)
    noise = [DEFAULT_NOISE[channel] for channel in OUTPUT_CHANNELS]
    return np.concatenate([basis[:, k] / noise[k] for k in range(3)])


def test_residuals_are_model_minus_measured_over_noise():
    """Oracle: the stand-in's closed form, run by run and channel by channel."""
    first = stand_in.recording(CAR, name="a", seed=1)
    second = stand_in.recording(CAR, name="b", seed=2, outputs=["chassis.roll"])
    asked = problem([first, second], noise={"chassis.roll": 1e-3})
    residuals = Residuals(asked, stand_in.simulate)
    r = residuals.vector(start_of(asked))
    model = stand_in.basis(first.time) @ stand_in.weights_of(asked.vehicle)
    for block in residuals.blocks():
        run = {"a": first, "b": second}[block.run]
        noise = 1e-3 if block.channel == "chassis.roll" else DEFAULT_NOISE[block.channel]
        of_channel = model[:, OUTPUT_CHANNELS.index(block.channel)]
        assert_allclose(r[block.place], (of_channel - run[block.channel]) / noise, atol=1e-9)
    assert [(block.run, block.channel) for block in residuals.blocks()] == [
        *(("a", channel) for channel in OUTPUT_CHANNELS),
        ("b", "chassis.roll"),
    ]


def test_jacobian_is_the_derivative():
    """Oracle: closed form. The model is linear in x, so what is left is rounding: residuals of
    order 100 with 1e-16 each over a step of 1e-4."""
    run = stand_in.recording(CAR)
    asked = problem([run])
    residuals = Residuals(asked, stand_in.simulate)
    found = residuals.jacobian(start_of(asked))
    assert_allclose(found, exact_jacobian(asked, run), rtol=0, atol=1e-8)
    assert residuals.simulations == 1 + 2 * len(PARAMETER_NAMES)


@pytest.mark.parametrize("side", ["lower", "upper"])
def test_jacobian_at_a_bound_looks_only_inwards(side):
    """Oracle: closed form, and no car beyond the bounds is asked for."""
    run = stand_in.recording(CAR)
    asked = problem([run])
    seen = []

    def simulate(cars, inputs, traction):
        seen.append(stand_in.values_of(cars))
        return stand_in.simulate(cars, inputs, traction)

    residuals = Residuals(asked, simulate)
    found = residuals.jacobian(getattr(residuals, side))
    assert_allclose(found, exact_jacobian(asked, run), rtol=0, atol=1e-7)
    for one in asked.free:
        values, rounding = np.concatenate([cars[one.name] for cars in seen]), 1e-12
        assert min(values) >= one.lower - rounding
        assert max(values) <= one.upper + rounding


def failing(condition):
    """The stand-in, failing for cars that meet a condition on their parameters by name."""

    def simulate(cars, inputs, traction):
        histories = stand_in.simulate(cars, inputs, traction)
        histories[condition(stand_in.values_of(cars))] = np.nan
        return histories

    return simulate


def test_a_failed_car_has_large_finite_residuals():
    asked = problem([stand_in.recording(CAR)])
    residuals = Residuals(asked, failing(lambda values: slice(None)))
    x = start_of(asked)
    assert np.all(residuals.vector(x) == FAILED_TRIAL)
    assert np.all(np.isinf(residuals.costs([x])))
    assert np.all(np.isnan(residuals.model(x)["lap"]["chassis.z"]))


def test_a_neighbour_that_fails_leaves_a_one_sided_difference():
    """Oracle: closed form; a difference of first order is exact for a linear model."""
    run = stand_in.recording(CAR)
    asked = problem([run])
    name = PARAMETER_NAMES[0]
    stiffer = failing(lambda values: values[name] > 1.00001 * ELSEWHERE[name])
    found = Residuals(asked, stiffer).jacobian(start_of(asked))
    assert_allclose(found, exact_jacobian(asked, run), rtol=0, atol=1e-7)


def test_a_parameter_whose_neighbours_all_fail_has_no_derivative():
    asked = problem([stand_in.recording(CAR)])
    name = PARAMETER_NAMES[0]
    both = failing(lambda values: abs(values[name] / ELSEWHERE[name] - 1.0) > 1e-5)
    found = Residuals(asked, both).jacobian(start_of(asked))
    assert np.all(found[:, 0] == 0.0)
    assert np.all(np.any(found[:, 1:] != 0.0, axis=0))


def test_the_output_filter_is_applied_to_model_and_measurement_alike():
    """Oracle: filtering is linear, so the residual is the filtered residual."""
    run = stand_in.recording(CAR)
    plain = problem([run])
    filtered = problem([run], settings=RimsSettings(output_cutoff_hz=5.0))
    x = start_of(plain)
    expected = Residuals(plain, stand_in.simulate).vector(x).reshape(3, -1)
    found = Residuals(filtered, stand_in.simulate).vector(x).reshape(3, -1)
    assert_allclose(found, low_pass(run.time, expected.T, 5.0).T, rtol=0, atol=1e-9)


def test_the_output_high_pass_is_applied_to_model_and_measurement_alike():
    """Oracle: as of the low-pass; the two together leave the band between them."""
    run = stand_in.recording(CAR)
    plain = problem([run])
    band = problem([run], settings=RimsSettings(output_cutoff_hz=5.0, output_highpass_hz=1.0))
    x = start_of(plain)
    expected = Residuals(plain, stand_in.simulate).vector(x).reshape(3, -1).T
    expected = low_pass(run.time, expected, 5.0)
    expected -= low_pass(run.time, expected, 1.0)
    found = Residuals(band, stand_in.simulate).vector(x).reshape(3, -1)
    assert_allclose(found, expected.T, rtol=0, atol=1e-9)


def test_cancel_is_seen_while_a_simulation_is_under_way():
    """The simulation ends only after Cancelled is raised, so a cancel cannot have waited for it."""
    asked = problem([stand_in.recording(CAR)])
    under_way, raised = threading.Event(), threading.Event()

    def simulate(cars, inputs, traction):
        under_way.set()
        raised.wait(60.0)
        return stand_in.simulate(cars, inputs, traction)

    residuals = Residuals(asked, simulate, cancelled=under_way.is_set)
    try:
        with pytest.raises(Cancelled):
            residuals.vector(start_of(asked))
    finally:
        raised.set()


def test_a_car_that_bounds_admit_but_geometry_does_not_is_a_failed_trial():
    """Each bound is possible with the start's other value; together the arm stands upright."""
    angle, distance = "front.pivot.angle", "front.pivot.distance"
    bounds = {angle: (-1.46, 1.3), distance: (0.1, 10.0)}
    residuals = Residuals(
        Problem.build(CAR, [stand_in.recording(CAR)], [angle, distance], bounds=bounds),
        stand_in.simulate,
    )
    assert np.all(residuals.vector(residuals.lower) == FAILED_TRIAL)
    assert list(np.isfinite(residuals.costs([residuals.lower, residuals.upper]))) == [False, True]


def test_long_runs_are_simulated_in_batches_of_whole_lanes():
    asked = problem([stand_in.recording(CAR, samples=30_001)])
    sizes = []

    def simulate(cars, inputs, traction):
        sizes.append(len(cars))
        return stand_in.simulate(cars, inputs, traction)

    residuals = Residuals(asked, simulate)
    residuals.costs([start_of(asked)] * 20)
    assert sorted(sizes) == [4, 8, 8]
