"""Advice after fits that are not plain: other sensors, losses, and noise that differs by run."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.campaign import Campaign, chosen
from ridetune.engine.channels import OUTPUT_CHANNELS
from ridetune.engine.filters import low_pass
from ridetune.engine.identification.advisor import advise
from ridetune.engine.identification.expected_noise import noise_of_runs
from ridetune.engine.identification.fit_file import fit_to_json
from ridetune.engine.identification.identify import identify
from ridetune.engine.identification.loss import Loss
from ridetune.engine.identification.problem import Problem
from ridetune.engine.identification.uncertainty import RunResiduals
from ridetune.engine.plant import ConceptPlant
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.sensor_file import noisy
from ridetune.engine.vehicle_file import reference_vehicles

CAR = reference_vehicles()["paper"]
FREE = ["K_F", "C_F", "K_R", "C_R", "d_R", "phi_R"]
BRAKING = chosen(("brake-54",))


def recorded(factor=1.0):
    """Manoeuvres 1, 2 and braking with so many times the default noise, by key."""
    noise = {name: factor * one for name, one in DEFAULT_NOISE.items()}
    plan = Campaign.plan(
        ConceptPlant(CAR), noisy(noise, "noise"), chosen(("1", "2", "brake-54")), seed=1
    )
    recordings = (plan.record(name, lambda _: None, lambda: False) for name in plan.manoeuvres)
    return {one.name.removeprefix("manoeuvre_"): one.run for one in recordings}


@pytest.fixture(scope="module")
def runs():
    return recorded()


def fitted_and_advised(candidates, *recordings, **told):
    problem = Problem.build(CAR, recordings, FREE, **told)
    fit = identify(problem)
    return fit, advise(problem.as_fitted(fit_to_json(fit)), candidates)


def relative(parameters):
    return np.array([one.relative for one in parameters])


def test_the_unit_of_a_sensor_changes_no_advice(runs):
    """Oracle: the same fit in metres. In mm and thousandths of a radian a gain of 1000 is stated,
    so that every residual is what it was, to rounding."""
    _, known = fitted_and_advised(BRAKING, runs["1"])
    thousandths = {name: 1e3 * runs["1"][name] for name in OUTPUT_CHANNELS}
    run = replace(
        runs["1"],
        channels={**runs["1"].channels, **thousandths},
        noise={name: 1e3 * runs["1"].noise[name] for name in OUTPUT_CHANNELS},
    )
    sensors = {name: {"gain": 1e3} for name in OUTPUT_CHANNELS}
    _, found = fitted_and_advised(BRAKING, run, sensors=sensors)
    assert_allclose(relative(found.now), relative(known.now), rtol=1e-4)
    after, before = found.ranked[0].after, known.ranked[0].after
    assert_allclose(relative(after), relative(before), rtol=1e-4)


@pytest.mark.parametrize("loss", [Loss(), Loss("huber", 1.0), Loss("cauchy", 1.0)])
def test_the_same_run_once_more_halves_the_variances(runs, loss):
    """Whatever a residual counts: twice the information. Noise of a run with a taper at its ends
    and errors of the spectra's frequencies are below 2 %."""
    _, found = fitted_and_advised(chosen(("1",)), runs["1"], loss=loss)
    ratio = relative(found.ranked[0].after) / relative(found.now)
    assert_allclose(ratio, np.sqrt(0.5), rtol=0.02)


def test_the_order_of_runs_with_noise_of_their_own_changes_no_advice(runs):
    loud = recorded(5.0)["2"]
    found = [
        fitted_and_advised(BRAKING, *order, fit_noise=True)[1]
        for order in ([runs["1"], loud], [loud, runs["1"]])
    ]
    now, after = (
        [relative(part) for part in parts] for parts in zip(*map(told, found), strict=True)
    )
    assert_allclose(now[0], now[1], rtol=1e-4)
    assert_allclose(after[0], after[1], rtol=1e-4)


def told(advisory):
    return advisory.now, advisory.ranked[0].after


def test_what_is_found_of_the_sensors_widens_what_a_run_would_tell(runs):
    """Oracle: the fit with the run. Values move by their errors and spectra are known to some 10 %,
    so a factor 1.3; with ideal sensors K_F would have a quarter of its error."""
    sensors = {
        "chassis.z": {"gain": "fit", "bias": "fit", "delay": "fit"},
        "chassis.pitch": {"gain": "fit", "bias": "fit"},
        "chassis.a_x": {"gain": "fit", "bias": "fit"},
    }
    fit, found = fitted_and_advised(BRAKING, runs["1"], sensors=sensors)
    assert_allclose(
        relative(found.now), [one.std_error / abs(one.value) for one in fit.parameters], rtol=0.01
    )
    both = identify(Problem.build(CAR, [runs["1"], runs["brake-54"]], FREE, sensors=sensors))
    errors = [one.std_error / abs(one.value) for one in both.parameters]
    ratio = relative(found.ranked[0].after) / errors
    assert np.all((ratio > 1 / 1.3) & (ratio < 1.3)), ratio


def test_noise_of_pairs_from_different_runs_is_noise_that_can_be():
    """One run has a quiet z alone, the other z and pitch that share slow noise; the averages as
    they are would make their difference less than nothing."""
    rng, count, step = np.random.default_rng(0), 4000, 0.005
    time = step * np.arange(count)
    slow = 5.0 * low_pass(time, rng.standard_normal(count), 2.0)
    both = slow + 0.1 * rng.standard_normal((2, count))
    found = noise_of_runs(
        SimpleNamespace(runs=[compared("chassis.z"), compared("chassis.z", "chassis.pitch")]),
        [
            RunResiduals(residuals, rng.standard_normal((*residuals.shape, 2)), step)
            for residuals in (0.1 * rng.standard_normal((1, count)), both)
        ],
        50.0 * np.eye(2),
    )
    powers = np.linalg.eigvalsh(found.density.transpose(2, 0, 1))
    assert np.min(powers) > -1e-12 * np.max(powers)
    assert np.min(powers[:, 1]) > 0.0


def compared(*channels):
    return SimpleNamespace(measured=dict.fromkeys(channels), noise=dict.fromkeys(channels, 1.0))
