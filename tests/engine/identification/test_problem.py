import math
from dataclasses import replace

import numpy as np
import pytest
from ridetune.engine.channels import INPUT_CHANNELS, OUTPUT_CHANNELS
from ridetune.engine.errors import MeasurementError, ParameterError, ProblemError
from ridetune.engine.filters import low_pass
from ridetune.engine.identification.problem import FreeParameter, Problem
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.run import Run
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.simulation.rims_settings import RimsSettings

from ...factories import paper_vehicle

CAR = paper_vehicle()
SPRING, BAR, PIVOT = PARAMETER_NAMES[0], PARAMETER_NAMES[4], PARAMETER_NAMES[8]


def recording(name="lap", outputs=OUTPUT_CHANNELS, seed=0, **others):
    time = np.linspace(0.0, 2.0, 401)
    rng = np.random.default_rng(seed)
    channels = dict.fromkeys(INPUT_CHANNELS, np.zeros_like(time))
    channels |= {channel: 0.01 * rng.normal(size=401) for channel in outputs}
    return Run(name, time, channels, **others)


def test_an_interval_is_symmetric_in_the_search_s_variable():
    """Oracle: a factor either way for a logarithm, scale times the change for an angle."""
    spring = FreeParameter(SPRING, 2e4, 1e3, 1.6e5)
    x = spring.variable(24000.0)
    assert spring.interval(x, math.log(2.0), math.log(2.0)) == pytest.approx((12000.0, 48000.0))
    outside = FreeParameter(PIVOT, -1.0, -10.0, -0.1)
    x = outside.variable(-1.5)
    assert outside.interval(x, math.log(2.0), math.log(3.0)) == pytest.approx((-4.5, -0.75))
    assert outside.interval(x, math.inf, math.log(3.0)) == (pytest.approx(-4.5), math.inf)
    angle = FreeParameter("front.pivot.angle", 0.1, -0.3, 1.3)
    x = angle.variable(0.2)
    assert angle.interval(x, 1.0, 2.0) == pytest.approx((0.1, 0.4))
    assert angle.interval(x, math.inf, math.inf) == (-math.inf, math.inf)


def test_an_end_a_thousand_times_away_is_infinite():
    spring = FreeParameter(SPRING, 2e4, 1e3, 1.6e5)
    assert spring.interval(0.0, 7.0, 7.0) == (-math.inf, math.inf)
    assert spring.interval(0.0, 6.0, 6.0) == pytest.approx((2e4 * np.exp(-6), 2e4 * np.exp(6)))


def refused(*arguments, **named):
    with pytest.raises((ProblemError, ParameterError, MeasurementError)) as raised:
        Problem.build(*arguments, **named)
    return str(raised.value)


def test_without_further_words_all_twelve_are_free_between_default_bounds():
    problem = Problem.build(CAR, [recording()])
    assert tuple(one.name for one in problem.free) == PARAMETER_NAMES
    assert problem.free[0] == FreeParameter(SPRING, 24000.0, 0.05 * 24000.0, 8.0 * 24000.0)
    assert problem.runs[0].noise == DEFAULT_NOISE


def test_free_and_fixed_take_names_and_symbols():
    problem = Problem.build(CAR, [recording()], free=["K_F", "rear.pivot.angle"])
    assert [one.name for one in problem.free] == [SPRING, "rear.pivot.angle"]
    held = Problem.build(CAR, [recording()], fixed=["Ctor_F", "Ctor_R"])
    assert len(held.free) == 10


def test_bounds_and_starts_that_would_be_ignored_are_refused():
    held = refused(CAR, [recording()], fixed=[BAR], bounds={BAR: (1.0, 2.0)})
    assert f"Bounds are given for {BAR}, which is not free" in held
    twice = refused(CAR, [recording()], start={"K_F": 3e4, SPRING: 4e4})
    assert f"{SPRING} has more than one start value" in twice
    assert "more than one pair of bounds" in refused(
        CAR, [recording()], bounds={"K_F": (1e4, 3e4), SPRING: (1e4, 4e4)}
    )


def test_start_values_become_the_car():
    problem = Problem.build(CAR, [recording()], fixed=[BAR], start={BAR: 0.0, "K_F": 30000.0})
    assert problem.vehicle.value(BAR) == 0.0
    assert problem.free[0].start == 30000.0


def test_a_caller_s_noise_goes_before_the_run_s_and_that_before_the_default():
    run = recording(noise={"chassis.z": 2e-3, "chassis.roll": 1e-3})
    problem = Problem.build(CAR, [run], noise={"chassis.z": 3e-3})
    assert problem.runs[0].noise == {
        "chassis.z": 3e-3,
        "chassis.pitch": DEFAULT_NOISE["chassis.pitch"],
        "chassis.roll": 1e-3,
    }


def test_channels_compared_can_be_chosen_for_all_runs_or_by_run():
    runs = [recording("a"), recording("b", seed=1)]
    everywhere = Problem.build(CAR, runs, outputs=["chassis.roll", "chassis.z"])
    assert [list(seen.measured) for seen in everywhere.runs] == [["chassis.z", "chassis.roll"]] * 2
    by_run = Problem.build(CAR, runs, outputs={"b": ["chassis.pitch"]})
    assert [list(seen.measured) for seen in by_run.runs] == [
        list(OUTPUT_CHANNELS),
        ["chassis.pitch"],
    ]


def test_runs_may_lack_output_channels():
    problem = Problem.build(CAR, [recording("a", ["chassis.z"]), recording("b", seed=1)])
    assert list(problem.runs[0].measured) == ["chassis.z"]


def test_two_recordings_of_one_name_are_told_apart():
    problem = Problem.build(CAR, [recording(seed=0), recording(seed=1)])
    assert [seen.name for seen in problem.runs] == ["lap", "lap (2)"]


@pytest.mark.parametrize(
    ("named", "sentence"),
    [
        ({"free": []}, "No parameter is free"),
        ({"free": [SPRING], "fixed": [SPRING]}, "both as free and as fixed"),
        ({"fixed": PARAMETER_NAMES}, "No parameter is free"),
        ({"free": [SPRING, "K_F"]}, "listed twice"),
        ({"free": ["front.suspension.stifness"]}, "did you mean front.suspension.stiffness"),
        ({"bounds": {SPRING: (3e4, 1e4)}}, "crossed"),
        ({"bounds": {SPRING: (2e4, 2e4)}}, "leave no room"),
        ({"bounds": {SPRING: (3e4, 4e4)}}, "outside its bounds"),
        ({"free": ["rho_F"], "start": {"rho_F": 12}}, "12, outside its bounds 0.2 to 10; move"),
        ({"bounds": {SPRING: (1e4, math.inf)}}, "finite"),
        ({"bounds": {SPRING: (1.0, 1e5)}}, "A bound of front.suspension.stiffness"),
        ({"bounds": {PIVOT: (-2.0, 2.0)}}, "span zero"),
        ({"start": {SPRING: -5.0}}, "A start value cannot be used"),
        ({"start": {BAR: 0.0}}, "no default bounds follow"),
        ({"noise": {"chassis.z": 0.0}}, "is 0; it must lie between 1e-12 and 1e+12."),
        ({"noise": {"chassis.z": 1e-200}}, "is 1e-200; it must lie between 1e-12 and 1e+12."),
        ({"noise": {"wheel.fl.z": 1e-3}}, "compared channels"),
        ({"outputs": ["chassis.a_x"]}, "cannot be compared"),
        ({"outputs": []}, "choose at least one"),
        ({"outputs": {"another": ["chassis.z"]}}, "the runs are lap"),
        ({"traction": "none"}, 'can be "exact" or "paper"'),
    ],
)
def test_what_a_caller_can_mend_is_said_in_one_sentence(named, sentence):
    assert sentence in refused(CAR, [recording()], **named)


def test_runs_that_cannot_be_used_are_refused():
    assert "No run" in refused(CAR, [])
    assert "same recording" in refused(CAR, [recording(), replace(recording(), name="copy")])
    assert "none of chassis.z" in refused(CAR, [recording(outputs=[])])
    assert "has no chassis.roll" in refused(
        CAR, [recording(outputs=["chassis.z"])], outputs=["chassis.roll"]
    )
    gaps = recording()
    gaps["chassis.z"][7] = math.nan
    assert "gaps" in refused(CAR, [gaps])


def test_fewer_samples_than_parameters_are_refused():
    time = np.linspace(0.0, 0.5, 10)
    channels = dict.fromkeys([*INPUT_CHANNELS, "chassis.z"], np.zeros_like(time))
    assert "10 samples cannot determine 12" in refused(CAR, [Run("short", time, channels)])


def test_a_standing_car_is_refused_unless_its_noise_is_smaller():
    """Nothing moves beyond the noise, whether the channels are clean or not."""
    rng = np.random.default_rng(1)
    time = 0.005 * np.arange(1001)
    still = dict.fromkeys(INPUT_CHANNELS, np.zeros_like(time))
    for size in (0.0, 1.0):
        noise = {name: size * DEFAULT_NOISE[name] * rng.normal(size=1001) for name in DEFAULT_NOISE}
        run = Run("parked", time, {**still, **noise})
        for cutoff in (None, 20.0):
            settings = RimsSettings(output_cutoff_hz=cutoff)
            sentence = refused(CAR, [run], settings=settings)
            assert "run parked: chassis.z, chassis.pitch, chassis.roll stay" in sentence
    assert Problem.build(CAR, [run], noise={"chassis.z": 0.1 * DEFAULT_NOISE["chassis.z"]})


def test_a_standing_car_whose_logger_filters_is_refused():
    """The default noise through a logger's 30 Hz filter, which leaves it smooth at 200 Hz."""
    rng = np.random.default_rng(1)
    time = 0.005 * np.arange(2001)
    still = dict.fromkeys(INPUT_CHANNELS, np.zeros_like(time))
    white = rng.normal(size=(len(DEFAULT_NOISE), time.size))
    noise = {
        name: size * low_pass(time, row, 30.0)
        for (name, size), row in zip(DEFAULT_NOISE.items(), white, strict=True)
    }
    assert "Nothing can be learnt" in refused(CAR, [Run("parked", time, {**still, **noise})])


def test_small_motion_of_quiet_sensors_is_no_noise():
    """A tenth of the default noise, but as slow as only a body moves: no sensor is so slow."""
    time = 0.005 * np.arange(1001)
    still = dict.fromkeys(INPUT_CHANNELS, np.zeros_like(time))
    slow = 0.1 * DEFAULT_NOISE["chassis.z"] * np.sin(9.0 * time)
    assert Problem.build(CAR, [Run("smooth road", time, {**still, "chassis.z": slow})])
    stated = {"chassis.z": DEFAULT_NOISE["chassis.z"]}
    assert "stays within its noise" in refused(
        CAR, [Run("smooth road", time, {**still, "chassis.z": slow}, stated)]
    )


@pytest.mark.parametrize(
    ("parameter", "logarithmic"),
    [
        (FreeParameter(SPRING, 24000.0, 1200.0, 192000.0), True),
        (FreeParameter(PIVOT, -1.6, -10.0, -0.1), True),
        (FreeParameter(BAR, 500.0, 0.0, 1000.0), False),
        (FreeParameter("front.pivot.angle", 0.1, 0.01, 1.3), False),
    ],
)
def test_the_optimiser_s_variable_and_the_value_are_inverse(parameter, logarithmic):
    """Oracle: value(variable(p)) = p, and the slope by central differences."""
    assert parameter.logarithmic == logarithmic
    for value in np.linspace(parameter.lower, parameter.upper, 7):
        variable = parameter.variable(value) if value or not logarithmic else 0.0
        assert parameter.value(variable) == pytest.approx(value, rel=1e-12, abs=1e-300)
    middle = 0.5 * (parameter.lower + parameter.upper)
    x, step = parameter.variable(middle), 1e-5
    slope = (parameter.value(x + step) - parameter.value(x - step)) / (2 * step)
    assert parameter.slope(x) == pytest.approx(slope, rel=1e-8)
