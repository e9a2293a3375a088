"""Many starts on a model of one parameter whose cost has several minima, known by a fine grid."""

import json
import threading
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ridetune.engine.channels import INPUT_CHANNELS
from ridetune.engine.errors import Cancelled, ProblemError
from ridetune.engine.identification.ended_search import EndedSearch
from ridetune.engine.identification.fit import Ending
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.identification.multistart import REFINED, spread
from ridetune.engine.identification.search import Found
from ridetune.engine.run import Run
from scipy.optimize import minimize_scalar

from ... import stand_in

CAR = stand_in.REFERENCE
SPRING = "front.suspension.stiffness"
TIME = 0.01 * np.arange(1001)
NOISE = 0.5e-3
WAVES = 0.01 * np.array([np.sin(2.0 * TIME), np.cos(3.0 * TIME)])


def height(u):
    """z of the car whose front spring is e^u times the reference's, (cars, samples)."""
    return np.transpose([np.cos(4.0 * u), 0.08 * u]) @ WAVES


def simulate(cars, inputs, traction):
    histories = np.zeros((len(cars), len(inputs.time), 3))
    histories[:, :, 0] = height(np.log(stand_in.values_of(cars)[SPRING] / CAR.value(SPRING)))
    return histories


def recording(seed=0):
    """The reference's, with noise."""
    rng = np.random.default_rng(seed)
    channels = dict.fromkeys(INPUT_CHANNELS, np.zeros_like(TIME))
    z = height(np.zeros(1))[0] + NOISE * rng.normal(size=TIME.size)
    return Run("lap", TIME, {**channels, "chassis.z": z})


def asked(start=1.0):
    return Problem.build(
        CAR,
        [recording()],
        [SPRING],
        start={SPRING: start * CAR.value(SPRING)},
        bounds={SPRING: (0.1 * CAR.value(SPRING), 8.0 * CAR.value(SPRING))},
    )


def minima_by_grid():
    """(u, cost) of every interior minimum, by a grid of a hundredth and a bounded search."""
    measured = recording()["chassis.z"]

    def cost(u):
        return 0.5 * np.sum(((height(np.array([u]))[0] - measured) / NOISE) ** 2)

    grid = np.arange(np.log(0.1), np.log(8.0), 0.01)
    costs = np.array([cost(u) for u in grid])
    lower = [k for k in range(1, len(grid) - 1) if costs[k] < min(costs[k - 1], costs[k + 1])]
    found = [
        minimize_scalar(cost, bounds=(grid[k - 1], grid[k + 1]), options={"xatol": 1e-9})
        for k in lower
    ]
    return sorted((one.fun, one.x) for one in found)


@pytest.mark.parametrize("start", [1.1, 4.5])
def test_every_minimum_is_found_and_the_lowest_is_the_fit(start):
    """Oracle: the grid. The search stops within 1e-3 of a standard error of u, 0.03 at most."""
    found = identify(asked(start), starts=32, simulate=simulate)
    known = minima_by_grid()
    assert len(known) == 3
    assert_allclose([one.cost for one in found.minima], [cost for cost, _ in known], rtol=1e-6)
    u = [np.log(one.parameters[SPRING] / CAR.value(SPRING)) for one in found.minima]
    assert_allclose(u, [u for _, u in known], atol=5e-5)
    assert found.parameters[0].value == found.minima[0].parameters[SPRING]
    assert found.cost == found.minima[0].cost
    assert sum(one.starts for one in found.minima) == REFINED
    assert all(one.outcome == Ending.CONVERGED for one in found.minima)
    assert found.starts == 32
    told = "From the start values alone the fit would have ended" in " ".join(found.warnings)
    assert told == (start == 4.5)
    nearest = np.argmin(abs(np.array(u) - np.log(start)))
    assert [one.from_start for one in found.minima].index(True) == nearest


def test_searches_cut_short_lie_in_the_basin_they_are_counted_in(monkeypatch):
    """Oracle: with nothing cut short, the same starts end in the same minima."""
    found = identify(asked(), starts=64, simulate=simulate)
    assert sum(one.cut_short for one in found.minima) > 0
    monkeypatch.setattr(Found, "holds", lambda *_: False)
    whole = identify(asked(), starts=64, simulate=simulate)
    for one, other in zip(found.minima, whole.minima, strict=True):
        assert (one.cut_short < one.starts, other.cut_short) == (True, 0)
        assert one.starts == other.starts


@pytest.mark.parametrize("before", [1, 3, REFINED])
def test_a_fit_that_was_broken_off_goes_on_to_the_same_fit(before):
    """Oracle: the undisturbed fit, bit for bit. What is kept goes through JSON; only the searches
    that are missing are made."""
    kept, made, told = {}, {}, []
    whole = identify(asked(4.5), starts=64, simulate=simulate, keep=kept.__setitem__)
    again = {k: EndedSearch.from_json(json.loads(json.dumps(kept[k].to_json()))) for k in kept}
    again = {k: one for k, one in again.items() if k < before}
    found = identify(
        asked(4.5),
        starts=64,
        simulate=simulate,
        ended=again,
        keep=made.__setitem__,
        progress=lambda now: told.append((now.search, now.evaluations, now.simulations)),
    )
    assert len(kept) == REFINED
    assert any(one.basin is not None for one in kept.values())
    assert made == {k: one for k, one in kept.items() if k >= before}
    for one, other in zip(found.minima, whole.minima, strict=True):
        assert one == other
    assert_array_equal(found.errors.covariance, whole.errors.covariance)
    for name in ("parameters", "cost_history", "evaluations", "simulations", "warnings"):
        assert getattr(found, name) == getattr(whole, name)
    assert told == sorted(told)


def test_minima_that_are_one_with_the_noise_that_is_found_are_told_as_one():
    """Oracle: the model. z alone has several minima, pitch, 0.02 u sin 3t, but one. With noise of
    20 um on z and 1 deg on pitch z weighs all; it has 2 mm, and pitch a thousandth of a degree."""

    def simulate(cars, inputs, traction):
        u = np.log(stand_in.values_of(cars)[SPRING] / CAR.value(SPRING))
        histories = np.zeros((len(cars), len(inputs.time), 3))
        histories[:, :, 0] = np.outer(np.cos(4.0 * u), WAVES[0])
        histories[:, :, 1] = np.outer(0.02 * u, np.sin(3.0 * TIME)) + 0.003 * np.sin(5.0 * TIME)
        return histories

    rng = np.random.default_rng(0)
    channels = dict.fromkeys(INPUT_CHANNELS, np.zeros_like(TIME)) | {
        "chassis.z": WAVES[0] + 2e-3 * rng.normal(size=TIME.size),
        "chassis.pitch": 0.003 * np.sin(5.0 * TIME) + 2e-5 * rng.normal(size=TIME.size),
    }
    wrong = {("lap", "chassis.z"): 2e-5, ("lap", "chassis.pitch"): 2e-2}
    found = []
    for quantities in ({}, {"noise": "fit"}):
        problem = Problem.build(
            CAR,
            [Run("lap", TIME, channels)],
            [SPRING],
            bounds={SPRING: (0.1 * CAR.value(SPRING), 8.0 * CAR.value(SPRING))},
            sensors=dict.fromkeys(("chassis.z", "chassis.pitch"), quantities),
        )
        found.append(identify(problem.with_noise(wrong), starts=64, simulate=simulate))
    stated, fitted = found
    assert len(stated.minima) > 1
    assert [one.starts for one in fitted.minima] == [REFINED]
    assert fitted.minima[0].from_start
    assert not any("inimum" in sentence or "alone" in sentence for sentence in fitted.warnings)


def test_a_single_start_has_a_single_minimum():
    found = identify(asked(4.5), simulate=simulate)
    only = found.minima[0]
    assert (len(found.minima), only.starts, only.from_start) == (1, 1, True)
    assert only.cost == found.cost
    assert found.parameters[0].value > 2.0 * CAR.value(SPRING)


def test_another_minimum_that_fits_as_well_is_told():
    """Oracle: 2 cos(4 u + pi/3) is 1 at u = 0, at -pi/6, and a quarter turn from either."""

    def alike(cars, inputs, traction):
        u = np.log(stand_in.values_of(cars)[SPRING] / CAR.value(SPRING))
        histories = np.zeros((len(cars), len(inputs.time), 3))
        histories[:, :, 0] = 2.0 * np.cos(4.0 * u + np.pi / 3.0)[:, np.newaxis] * WAVES[0]
        return histories

    found = identify(asked(1.1), starts=64, simulate=alike)
    assert len(found.minima) > 1
    assert "Another minimum fits nearly as well" in " ".join(found.warnings)


def test_starts_repeat_with_their_seed_and_fill_the_box():
    """Oracle: each half of every side of the box holds half of 2^k Sobol points."""
    lower, upper = np.array([-1.0, 2.0]), np.array([1.0, 6.0])
    points = np.array(spread(lower, upper, 64, seed=3))
    assert_allclose(points, spread(lower, upper, 64, seed=3))
    assert not np.allclose(points, spread(lower, upper, 64, seed=4))
    assert_allclose(points[:10], spread(lower, upper, 10, seed=3))
    assert list(np.sum(points > 0.5 * (lower + upper), axis=0)) == [32, 32]


def test_progress_counts_the_searches_and_its_cost_never_rises():
    told = []
    found = identify(asked(), starts=64, simulate=simulate, progress=told.append)
    screening = told.pop(0)
    assert (screening.stage, screening.search, screening.searches) == ("screening", 0, REFINED)
    assert screening.cost >= told[0].cost
    assert {one.stage for one in told} == {"searching"}
    assert [one.search for one in told] == sorted(one.search for one in told)
    assert {one.searches for one in told} == {REFINED}
    assert told[-1].search == REFINED
    assert [one.cost for one in told] == list(found.cost_history)
    assert list(found.cost_history) == sorted(found.cost_history, reverse=True)


def test_cancel_stops_between_searches_too():
    stop = threading.Event()

    def progress(state):
        if state.search == 3:
            stop.set()

    with pytest.raises(Cancelled, match="cancelled after"):
        identify(asked(), starts=64, simulate=simulate, progress=progress, cancelled=stop.is_set)


@pytest.mark.parametrize("starts", [0, 1025])
def test_a_number_of_starts_out_of_range_is_refused(starts):
    with pytest.raises(ProblemError, match=f"starts is {starts}; give a number from 1 to 1024"):
        identify(asked(), starts=starts, simulate=simulate)


def test_a_channel_that_is_probably_wrong_is_searched_once():
    """Other starts would mean nothing: the fit to a turned channel bends the car."""
    turned = recording()
    turned = replace(turned, channels={**turned.channels, "chassis.z": -turned["chassis.z"]})
    problem = Problem.build(CAR, [turned], [SPRING])
    found = identify(problem, starts=64, simulate=simulate)
    assert (found.starts, len(found.minima)) == (1, 1)
