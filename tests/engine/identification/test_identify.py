"""Identification on the stand-in model, where linear least squares is the oracle."""

import json
import threading

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.errors import Cancelled, ProblemError
from ridetune.engine.identification.fit import Outcome, determined
from ridetune.engine.identification.fit_file import fit_to_json, write_fit
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.identification.variables import FreeParameter
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.vehicle_file import read_vehicle

from ... import stand_in

CAR = stand_in.REFERENCE
ELSEWHERE = {name: 1.3 * CAR.value(name) for name in PARAMETER_NAMES}


def fit(
    runs, simulate=stand_in.simulate, *, start=ELSEWHERE, progress=None, cancelled=None, **named
):
    problem = Problem.build(CAR, runs, start=start, **named)
    return identify(problem, simulate=simulate, progress=progress, cancelled=cancelled)


def test_a_noise_free_twin_is_found_exactly():
    """Oracle: the truth. The stopping rule leaves a relative step of 1e-8."""
    found = fit([stand_in.recording(CAR, noise=0.0)])
    for one in found.parameters:
        assert one.value == pytest.approx(CAR.value(one.name), rel=1e-6)
    assert found.outcome == Outcome.DETERMINED
    assert found.converged
    assert found.vehicle.value("rear.pivot.angle") == found.parameters[-1].value
    assert not found.warnings


def test_estimates_and_errors_are_those_of_linear_least_squares():
    """Oracle: the normal equations in the variables in which the stand-in is linear, an angle or
    a logarithm, in which intervals are symmetric. The errors are those of a variance from
    3 N / m = 15 windows a channel at least, scattered by sqrt(2 / 45) = 21 %: half of it, twice."""
    run = stand_in.recording(CAR, seed=3)
    found = fit([run])
    problem = Problem.build(CAR, [run])
    noise = np.concatenate([np.full(1001, v) for v in problem.runs[0].noise.values()])
    columns = np.concatenate(list(stand_in.basis(run.time).transpose(1, 0, 2)))
    basis = columns[:, :-1] / noise[:, np.newaxis]
    measured = np.concatenate(list(problem.runs[0].measured.values()))
    solved, *_ = np.linalg.lstsq(basis, (measured - columns[:, -1]) / noise, rcond=None)
    assert_allclose(stand_in.weights_of(found.vehicle)[:-1], solved, rtol=0, atol=1e-6)
    errors = np.sqrt(np.diag(np.linalg.inv(basis.T @ basis)))
    for one, error in zip(found.parameters, errors, strict=True):
        slope = 0.1 if one.name.endswith("angle") else one.value
        assert one.std_error == pytest.approx(error * slope, rel=0.21)
        lower, upper = one.confidence_interval
        half_width = found.errors.quantile * one.std_error
        if one.name.endswith("angle"):
            assert (lower, upper) == pytest.approx((one.value - half_width, one.value + half_width))
        else:
            factor = np.exp(half_width / one.value)
            assert (lower, upper) == pytest.approx((one.value / factor, one.value * factor))


def test_cost_and_histories_agree_with_each_other():
    """Oracle: definitions. cost = half the sum of squares, fit percent from the residuals."""
    runs = [stand_in.recording(CAR, name="a"), stand_in.recording(CAR, name="b", seed=1)]
    found = fit(runs)
    squares = 0.0
    for run, fitted in zip(runs, found.runs, strict=True):
        for channel, noise in fitted.noise.items():
            error = found.residuals[run.name][channel]
            squares += np.sum((error / noise) ** 2)
            spread = np.linalg.norm(run[channel] - np.mean(run[channel]))
            percent = 100.0 * (1.0 - np.linalg.norm(error) / spread)
            assert found.fit_percent[run.name][channel] == pytest.approx(percent)
    assert found.cost == pytest.approx(0.5 * squares)
    assert found.cost_history[-1] == pytest.approx(found.cost)
    assert list(found.cost_history) == sorted(found.cost_history, reverse=True)
    assert found.evaluations == len(found.cost_history)


def test_progress_tells_of_every_evaluation():
    told = []
    found = fit([stand_in.recording(CAR)], progress=told.append)
    assert [state.evaluations for state in told] == list(range(1, found.evaluations + 1))
    assert [state.cost for state in told] == list(found.cost_history)
    assert told[-1].parameters == {one.name: one.value for one in found.parameters}
    assert told[-1].fit_percent["lap"].keys() == found.fit_percent["lap"].keys()
    assert told[-1].simulations <= found.simulations


def test_cancel_stops_the_fit():
    stop = threading.Event()
    told = []

    def progress(state):
        told.append(state)
        if state.evaluations == 2:
            stop.set()

    with pytest.raises(Cancelled, match="cancelled after"):
        fit([stand_in.recording(CAR)], progress=progress, cancelled=stop.is_set)
    assert len(told) == 2


def test_a_parameter_without_effect_is_undetermined_and_named():
    """Oracle: the first parameter never enters the model; the others are as if it were fixed."""

    def simulate(cars, inputs, traction):
        same = {PARAMETER_NAMES[0]: np.full(len(cars), 24000.0)}
        return stand_in.histories(stand_in.values_of(cars) | same, inputs)

    found = fit([stand_in.recording(CAR)], simulate)
    first, *others = found.parameters
    assert first.determined == "no"
    assert np.isinf(first.std_error)
    assert {one.determined for one in others} == {"yes"}
    assert found.outcome == Outcome.UNDETERMINED
    assert f"do not excite {first.name}" in " ".join(found.warnings)


def test_two_parameters_with_one_effect_are_named_together():
    """Oracle: stiffness and damping act through their product alone."""
    spring, damper = PARAMETER_NAMES[:2]

    def simulate(cars, inputs, traction):
        values = stand_in.values_of(cars)
        merged = {
            spring: values[spring] * values[damper] / 1700.0,
            damper: np.full(len(cars), 1700.0),
        }
        return stand_in.histories(values | merged, inputs)

    bounds = {spring: (240.0, 2.4e6), damper: (17.0, 1.7e5)}
    found = fit([stand_in.recording(CAR)], simulate, bounds=bounds)
    assert np.isinf(found.parameters[0].std_error)
    assert np.isinf(found.parameters[1].std_error)
    assert f"hardly tell {spring} from {damper}" in " ".join(found.warnings)
    product = found.parameters[0].value * found.parameters[1].value
    assert product == pytest.approx(24000.0 * 1700.0, rel=0.01)


def test_a_start_on_a_bound_does_not_hold_the_search():
    """Oracle: the truth, inside bounds one of which is the start."""
    name = PARAMETER_NAMES[0]
    low = 0.75 * CAR.value(name)
    run = stand_in.recording(CAR, noise=0.0)
    bounds = {name: (low, 2.0 * CAR.value(name))}
    found = fit([run], start={name: low}, free=[name], bounds=bounds)
    assert found.parameters[0].value == pytest.approx(CAR.value(name), rel=1e-6)


def test_a_parameter_at_its_bound_is_reported():
    """Oracle: the truth lies beyond the upper bound."""
    name = PARAMETER_NAMES[2]
    start = {**ELSEWHERE, name: 20000.0}
    found = fit([stand_in.recording(CAR)], start=start, bounds={name: (10000.0, 25000.0)})
    held = found.parameters[2]
    assert held.at_bound
    assert held.determined == "no"
    assert held.value == pytest.approx(25000.0, rel=1e-3)
    assert found.outcome == Outcome.AT_BOUND
    assert f"{name} is at its upper bound, 2.5e+04 N/m" in " ".join(found.warnings)


@pytest.mark.parametrize(("bounds", "start"), [((1e4, 2.5e4), 2e4), ((2.9e4, 9e4), 3e4)])
def test_the_interval_of_a_parameter_at_its_bound_is_open_beyond_it(bounds, start):
    """Oracle: the interval of the fit without the bound. The truth, 27000, lies beyond it, by more
    than an error; so the interval is all that lies beyond the bound. The stand-in is linear in the
    logarithm, in which the point beyond the bound is found at once."""
    name = PARAMETER_NAMES[2]
    run = stand_in.recording(CAR)
    free = fit([run]).parameters[2].confidence_interval
    held = fit([run], start={**ELSEWHERE, name: start}, bounds={name: bounds}).parameters[2]
    above = held.value < 27000.0
    inner, outer = held.confidence_interval if above else held.confidence_interval[::-1]
    assert outer == (np.inf if above else -np.inf)
    assert inner == pytest.approx(held.value)
    assert not free[0] < held.value < free[1]


def test_the_interval_of_a_parameter_near_its_bound_reaches_back_as_without_it():
    """Oracle: the fit without the bound, whose interval holds the bound, at half an error from the
    estimate. The other parameters answer to the bound; the errors' own scatter is 10 %."""
    name = PARAMETER_NAMES[2]
    run = stand_in.recording(CAR)
    free = fit([run]).parameters[2]
    bound = free.value - 0.5 * free.std_error
    held = fit([run], bounds={name: (1e4, bound)}, start={**ELSEWHERE, name: 2e4}).parameters[2]
    assert held.at_bound
    width = free.value - free.confidence_interval[0]
    assert held.confidence_interval[0] == pytest.approx(
        free.confidence_interval[0], abs=0.1 * width
    )
    assert held.confidence_interval[1] == np.inf


def test_a_bound_far_away_by_its_factor_leaves_a_parameter_as_it_is():
    """Oracle: the fit between bounds that are near. 100 is twenty times the lower bound, and less
    than a thousandth of the range away from it."""
    name = "rear.stabilizer_bar.damping"
    run = stand_in.recording(CAR, seed=4)
    near = fit([run], free=[name], start={}).parameters[0]
    wide = fit([run], free=[name], start={}, bounds={name: (5.0, 1e5)}).parameters[0]
    assert not wide.at_bound
    assert wide.determined == "yes"
    assert wide.confidence_interval == pytest.approx(near.confidence_interval, rel=1e-4)


def test_trials_that_fail_are_stepped_around():
    """Oracle: the truth, on the edge of a region of cars that fail."""
    name = PARAMETER_NAMES[0]

    def simulate(cars, inputs, traction):
        histories = stand_in.simulate(cars, inputs, traction)
        histories[stand_in.values_of(cars)[name] < 0.99 * CAR.value(name)] = np.nan
        return histories

    far = {**ELSEWHERE, name: 7.0 * CAR.value(name)}
    found = fit([stand_in.recording(CAR, noise=0.0)], simulate, start=far)
    assert found.converged
    assert found.parameters[0].value == pytest.approx(CAR.value(name), rel=1e-5)


def test_a_start_from_which_every_car_fails_is_refused_in_words():
    def simulate(cars, inputs, traction):
        return np.full((len(cars), len(inputs.time), 3), np.nan)

    with pytest.raises(ProblemError, match=r"fails at the start values.*wheel\..*of run lap"):
        fit([stand_in.recording(CAR)], simulate)


def test_a_start_that_fails_beside_cars_that_do_not_is_left_with_a_word():
    """Oracle: the truth, which the fit reaches from one of the cars scattered around the start."""
    name = PARAMETER_NAMES[0]

    def simulate(cars, inputs, traction):
        histories = stand_in.simulate(cars, inputs, traction)
        histories[stand_in.values_of(cars)[name] > 1.2 * CAR.value(name)] = np.nan
        return histories

    found = fit([stand_in.recording(CAR, noise=0.0)], simulate)
    assert "the fit began from others" in " ".join(found.warnings)
    assert found.parameters[0].value == pytest.approx(CAR.value(name), rel=1e-5)
    assert found.parameters[0].start == ELSEWHERE[name]


def test_a_fit_out_of_evaluations_says_so():
    problem = Problem.build(CAR, [stand_in.recording(CAR)], start=ELSEWHERE)
    found = identify(problem, simulate=stand_in.simulate, most_evaluations=1)
    assert found.outcome == Outcome.BUDGET_SPENT
    assert not found.converged


def test_a_fit_with_no_way_on_says_so():
    """Every car fails but those next to the start."""

    def simulate(cars, inputs, traction):
        histories = stand_in.simulate(cars, inputs, traction)
        first = stand_in.values_of(cars)[PARAMETER_NAMES[0]]
        histories[abs(first / 31200.0 - 1.0) > 1e-3] = np.nan
        return histories

    found = fit([stand_in.recording(CAR)], simulate)
    assert found.outcome == Outcome.STUCK
    assert not found.converged


@pytest.mark.parametrize(
    ("half_width", "at_bound", "verdict"),
    [
        (14.9, False, "yes"),
        (15.1, False, "weakly"),
        (49.9, False, "weakly"),
        (50.1, False, "no"),
        (1.0, True, "no"),
        (np.inf, False, "no"),
    ],
)
def test_determined_is_a_matter_of_the_half_width(half_width, at_bound, verdict):
    assert determined(100.0, half_width, at_bound) == verdict


def test_an_angle_that_is_0_is_determined_as_one_of_0_05_rad():
    """Oracle: the truth, 0, which lies within the interval; a half-width of a thousandth of a rad
    would be all of the value and more, and is 2 % of 0.05 rad."""
    level = CAR.with_values({"front.pivot.angle": 0.0})
    found = fit([stand_in.recording(level)], free=["front.pivot.angle"], start={})
    [one] = found.parameters
    low, high = one.confidence_interval
    assert low < 0.0 < high
    assert 0.5 * (high - low) > 0.5 * abs(one.value)
    assert one.determined == "yes"


@pytest.mark.parametrize(
    ("value", "size"), [(0.0, 0.05), (-0.02, 0.05), (0.05, 0.05), (-0.07, 0.07), (0.3, 0.3)]
)
def test_a_small_angle_is_judged_by_0_05_rad(value, size):
    assert FreeParameter("rear.pivot.angle", 0.1, -0.3, 1.3).size(value) == size
    assert FreeParameter("rear.pivot.distance", -1.0, -9.0, -0.1).size(-0.2) == 0.2


def test_intervals_hold_the_truth_as_often_as_they_say():
    """Oracle: 95 % of 12 x 15 intervals, less 4 binomial standard deviations of 1.6 %."""
    held = 0
    for seed in range(15):
        found = fit([stand_in.recording(CAR, seed=seed, samples=401)])
        for one in found.parameters:
            lower, upper = one.confidence_interval
            held += lower <= CAR.value(one.name) <= upper
    assert held / (15 * 12) > 0.95 - 0.065


def test_a_fit_file_is_strict_json_and_a_vehicle(tmp_path):
    """Oracle: the vehicle read back; JSON without NaN or Infinity; null for what is unknown."""

    def simulate(cars, inputs, traction):
        same = {PARAMETER_NAMES[0]: np.full(len(cars), 24000.0)}
        return stand_in.histories(stand_in.values_of(cars) | same, inputs)

    found = fit([stand_in.recording(CAR)], simulate)
    write_fit(found, tmp_path / "fit.json")

    def refuse(constant):
        raise AssertionError(constant)

    text = (tmp_path / "fit.json").read_text(encoding="utf-8")
    data = json.loads(text, parse_constant=refuse)
    assert data == json.loads(json.dumps(fit_to_json(found)))
    assert read_vehicle(tmp_path / "fit.json") == found.vehicle
    first, second = data["parameters"][:2]
    assert first["name"] == PARAMETER_NAMES[0]
    assert first["std_error"] is None
    assert first["confidence_interval"] == [None, None]
    assert second.keys() >= {
        *("name", "value", "unit", "std_error", "confidence_interval"),
        *("start", "lower", "upper", "determined"),
    }
    assert data["outcome"] == Outcome.UNDETERMINED.value
    assert data["correlation"][0][1] is None
    assert data["correlation"][1][1] == 1.0
    assert data["cost_history"][-1] == data["cost"]
    assert data["settings"]["a_x_cutoff_hz"] == 20.0
    assert data["fit_percent"]["lap"].keys() == found.fit_percent["lap"].keys()
