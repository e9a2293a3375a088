"""Losses against scipy's own, on whole residuals and through the condensed search."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.errors import ProblemError
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.identification.loss import Loss
from ridetune.engine.identification.residuals import Residuals
from ridetune.engine.identification.search_settings import LossName
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.run_notes import DEFAULT_NOISE
from scipy.optimize import least_squares

from ... import stand_in

CAR = stand_in.REFERENCE
LOSSES = get_args(LossName)
FREE = ["front.suspension.stiffness", "rear.suspension.damping", "rear.pivot.angle"]
START = {name: 1.2 * CAR.value(name) for name in FREE}


def spiked(share=0.01, size=20.0, samples=1001):
    """The reference's recording with spikes on z, where the front spring moves it to."""
    run = stand_in.recording(CAR, seed=5, samples=samples)
    rng = np.random.default_rng(1)
    hit = rng.choice(run.time.size, int(share * run.time.size), replace=False)
    z = run["chassis.z"].copy()
    side = np.sign(stand_in.basis(run.time)[hit, 0, 0])
    z[hit] += size * DEFAULT_NOISE["chassis.z"] * side
    return replace(run, channels={**run.channels, "chassis.z": z})


@pytest.mark.parametrize("name", LOSSES)
def test_costs_are_scipys(name):
    """Oracle: the cost that least_squares reports of the same residuals."""
    r = np.random.default_rng(0).normal(size=200) * 10.0 ** np.linspace(-2, 3, 200)
    scipys = least_squares(lambda x: r + 0.0 * x[0], [0.0], loss=name, f_scale=2.5, max_nfev=1)
    assert Loss(name, 2.5).costs(r) == pytest.approx(scipys.cost, rel=1e-12)


@pytest.mark.parametrize("name", LOSSES)
def test_scores_are_the_costs_derivatives(name):
    """Oracle: central differences; of second order, so 1e-6 with a step of 1e-3 off the kink."""
    r, step = np.array([-9.0, -2.4, -0.3, 0.0, 1.1, 2.6, 40.0]), 1e-3
    loss = Loss(name, 2.5)
    psi, w = loss.scores(r)
    cost = [np.array([float(loss.costs(np.array([one]))) for one in r + h]) for h in (-step, step)]
    assert_allclose(psi, (cost[1] - cost[0]) / (2.0 * step), atol=2e-6)
    sides = [loss.scores(r + h)[0] for h in (-step, step)]
    assert_allclose(w, (sides[1] - sides[0]) / (2.0 * step), atol=2e-6)


@pytest.mark.parametrize("name", LOSSES)
def test_the_fit_is_scipys_on_the_uncondensed_residuals(name):
    """Oracle: least_squares with its own loss on every sample. Both stop at relative steps of 1e-8,
    near which they converge quadratically, as the stand-in is linear."""
    problem = Problem.build(CAR, [spiked()], FREE, start=START, loss=Loss(name, 2.0))
    found = identify(problem, simulate=stand_in.simulate)
    residuals = Residuals(problem, stand_in.simulate)
    start = np.array([one.variable(one.start) for one in problem.free])
    scipys = least_squares(
        residuals.vector,
        start,
        residuals.jacobian,
        bounds=(residuals.lower, residuals.upper),
        loss=name,
        f_scale=2.0,
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
    )
    assert_allclose([one.value for one in found.parameters], problem.values(scipys.x), rtol=1e-7)
    assert found.cost == pytest.approx(scipys.cost, rel=1e-9)


@pytest.mark.parametrize("name", ["soft_l1", "huber", "cauchy", "arctan"])
def test_spikes_leave_a_robust_fit_within_its_error_bars(name):
    """Oracle: the truth. A hundredth of the samples, 20 noises off towards one parameter, pulls
    the linear fit by about 0.2 sqrt(N) = 12 standard errors."""
    run, spring = spiked(samples=4001), FREE[0]
    robust, linear = (
        identify(
            Problem.build(CAR, [run], FREE, start=START, loss=loss), simulate=stand_in.simulate
        )
        for loss in (Loss(name), Loss())
    )
    holds = [
        one.confidence_interval[0] <= CAR.value(one.name) <= one.confidence_interval[1]
        for one in robust.parameters
    ]
    assert all(holds)
    lower, upper = linear.parameters[0].confidence_interval
    assert not lower <= CAR.value(spring) <= upper
    assert robust.parameters[0].std_error < linear.parameters[0].std_error
    assert robust.runs[0].discounted["chassis.z"] >= 40
    assert linear.runs[0].discounted == {}
    told = [warning for warning in robust.warnings if "counts them for less" in warning]
    assert len(told) == 1
    assert "samples of chassis.z of run lap lie beyond 3 noises" in told[0]


@pytest.mark.parametrize(
    ("name", "rises"),
    [
        ("huber", (0.0002, 0.018)),
        ("soft_l1", (0.004, 0.020)),
        ("cauchy", (0.014, 0.072)),
        ("arctan", (0.013, 0.16)),
    ],
)
def test_clean_noise_costs_a_loss_as_much_precision_as_is_told(name, rises):
    """Oracle: the variance of an M-estimator, E psi^2 / (E psi')^2 (Huber 1981, 3.2), with psi'
    by Stein's lemma E psi' = E[r psi] / s^2, over normal noise of s = 1 and 2; to two digits."""
    r = np.linspace(-24.0, 24.0, 48001)
    psi, _ = Loss(name, 3.0).scores(r)
    for s, rise in zip((1.0, 2.0), rises, strict=True):
        density = np.exp(-0.5 * (r / s) ** 2) / (s * np.sqrt(2.0 * np.pi)) * (r[1] - r[0])
        slope = np.sum(r * psi * density) / s**2
        found = np.sqrt(np.sum(psi**2 * density)) / slope / s - 1.0
        assert found == pytest.approx(rise, rel=0.04)


def test_errors_of_a_robust_fit_to_clean_noise_are_those_of_least_squares():
    """Oracle: Huber's efficiency at 3 standard deviations, 0.9998 (Huber 1981, exhibit 4.3)."""
    run = stand_in.recording(CAR, seed=3)
    huber, linear = (
        identify(
            Problem.build(CAR, [run], PARAMETER_NAMES, start=START, loss=loss),
            simulate=stand_in.simulate,
        )
        for loss in (Loss("huber"), Loss())
    )
    for one, other in zip(huber.parameters, linear.parameters, strict=True):
        assert one.std_error == pytest.approx(other.std_error, rel=0.02)


def test_errors_of_a_robust_fit_hold_under_heavy_tails():
    """Oracle: the scatter of 60 fits to Student's t noise of 3 degrees of freedom; its relative
    error is 1/sqrt(2 * 60), at three of which 27 %."""
    values, errors = [], []
    for seed in range(60):
        run = stand_in.recording(CAR, noise=0.0)
        rng = np.random.default_rng(seed)
        channels = {
            name: history + DEFAULT_NOISE.get(name, 0.0) * rng.standard_t(3, size=history.size)
            for name, history in run.channels.items()
        }
        problem = Problem.build(
            CAR, [replace(run, channels=channels)], FREE[:1], loss=Loss("huber", 1.5)
        )
        one = identify(problem, simulate=stand_in.simulate).parameters[0]
        values.append(one.value)
        errors.append(one.std_error)
    assert np.mean(errors) == pytest.approx(np.std(values), rel=0.27)


def test_a_misfit_is_no_outlier():
    """Half of z is off by ten noises: the loss says that it is not for that."""
    found = identify(
        Problem.build(CAR, [spiked(share=0.5, size=10.0)], FREE, start=START, loss=Loss("huber")),
        simulate=stand_in.simulate,
    )
    assert "too many for outliers" in " ".join(found.warnings)


@pytest.mark.parametrize(
    ("loss", "sentence"),
    [
        ({"name": "hubert"}, 'loss is "hubert"; it can be linear, soft_l1, huber'),
        ({"scale": 0.0}, r"loss_scale is 0\.0; give 0\.01 to 1e\+06 noises"),
        ({"scale": float("nan")}, "loss_scale is nan"),
    ],
)
def test_what_is_no_loss_is_refused(loss, sentence):
    with pytest.raises(ProblemError, match=sentence):
        Loss(**loss)
