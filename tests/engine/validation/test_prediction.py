"""Error bands of predictions, and how much of a measurement lies within them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.channels import OUTPUT_CHANNELS
from ridetune.engine.filters import in_band
from ridetune.engine.identification.fit_file import fit_to_json
from ridetune.engine.identification.identify import identify
from ridetune.engine.identification.kept_fit import fit_from_json
from ridetune.engine.identification.problem import Problem
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.measurement import read_run
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import simulate_rims
from ridetune.engine.validation.cases import Case, as_it_moved
from ridetune.engine.validation.prediction import coverage
from ridetune.engine.validation.validate import validate
from ridetune.engine.vehicle_file import reference_vehicles

FOLDER = Path(__file__).parents[3] / "sample_runs/twin"
PAPER = reference_vehicles()["paper"]
FITTED, HELD = (read_run(FOLDER / f"manoeuvre_{number}.csv") for number in (1, 2))


def kept(free, settings=None):
    problem = Problem.build(PAPER, [FITTED], free=free, settings=settings)
    return fit_from_json(json.loads(json.dumps(fit_to_json(identify(problem)))))


def predicted(fit, *cases):
    found = validate(fit.vehicle, cases, settings=fit.settings, fit=fit)
    return [{(one.mode, one.model): one for one in run.predictions} for run in found.runs]


def test_coverage_is_that_of_independent_errors():
    """Oracle: the sum of two normal errors, each of which is beyond its 95 % reach as it should;
    10,000 samples tell their share to 0.22 %, four times."""
    rng = np.random.default_rng(6)
    noise, half_width = 0.3, 1.96
    error = rng.normal(scale=1.0, size=10_000) + rng.normal(scale=noise, size=10_000)
    curve = np.sin(np.arange(10_000.0))
    found = coverage(curve + error, curve, np.full(10_000, half_width), noise)
    assert_allclose(found, 0.95, atol=0.009)
    assert coverage(curve + 5.0, curve, np.full(10_000, half_width), noise) == 0.0


def test_the_twin_lies_within_band_and_noise():
    """Oracle: the twin is the model with white noise, of whose samples 95 % lie within 1.96 times
    its deviation, told to 0.34 % by 4001 of them, four times. The 7-DOF model has no band.
    """
    cases = [Case(FITTED, "fit"), Case(HELD, "hold-out", reference_manoeuvres()["2"])]
    fitted, held = predicted(kept(None), *cases)
    for one in (fitted["rims", "8dof"], held["rims", "8dof"], held["road", "8dof"]):
        for name in OUTPUT_CHANNELS:
            assert_allclose(one.scores[name].coverage, 0.95, atol=0.014)
            assert 0.0 < one.half_width[name].max() < 1.96 * HELD.noise[name]
    for mode in ("rims", "road"):
        assert not held[mode, "7dof"].half_width
        assert held[mode, "7dof"].scores["chassis.z"].coverage is None


@pytest.mark.parametrize("settings", [RimsSettings(), RimsSettings(output_cutoff_hz=3.0)])
def test_a_band_is_of_what_is_compared(settings):
    """Oracle: with one parameter, its 95 % interval times the curve's derivative, through the
    output filter; differences of 1 % leave 1e-4 of it, the interval of log K 1e-3."""
    fit = kept(["K_R"], settings)
    [one] = fit.ended["parameters"]
    low, high = one["confidence_interval"]
    [found] = predicted(fit, Case(HELD, "hold-out"))
    ends = [
        simulate_rims(fit.vehicle.with_values({one["name"]: share * one["value"]}), HELD).run
        for share in (0.99, 1.01)
    ]
    for name in OUTPUT_CHANNELS:
        change = in_band(HELD.time, ends[1][name] - ends[0][name], settings.output_band)
        expected = np.abs(change) / (0.02 * one["value"]) * 0.5 * (high - low)
        half_width = found["rims", "8dof"].half_width[name]
        assert_allclose(half_width, expected, rtol=0, atol=2e-3 * half_width.max())


def louder(run, noise):
    """A run with so much more noise on z, of which it says nothing."""
    more = np.random.default_rng(3).normal(scale=noise, size=len(run.time))
    return replace(run, channels={**run.channels, "chassis.z": run["chassis.z"] + more})


@pytest.mark.parametrize("asked", ["noise", "sensors"])
def test_noise_typed_for_a_fit_counts_in_all_that_it_predicts(asked):
    """Oracle: 95 % of white noise, told to 0.34 % by 4001 samples, four times; the runs' own notes
    tell of a quarter of it."""
    noise = float(np.hypot(2e-3, HELD.noise["chassis.z"]))
    typed = {"noise": {"chassis.z": noise}, "sensors": {"chassis.z": {"noise": noise}}}
    runs = [louder(run, 2e-3) for run in (FITTED, HELD)]
    problem = Problem.build(PAPER, runs[:1], free=["K_R"], **{asked: typed[asked]})
    fit = json.loads(json.dumps(fit_to_json(identify(problem))))
    [seen] = fit["runs"]
    assert seen["noise_source"] == {
        "chassis.z": "typed",
        "chassis.pitch": "stated",
        "chassis.roll": "stated",
    }
    cases = [
        Case(as_it_moved(runs[0], fit, seen["name"]), "fit"),
        Case(as_it_moved(runs[1], fit, None), "hold-out"),
    ]
    for found in predicted(fit_from_json(fit), *cases):
        for score in found["rims", "8dof"].scores.values():
            assert_allclose(score.coverage, 0.95, atol=0.014)


@pytest.mark.parametrize("fit_noise", [False, True])
def test_coverage_tells_as_much_behind_a_filter(fit_noise):
    """Oracle: 95 % of the noise that is left, stated before the filter or found behind it.

    20 s of a band of 3 Hz are worth 120 samples, six channels 720, which tell a share of 95 % to
    0.8 %: four times. In 0.1 s at each end, 1 % of the run, the filter leaves more, half of which
    is within.
    """
    settings = RimsSettings(output_cutoff_hz=3.0)
    problem = Problem.build(PAPER, [FITTED], free=["K_R"], settings=settings, fit_noise=fit_noise)
    fit = json.loads(json.dumps(fit_to_json(identify(problem))))
    cases = [
        Case(as_it_moved(FITTED, fit, fit["runs"][0]["name"]), "fit"),
        Case(as_it_moved(HELD, fit, None), "hold-out"),
    ]
    found = predicted(fit_from_json(fit), *cases)
    shares = [one.coverage for run in found for one in run["rims", "8dof"].scores.values()]
    assert_allclose(np.mean(shares), 0.95, atol=4 * 0.008 + 0.005)


def fit_of(*runs):
    """What a fit tells of the noise of runs, behind a z that reads twice."""
    sensors = {"fixed_sensors": {"chassis.z": {"gain": 2.0}}, "sensors": []}
    return {"runs": runs, "settings": {}, **sensors}


def fitted_run(name, samples, **noise):
    """A run of a fit; noise : by channel of the chassis, value and source."""
    return {
        "name": name,
        "samples": samples,
        "noise": {f"chassis.{channel}": value for channel, (value, _) in noise.items()},
        "noise_source": {f"chassis.{channel}": source for channel, (_, source) in noise.items()},
    }


def test_a_run_that_was_fitted_has_the_noise_that_the_fit_used():
    """Oracle: what the fit tells of it, whatever it is from, and half of it for z."""
    one = fitted_run("one", 100, z=(4e-3, "fitted"), pitch=(3e-4, "default"), roll=(1e-3, "typed"))
    fit = fit_of(one, fitted_run("other", 100, z=(9e-3, "fitted"), roll=(1e-3, "typed")))
    run = as_it_moved(replace(HELD, noise={"chassis.roll": 5e-4}), fit, "one")
    expected = {"chassis.z": 2e-3, "chassis.pitch": 3e-4, "chassis.roll": 1e-3}
    assert run.noise == pytest.approx(expected)
    assert_allclose(run["chassis.z"], 0.5 * HELD["chassis.z"])


@pytest.mark.parametrize("turned", [False, True])
def test_a_run_that_was_not_fitted_has_the_noise_of_the_sensors_in_any_order(turned):
    """Oracle: by hand, the root of (300 * 2^2 + 100 * 6^2) / 400 = 12, halved by the gain; what a
    fitted run states for itself is not another's."""
    runs = [
        fitted_run("long", 300, z=(2e-3, "fitted"), pitch=(1e-3, "typed"), roll=(1e-3, "stated")),
        fitted_run("short", 100, z=(6e-3, "fitted"), pitch=(1e-3, "typed")),
    ]
    fit = fit_of(*(reversed(runs) if turned else runs))
    run = as_it_moved(replace(HELD, noise={"chassis.pitch": 3e-4, "chassis.roll": 5e-4}), fit, None)
    expected = {"chassis.z": 0.5e-3 * 12**0.5, "chassis.pitch": 1e-3, "chassis.roll": 5e-4}
    assert run.noise == pytest.approx(expected)
