"""Profiles of the stand-in, which is linear in the search's variables, and of valleys in it."""

import math
import threading

import numpy as np
import pytest
from ridetune.engine.errors import Cancelled, ParameterError, ProblemError
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.identification.loss import Loss
from ridetune.engine.identification.profile import profile
from ridetune.engine.parameters import PARAMETER_NAMES

from ... import stand_in
from ...factories import paper_vehicle

CAR = paper_vehicle()
SPRING, DAMPER = PARAMETER_NAMES[:2]
ANGLE = "front.pivot.angle"


def fitted(simulate=stand_in.simulate, runs=None, **named):
    """A fit, and the problem that starts at its solution."""
    runs = runs or [stand_in.recording(CAR, seed=4)]
    fit = identify(Problem.build(CAR, runs, **named), simulate=simulate)
    start = {one.name: one.value for one in fit.parameters}
    bounds = {one.name: (one.lower, one.upper) for one in fit.parameters}
    return fit, Problem.build(CAR, runs, **{**named, "start": start, "bounds": bounds})


def interval_of(fit, name):
    return next(one.confidence_interval for one in fit.parameters if one.name == name)


@pytest.mark.parametrize("name", [SPRING, ANGLE])
def test_where_the_model_is_linear_a_profile_is_the_fit_s_interval(name):
    """Oracle: a quadratic cost, so t is the change of the variable over its standard error. What
    the search leaves of the cost, 1e-8 of it, is 1e-5 of t^2 at the first point."""
    fit, problem = fitted()
    found = profile(problem, name, simulate=stand_in.simulate)
    one = next(each for each in fit.parameters if each.name == name)
    assert found.confidence_interval == pytest.approx(one.confidence_interval, rel=1e-3)
    free = one.free
    error = one.std_error / free.slope(free.variable(one.value))
    for point in found.points:
        away = (free.variable(point.value) - free.variable(one.value)) / error
        assert point.distance == pytest.approx(away, abs=1e-2)
    assert found.points[0].distance < -found.quantile < found.quantile < found.points[-1].distance
    assert not found.lower_at_bound
    assert not found.upper_at_bound


@pytest.mark.parametrize("loss", [Loss("cauchy", 1.0), Loss("arctan", 1.5), Loss("huber", 1.0)])
def test_a_profile_by_a_loss_is_as_wide_as_the_fit_s_interval(loss):
    """Oracle: the fit's interval, as the summed cost is a quadratic over so small steps. The fit
    takes the second derivative by a channel's mean w, the cost has that of each sample; their
    means over 1000 samples, half of them deep in the bend, differ by sqrt(0.5) / sqrt(1000) = 2 %,
    their roots by 1 %; twice that."""
    runs = [stand_in.recording(CAR, seed=4)]
    named = {"free": [SPRING, "rear.pivot.angle"], "loss": loss}
    fit, problem = fitted(runs=runs, **named)
    found = profile(problem, SPRING, simulate=stand_in.simulate)
    widths = [high - low for low, high in (found.confidence_interval, interval_of(fit, SPRING))]
    assert widths[0] == pytest.approx(widths[1], rel=0.02)


def test_the_others_follow_along_a_valley():
    """Oracle: only the product of stiffness and damping acts, so along the whole profile it stays
    and the cost with it; no end is found between the bounds."""

    def simulate(cars, inputs, traction):
        values = stand_in.values_of(cars)
        merged = {
            SPRING: values[SPRING] * values[DAMPER] / 1700.0,
            DAMPER: np.full(len(cars), 1700.0),
        }
        return stand_in.histories(values | merged, inputs)

    fit, problem = fitted(simulate, free=[SPRING, DAMPER], bounds={SPRING: (1e4, 6e4)})
    found = profile(problem, SPRING, simulate=simulate)
    product = fit.vehicle.value(SPRING) * fit.vehicle.value(DAMPER)
    for point in found.points:
        assert point.value * point.others[DAMPER] == pytest.approx(product, rel=1e-4)
        assert abs(point.distance) < 0.1
    assert found.confidence_interval == (-math.inf, math.inf)
    assert found.lower_at_bound == found.upper_at_bound == (SPRING,)
    assert [one[:24] for one in found.sentences] == [
        "The lower side ends at t",
        "The upper side ends at t",
    ]


def test_a_side_that_another_parameter_s_bound_ends_says_so():
    """Oracle: as above, only the product acts. The damper may fall to 0.8 of what it is, so the
    spring may rise by 1/0.8 before the cost does; the runs would have let it go on."""

    def simulate(cars, inputs, traction):
        values = stand_in.values_of(cars)
        merged = {
            SPRING: values[SPRING] * values[DAMPER] / 1700.0,
            DAMPER: np.full(len(cars), 1700.0),
        }
        return stand_in.histories(values | merged, inputs)

    least = 0.8 * CAR.value(DAMPER)
    fit, problem = fitted(
        simulate, free=[SPRING, DAMPER], bounds={SPRING: (1e4, 6e4), DAMPER: (least, 9e3)}
    )
    found = profile(problem, SPRING, simulate=simulate)
    product = fit.vehicle.value(SPRING) * fit.vehicle.value(DAMPER)
    assert found.upper_at_bound == (DAMPER,)
    assert found.confidence_interval[1] == pytest.approx(product / least, rel=0.01)
    assert found.lower_at_bound == (SPRING,)
    [_, upper] = found.sentences
    assert f"On the upper side {DAMPER} of {least:.4g} N s/m is at its bound" in upper


def test_a_profile_goes_on_to_where_a_parameter_ends_that_the_runs_hardly_hold():
    """Oracle: the stand-in, linear in the logarithm, on which the spring acts 4000 times less:
    the interval is the fit's, whose ends are a factor of more than e^4 from the value, where
    sixteen quarters of 100 % end, and nearer than the bounds."""

    def simulate(cars, inputs, traction):
        values = stand_in.values_of(cars)
        weakly = CAR.value(SPRING) * (values[SPRING] / CAR.value(SPRING)) ** 2.3e-4
        return stand_in.histories(values | {SPRING: weakly}, inputs)

    bounds = {SPRING: (100.0, 1e7)}
    runs = [stand_in.recording(CAR, seed=8)]
    fit, problem = fitted(simulate, runs, free=[SPRING], bounds=bounds)
    low, high = interval_of(fit, SPRING)
    value = fit.parameters[0].value
    assert bounds[SPRING][0] < low < math.exp(-4.0) * value
    assert math.exp(4.0) * value < high < bounds[SPRING][1]
    found = profile(problem, SPRING, simulate=simulate)
    assert np.log(found.confidence_interval) == pytest.approx(np.log([low, high]), abs=0.02)


def test_a_profile_of_what_the_runs_do_not_hold_at_all_goes_to_its_bounds():
    """Oracle: the bounds, factors of 240 and 420 away."""

    def simulate(cars, inputs, traction):
        values = stand_in.values_of(cars)
        hardly = CAR.value(SPRING) * (values[SPRING] / CAR.value(SPRING)) ** 1e-5
        return stand_in.histories(values | {SPRING: hardly}, inputs)

    bounds = {SPRING: (100.0, 1e7)}
    _, problem = fitted(simulate, free=[SPRING], bounds=bounds)
    found = profile(problem, SPRING, simulate=simulate)
    assert found.confidence_interval == (-math.inf, math.inf)
    assert found.lower_at_bound
    assert found.upper_at_bound


def test_a_bound_ends_a_profile_and_leaves_its_side_open():
    """Oracle: the bound lies one error above the fit, where t is 1."""
    fit, _ = fitted()
    one = fit.parameters[0]
    bound = one.value * math.exp(one.std_error / one.value)
    _, problem = fitted(bounds={SPRING: (1e4, bound)})
    found = profile(problem, SPRING, simulate=stand_in.simulate)
    assert found.points[-1].value == pytest.approx(bound)
    assert found.points[-1].distance == pytest.approx(1.0, abs=1e-2)
    assert found.confidence_interval[1] == math.inf
    assert found.confidence_interval[0] == pytest.approx(one.confidence_interval[0], rel=1e-3)
    assert found.upper_at_bound
    assert not found.lower_at_bound


def test_a_parameter_by_itself_has_a_profile():
    """Oracle: as above, with nothing else to fit."""
    fit, problem = fitted(free=[SPRING])
    found = profile(problem, "K_F", simulate=stand_in.simulate)
    [one] = fit.parameters
    assert found.confidence_interval == pytest.approx(one.confidence_interval, rel=1e-3)
    assert not any(point.others for point in found.points)


def test_points_are_told_of_and_a_profile_can_be_cancelled():
    _, problem = fitted()
    told = []
    stop = threading.Event()

    def progress(points):
        told.append(points)
        if len(told) == 3:
            stop.set()

    with pytest.raises(Cancelled):
        profile(
            problem, SPRING, progress=progress, cancelled=stop.is_set, simulate=stand_in.simulate
        )
    assert told == [1, 2, 3]


def test_only_a_free_parameter_has_a_profile():
    _, problem = fitted(free=[SPRING])
    with pytest.raises(ProblemError, match=r"front\.suspension\.damping was not free"):
        profile(problem, DAMPER)
    with pytest.raises(ParameterError, match="No parameter is called 'K_X'"):
        profile(problem, "K_X")
