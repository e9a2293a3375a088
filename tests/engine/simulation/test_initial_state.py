from dataclasses import replace

import numpy as np
import pytest
from ridetune.engine.channels import OUTPUT_CHANNELS
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.run import Run
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.simulation.initial_state import swings_in
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import simulate_rims, simulate_road

from ...factories import paper_vehicle

CAR = paper_vehicle()
TIME = np.linspace(0.0, 10.0, 2001)
STILL = {name: np.zeros_like(TIME) for name in OUTPUT_CHANNELS}
SIZES = {"chassis.z": 0.01, "chassis.pitch": 0.01, "chassis.roll": 0.01}
SWING = np.exp(-2.5 * TIME) * np.cos(8.0 * TIME)
ROADS = [key for key, one in reference_manoeuvres().items() if one.kind == "road"]


def driven(key):
    """A run of a reference manoeuvre, which begins in equilibrium, with noise on its outputs."""
    run = simulate_road(CAR, reference_manoeuvres()[key]).run
    rng = np.random.default_rng(6)
    noisy = {n: run[n] + DEFAULT_NOISE[n] * rng.normal(size=run.time.size) for n in OUTPUT_CHANNELS}
    return replace(run, channels={**run.channels, **noisy})


def cut(run, begin):
    first = int(np.searchsorted(run.time, begin))
    channels = {name: run[name][first:] for name in run.columns}
    return Run(run.name, run.time[first:], channels)


def contact_with_bump():
    """When the first wheel has been lifted by a millimetre."""
    run = simulate_road(CAR, reference_manoeuvres()["bump"]).run
    return run.time[np.argmax(run["wheel.fl.z"] > 1e-3)]


def told(warnings):
    return [one for one in warnings if "starts away from rest" in one]


@pytest.mark.parametrize("channel", OUTPUT_CHANNELS)
def test_a_swing_that_dies_away_names_its_channels(channel):
    measured = {**STILL, channel: SIZES[channel] * SWING}
    [sentence] = swings_in("lap", TIME, measured, STILL)
    assert f"Run lap starts away from rest ({channel})" in sentence


@pytest.mark.parametrize("misfit", [np.ones_like(TIME), np.cos(8.0 * TIME), 0.1 * SWING])
def test_a_misfit_that_lasts_or_is_small_is_no_swing(misfit):
    """Rest values and poor parameters stay as they are; 1 mm is nothing to speak of."""
    assert swings_in("lap", TIME, {**STILL, "chassis.z": 0.01 * misfit}, STILL) == []


def test_a_short_record_has_nothing_to_compare_its_beginning_with():
    short = TIME < 1.4
    swing = {"chassis.z": 0.01 * SWING[short]}
    assert swings_in("lap", TIME[short], swing, {"chassis.z": 0.0 * SWING[short]}) == []


def test_a_jolt_soon_after_the_start_is_no_swing():
    """A bump 0.3 s from the start, under a car half as stiff as the model's."""
    run = cut(driven("bump"), float(contact_with_bump()) - 0.3)
    softer = {name: 0.5 * CAR.value(name) for name in PARAMETER_NAMES if ".suspension." in name}
    assert not told(simulate_rims(CAR.with_values(softer), run).warnings)


@pytest.mark.parametrize("key", ROADS)
def test_a_run_that_begins_in_equilibrium_is_not_told_of(key):
    """Oracle: every reference manoeuvre begins in equilibrium, some of them at speed on a rough
    road; a car off by a third in springs and dampers knows no better."""
    names = [name for name in PARAMETER_NAMES if ".suspension." in name]
    softer = {name: 0.67 * CAR.value(name) for name in names}
    for car in (CAR, CAR.with_values(softer)):
        assert not told(simulate_rims(car, driven(key)).warnings)


def test_a_run_cut_out_of_a_ride_is_told_of_unless_its_start_is_taken_as_measured():
    """Oracle: the car pulls away from 5 s on, so that at 6 s it squats."""
    ride = cut(driven("2"), 6.0)
    assert told(simulate_rims(CAR, ride).warnings)
    measured = RimsSettings(initial_state="measured")
    assert not told(simulate_rims(CAR, ride, settings=measured).warnings)


def test_the_linear_model_cannot_take_a_start_as_measured():
    ride = cut(driven("2"), 6.0)
    measured = RimsSettings(initial_state="measured")
    for settings in (RimsSettings(), measured):
        [sentence] = told(simulate_rims(CAR, ride, model="7dof", settings=settings).warnings)
        assert "begin the run at rest" in sentence
        assert "take the initial state" not in sentence


def test_a_standing_car_with_a_rest_value_does_not_start_in_motion():
    run = driven("2")
    offset = replace(run, channels={**run.channels, "chassis.z": run["chassis.z"] + 0.01})
    warnings = simulate_rims(CAR, offset).warnings
    assert not told(warnings)
    assert [one for one in warnings if "chassis.z reads 10 instead of" in one]


def test_a_fit_tells_of_a_run_cut_out_of_a_ride():
    ride = cut(driven("2"), 6.0)
    for settings, sentences in ((RimsSettings(), 1), (RimsSettings(initial_state="measured"), 0)):
        problem = Problem.build(CAR, [ride], settings=settings)
        assert len(told(identify(problem, most_evaluations=3).warnings)) == sentences
