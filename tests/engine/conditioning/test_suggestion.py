"""What is suggested of what a run has, and that a fit of what comes out finds the car."""

from dataclasses import replace

import numpy as np
import pytest
from ridetune.engine.channels import CORNERS
from ridetune.engine.conditioning.chain import condition
from ridetune.engine.conditioning.suggestion import suggest
from ridetune.engine.filters import in_band
from ridetune.engine.identification.fit_file import fit_to_json
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.measurement import missing_for_identification
from ridetune.engine.run import Run
from ridetune.engine.simulation.rims import prepare
from ridetune.engine.simulation.rims_settings import RimsSettings
from scipy.interpolate import CubicSpline

from ...factories import paper_vehicle
from ...raw_sensors import drive, recorded

CAR = paper_vehicle()
COMPLETE = (
    "chassis.z",
    "chassis.pitch",
    "chassis.roll",
    "chassis.a_x",
    *(f"wheel.{corner}.z" for corner in CORNERS),
)
START = {
    "front.suspension.stiffness": 1.3,
    "front.suspension.damping": 0.7,
    "rear.suspension.stiffness": 0.8,
    "rear.suspension.damping": 1.3,
}


@pytest.fixture(scope="module")
def driven():
    return drive(CAR)


@pytest.fixture(scope="module")
def raw(driven):
    return recorded(CAR, driven, seed=1)


def only(run, *parts):
    """The run with the channels whose names hold one of the parts."""
    kept = {name: run[name] for name in run.columns if any(part in name for part in parts)}
    return replace(run, channels=kept)


def kinds(suggestion):
    return [step.kind for step in suggestion.steps]


def test_nothing_is_suggested_for_a_recording_that_has_all(driven):
    whole = Run("r", driven.time[::3], {name: driven[name][::3] for name in COMPLETE})
    found = suggest(whole, CAR)
    assert (found.steps, found.lacks, found.output_highpass_hz) == ((), (), None)


def test_potentiometers_gyros_and_accelerometers_make_all_that_is_needed(raw):
    found = suggest(raw, CAR)
    assert kinds(found) == [
        "resample",
        "rest",
        "speed",
        "angles",
        "angles",
        "gravity",
        "displacement",
        "rim-from-travel",
    ]
    assert len(found.reasons) == len(found.steps)
    assert found.lacks == ()
    assert found.output_highpass_hz == pytest.approx(0.6)
    assert missing_for_identification(condition(raw, found.steps, CAR)) == ()


def test_a_standstill_that_no_speed_shows_is_told_as_assumed(raw):
    told, untold = suggest(raw, CAR), suggest(only(raw, "body_a", "_rate"), CAR)
    assert "the car stands from" in told.reasons[kinds(told).index("rest")]
    assert "is assumed" in untold.reasons[kinds(untold).index("rest")]


def test_hub_accelerometers_do_without_a_vehicle(raw):
    found = suggest(raw)
    assert kinds(found)[-2:] == ["displacement", "displacement"]
    assert found.steps[-1].channels == tuple(f"wheel.{corner}.a_z" for corner in CORNERS)
    assert missing_for_identification(condition(raw, found.steps)) == ()


def test_one_accelerometer_gives_and_several_give(raw):
    told = suggest(only(raw, "body_a_", "_rate", "v_x", "wheel.")).reasons
    assert "displacement: chassis.a_z gives chassis.z in a band." in told
    assert any("wheel.rl.a_z and wheel.rr.a_z give wheel.fl.z, " in one for one in told)


def test_what_no_step_makes_is_named_with_its_remedy(raw):
    found = suggest(only(raw, "travel"))
    assert found.lacks[0].startswith("wheel.fl.z: give a vehicle, with which suspension.fl.travel")
    assert "chassis.a_x: record chassis.body_a_x with a pitch gyro, or chassis.v_x." in found.lacks
    assert found.lacks[-1].startswith("chassis.z, .pitch or .roll: record a gyro")
    found = suggest(only(raw, "body_a", "_rate"), CAR)
    assert found.lacks == tuple(
        f"wheel.{c}.z: record suspension.{c}.travel beside z, pitch and roll, or wheel.{c}.a_z."
        for c in CORNERS
    )


def test_gaps_spikes_and_uneven_samples_are_mended_first(driven):
    time = driven.time[::3].copy()
    time[1:-1] += 0.001 * np.random.default_rng(0).uniform(-1.0, 1.0, time.size - 2)
    channels = {name: driven[name][::3].copy() for name in COMPLETE}
    channels["chassis.z"][500] = np.nan
    channels["chassis.pitch"][900] += 0.3
    run = Run("r", time, channels)
    found = suggest(run, CAR)
    assert kinds(found) == ["fill", "despike", "resample"]
    assert suggest(condition(run, found.steps), CAR).steps == ()


def test_a_suggested_chain_comes_to_the_true_channels(driven, raw):
    """Oracle: the simulation.

    pitch, roll: white noise of 0.05 deg/s at 500 Hz, integrated above 0.2 Hz, is 0.05 deg
    sqrt(2 / 500 / (4 pi^2 0.2)) = 0.001 deg, the rate's bias from 4.9 s at rest 0.001 deg/s, and an
    accelerometer's mean error of 0.03 / 9.81 over the crossover's 2.5 s 0.005 deg: 0.02 deg is
    twice their sum.
    z in its band, compared above 0.6 Hz: 0.03 m/s2 of noise there are 0.03 mm
    (0.03 sqrt(2 / 500 / 3) / (2 pi)^2 / 0.6^1.5), and 0.1 mg of its mean at the ends 0.07 mm.
    The wheels have the potentiometers' 0.2 mm on top of it, of which the thinning leaves 0.4.
    """
    found = suggest(raw, CAR)
    made = condition(raw, found.steps, CAR)

    def error(name, low=None):
        true = CubicSpline(driven.time, driven[name])(made.time)
        return np.std(in_band(made.time, made[name] - true, (low, None)))

    assert error("chassis.pitch") < np.radians(0.02)
    assert error("chassis.roll") < np.radians(0.02)
    assert error("chassis.a_x") < 0.03
    assert error("chassis.z", found.output_highpass_hz) < 0.15e-3
    for corner in CORNERS:
        assert error(f"wheel.{corner}.z", found.output_highpass_hz) < 0.25e-3


@pytest.mark.parametrize("vehicle", [CAR, None])
def test_a_fit_to_what_raw_sensors_recorded_finds_stiffness_and_damping(raw, vehicle):
    """Oracle: the car that drove. Potentiometers with a vehicle, hub accelerometers without one.

    Four standard errors, and each known to 1 % (2 % without a z that is measured: what the tilt of
    the hubs adds is no noise).
    """
    found = suggest(raw, vehicle)
    made = condition(raw, found.steps, vehicle)
    start = {name: factor * CAR.value(name) for name, factor in START.items()}
    settings = RimsSettings(output_highpass_hz=found.output_highpass_hz)
    fit = identify(Problem.build(CAR, [made], start, start=start, settings=settings))
    assert fit.converged
    assert not any("are compared below" in warning for warning in fit.warnings)
    for one in fit.parameters:
        true = CAR.value(one.name)
        assert one.determined == "yes"
        assert abs(one.value - true) < 4.0 * one.std_error, one.name
        assert one.std_error < 0.01 * true
    kept = fit_to_json(fit)["runs"][0]["conditioning"]
    assert [record["step"]["kind"] for record in kept] == kinds(found)


def test_a_comparison_below_the_band_of_a_channel_is_warned_of(raw):
    made = condition(raw, suggest(raw, CAR).steps, CAR)
    [warning] = prepare(made, CAR).warnings
    assert warning.startswith(
        "Run raw has wheel.fl.z, wheel.fr.z, wheel.rl.z, wheel.rr.z, chassis.z"
    )
    assert "set output_highpass_hz to 0.6, at least to 0.3" in warning
    assert prepare(made, CAR, RimsSettings(output_highpass_hz=0.6)).warnings == ()
