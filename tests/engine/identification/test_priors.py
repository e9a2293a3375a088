"""Priors on the stand-in, where the combination of Gaussians is known in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.errors import ParameterError, ProblemError
from ridetune.engine.identification.fit import Outcome
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.identification.residuals import Residuals

from ... import stand_in

CAR = stand_in.REFERENCE
SPRING, PIVOT, ANGLE = "front.suspension.stiffness", "rear.pivot.distance", "rear.pivot.angle"
FREE = [SPRING, PIVOT, ANGLE]
RUN = stand_in.recording(CAR, seed=3)
DATA = identify(Problem.build(CAR, [RUN], FREE), simulate=stand_in.simulate)
DATA_ERROR = DATA.parameters


def fit(priors):
    problem = Problem.build(CAR, [RUN], FREE, priors=priors)
    return problem, identify(problem, simulate=stand_in.simulate)


def without(problem):
    """x and its covariance by the runs alone: the normal equations, exact on the stand-in."""
    residuals = Residuals(problem, stand_in.simulate)
    x = np.array([one.variable(one.start) for one in problem.free])
    slopes = residuals.jacobian(x)
    normal = slopes.T @ slopes
    return x - np.linalg.solve(normal, slopes.T @ residuals.vector(x)), np.linalg.inv(normal)


def test_runs_and_priors_combine_as_gaussians():
    """Oracle: precisions add, and means weighted by them; a prior in the logarithm has the
    deviation over the mean. The combination has the errors of both, by their shares; the runs'
    are as in a fit to them alone, as the priors move residuals by a tenth of a standard error."""
    relative = DATA_ERROR[1].std_error / DATA_ERROR[1].value
    mean = (1.0 + 0.2 * relative) * DATA_ERROR[1].value
    deviation = 0.7 * relative * mean
    angle = (DATA_ERROR[2].value + 0.3 * DATA_ERROR[2].std_error, 1.5 * DATA_ERROR[2].std_error)
    problem, found = fit({"d_R": (mean, deviation), ANGLE: angle})
    x, covariance = without(problem)
    places = [problem.free[k].name for k in range(3)]
    known = np.zeros(3)
    precision = np.zeros((3, 3))
    for name, at, spread in (
        (PIVOT, np.log(mean / problem.free[1].scale), deviation / mean),
        (ANGLE, angle[0] / problem.free[2].scale, angle[1] / problem.free[2].scale),
    ):
        k = places.index(name)
        known[k], precision[k, k] = at, spread**-2
    both = np.linalg.inv(covariance) + precision
    combined = np.linalg.solve(both, np.linalg.solve(covariance, x) + precision @ known)
    assert_allclose([one.value for one in found.parameters], problem.values(combined), rtol=1e-7)
    share = np.linalg.solve(both, np.linalg.inv(covariance))
    of_prior = np.linalg.solve(both, np.linalg.solve(both, precision).T)
    expected = share @ DATA.errors.covariance @ share.T + of_prior
    assert_allclose(found.errors.covariance, expected, rtol=0.03)


def test_what_the_runs_say_without_a_prior_is_the_fit_without_it():
    """Oracle: the normal equations without it. Combined errors as in the test above."""
    deviation = 2.0 * DATA_ERROR[1].std_error
    mean = CAR.value(PIVOT) + 5.0 * deviation
    problem, found = fit({PIVOT: (mean, deviation)})
    x, _ = without(problem)
    check = found.priors[0]
    assert check.without == pytest.approx(problem.values(x)[1], rel=1e-7)
    assert check.without_std_error == pytest.approx(DATA_ERROR[1].std_error, rel=0.05)
    apart = np.log(check.without / mean) / np.hypot(
        check.without_std_error / found.parameters[1].value, deviation / mean
    )
    assert check.apart == pytest.approx(apart, rel=0.01)
    told = " ".join(found.warnings)
    assert f"The runs alone put {PIVOT} at" in told
    assert "standard errors from its prior" in told


def test_what_the_runs_say_without_a_prior_is_not_held_by_a_bound():
    """Oracle: the normal equations without it, in which the bound, below the truth, plays no
    part."""
    priors = {SPRING: (19500.0, 200.0)}
    named = {"start": {SPRING: 19000.0}, "bounds": {SPRING: (5000.0, 20000.0)}}
    problem = Problem.build(CAR, [RUN], [SPRING, PIVOT], priors=priors, **named)
    found = identify(problem, simulate=stand_in.simulate)
    x, _ = without(problem)
    check = found.priors[0]
    assert found.parameters[0].at_bound
    assert check.without == pytest.approx(problem.free[0].scale * np.exp(x[0]), rel=1e-6)
    assert check.without == pytest.approx(CAR.value(SPRING), rel=0.01)
    assert "The runs alone put front.suspension.stiffness at" in " ".join(found.warnings)


def test_a_prior_that_agrees_is_not_told_of():
    _, found = fit({PIVOT: (CAR.value(PIVOT), 0.05)})
    assert abs(found.priors[0].apart) < 3.0
    assert not found.warnings


def test_a_prior_determines_what_the_runs_do_not():
    """Oracle: the prior itself, for a parameter that never enters the model."""

    def simulate(cars, inputs, traction):
        same = {SPRING: np.full(len(cars), 24000.0)}
        return stand_in.histories(stand_in.values_of(cars) | same, inputs)

    problem = Problem.build(CAR, [RUN], FREE, priors={SPRING: (25000.0, 500.0)})
    found = identify(problem, simulate=simulate)
    assert found.parameters[0].value == pytest.approx(25000.0, rel=1e-6)
    assert found.parameters[0].std_error == pytest.approx(500.0, rel=0.01)
    assert found.parameters[0].determined == "yes"
    assert found.priors[0].without is None
    assert found.converged


def test_a_prior_far_from_the_start_is_no_reason_to_leave_it():
    """Oracle: the fit without the prior, whose start carries the car; the prior is right."""
    start = {SPRING: 0.7 * CAR.value(SPRING)}
    told = [
        identify(
            Problem.build(CAR, [RUN], FREE, start=start, priors=priors), simulate=stand_in.simulate
        )
        for priors in ({}, {SPRING: (CAR.value(SPRING), 3.0)})
    ]
    assert told[0].warnings == told[1].warnings == ()
    assert told[1].parameters[0].value == pytest.approx(CAR.value(SPRING), abs=10.0)


@pytest.mark.parametrize(("weight", "astray"), [(1.0, False), (1000.0, True)])
def test_a_fit_is_astray_by_its_runs_not_by_its_priors(weight, astray):
    """Oracle: the runs' cost, quadratic in ln K, against that of their means. A prior at 5 K that
    weighs as much as the runs leaves ln K half way, where each has a quarter of what the runs have
    at 5 K: above what their means have, together, and below it, each. One that weighs much more
    carries the car away, and the sentence names it."""
    problem = Problem.build(CAR, [RUN], [SPRING])
    residuals = Residuals(problem, stand_in.simulate)
    x = np.array([problem.free[0].variable(CAR.value(SPRING))])
    at_five = float(residuals.costs([x + np.log(5.0)])[0])
    assert 0.25 * at_five < residuals.scatter() < 0.5 * at_five < at_five
    deviation = 5.0 * CAR.value(SPRING) * np.log(5.0) / np.sqrt(2.0 * weight * at_five)
    priors = {SPRING: (5.0 * CAR.value(SPRING), deviation)}
    found = identify(Problem.build(CAR, [RUN], [SPRING], priors=priors), simulate=stand_in.simulate)
    assert (found.outcome == Outcome.ASTRAY) == astray
    assert "any priors" in Outcome.ASTRAY
    assert not any("start values do not carry" in sentence for sentence in found.warnings)
    assert any("The runs alone put" in sentence for sentence in found.warnings)
    if not astray:
        middle = np.sqrt(5.0) * CAR.value(SPRING)
        assert found.parameters[0].value == pytest.approx(middle, rel=0.01)


@pytest.mark.parametrize(
    ("priors", "sentence"),
    [
        ({"K_R": (3e4, 1e3)}, "rear.suspension.stiffness, which is not free"),
        ({SPRING: (24000.0, 0.0)}, "standard deviation of 0 N/m; it must be positive"),
        ({SPRING: (24000.0, -1.0)}, "it must be positive"),
        ({SPRING: (24000.0, float("nan"))}, "it must be positive"),
        ({SPRING: (float("nan"), 10.0)}, "outside its bounds"),
        ({PIVOT: (-1.1, 0.05)}, "outside its bounds 0.1 to 10 m"),
        ({SPRING: (24000.0, 13000.0)}, "more than half its mean"),
        ({SPRING: (24000.0, 10.0), "K_F": (24000.0, 10.0)}, "more than one prior"),
    ],
)
def test_what_is_no_prior_is_refused(priors, sentence):
    with pytest.raises(ProblemError, match=sentence):
        fit(priors)


def test_a_misspelt_name_is_refused_with_the_nearest():
    with pytest.raises(ParameterError, match="did you mean rear.pivot.distance"):
        fit({"rear.pivot.distanc": (1.1, 0.05)})
