from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.campaign import Campaign, chosen, drive_table_2
from ridetune.engine.channels import INPUT_CHANNELS
from ridetune.engine.errors import ProblemError
from ridetune.engine.identification.advice_file import advisory_to_json
from ridetune.engine.identification.advisor import advise, advise_unmeasured
from ridetune.engine.identification.candidates import catalogue
from ridetune.engine.identification.expected_noise import INPUT_NOISE
from ridetune.engine.identification.identify import identify
from ridetune.engine.identification.problem import Problem
from ridetune.engine.identification.residuals import Residuals
from ridetune.engine.manoeuvre import (
    Manoeuvre,
    manoeuvre_from_json,
    manoeuvre_to_json,
    reference_manoeuvres,
)
from ridetune.engine.parameters import PARAMETERS
from ridetune.engine.plant import ConceptPlant
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.sensor_file import noisy
from ridetune.engine.simulation.simulate import rims_batch
from ridetune.engine.torque_laws import DriveTable
from ridetune.engine.vehicle_file import reference_vehicles

CAR = reference_vehicles()["paper"]
QUIET_INPUTS = dict.fromkeys(INPUT_CHANNELS, 0.0)
NOISE = {**DEFAULT_NOISE, **INPUT_NOISE}
SYMBOLS = [row.symbol for row in PARAMETERS]


def in_percent(parameters):
    return {symbol: 100.0 * one.relative for symbol, one in zip(SYMBOLS, parameters, strict=True)}


def relative_errors(fit):
    return np.array([one.std_error / abs(one.value) for one in fit.parameters])


def braked_at_the_end():
    """Manoeuvre 2, then two seconds of braking at 0.4 g."""
    data = manoeuvre_to_json(reference_manoeuvres()["2"]) | {"duration": 22}
    data["brake"] = {"kind": "deceleration", "level": 3.924, "start": 20, "front_share": 0.65}
    return manoeuvre_from_json(data)


@pytest.fixture(scope="module")
def quiet_inputs():
    """Advice before any run, with noise on the outputs alone, were Table 2 driven."""
    candidates = {**chosen(("1", "2")), "2-braked": braked_at_the_end()}
    return advise_unmeasured(CAR, candidates, planned=("1", "2"), noise=QUIET_INPUTS)


def test_what_the_campaign_of_the_paper_determines(quiet_inputs):
    """Oracle: Cramer-Rao bounds, two independent calculations with 0.5 mm and 0.02 degrees of
    noise. Their random roads were others than ours; errors of bars and pivots go with the few
    seconds in which both wheels of an axle differ, so a factor 1.6 either way."""
    found = in_percent(quiet_inputs.now)
    assert all(found[symbol] < 0.5 for symbol in ("K_F", "C_F", "K_R", "C_R"))
    bounds = {
        "Ktor_F": (20, 26),
        "d_F": (10, 13),
        "phi_F": (14, 15),
        "Ktor_R": (10, 11),
        "d_R": (5, 5),
        "phi_R": (5, 9),
    }
    for symbol, (low, high) in bounds.items():
        assert low / 1.6 < found[symbol] < high * 1.6, symbol


def test_two_seconds_of_braking_determine_the_front_pivot(quiet_inputs):
    """Oracle: the same, with 0.4 g of braking after manoeuvre 2; within a factor 2, as that is how
    far the bars' errors are from ours before braking and after."""
    [advice] = quiet_inputs.ranked
    found = in_percent(advice.after)
    bounds = {
        "Ktor_F": (9, 9),
        "d_F": (4.5, 4.5),
        "phi_F": (0.7, 0.9),
        "d_R": (0.4, 0.6),
        "phi_R": (0.5, 1.4),
    }
    for symbol, (low, high) in bounds.items():
        assert low / 2.0 < found[symbol] < high * 2.0, symbol
    assert advice.promoted > 0
    assert "phi_F from" in advice.sentence


def test_white_noise_of_the_outputs_gives_the_cramer_rao_bound(quiet_inputs):
    """Oracle: (J^T J)^-1 with the Jacobian of a fit's own residuals on noise-free recordings;
    differences of first order are within 1e-3 of it, the square root halves that."""
    problem = Problem.build(CAR, drive_table_2(CAR))
    x = np.array([one.variable(one.start) for one in problem.free])
    jacobian = Residuals(problem, rims_batch).jacobian(x)
    errors = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    slopes = np.array([abs(one.slope(v)) for one, v in zip(problem.free, x, strict=True)])
    found = np.array([one.std_error for one in quiet_inputs.now])
    assert_allclose(found, errors * slopes, rtol=2e-3)


@pytest.fixture(scope="module")
def campaign():
    """Table 2 and all braking with noise on outputs, wheels and a_x: recordings by key."""
    braking = {key: one for key, one in catalogue().items() if key.startswith("brake")}
    plan = Campaign.plan(
        ConceptPlant(CAR), noisy(NOISE, "noise"), {**chosen(("1", "2")), **braking}, seed=0
    )
    recordings = (plan.record(name, lambda _: None, lambda: False) for name in plan.manoeuvres)
    return {one.name.removeprefix("manoeuvre_"): one.run for one in recordings}


@pytest.fixture(scope="module")
def fitted(campaign):
    return identify(Problem.build(CAR, [campaign["1"], campaign["2"]]))


@pytest.fixture(scope="module")
def after_table_2(campaign, fitted):
    left_out = ("heave-20s", "pitch-20s", "roll-20s")
    some = {key: one for key, one in catalogue().items() if key not in left_out}
    return advise(Problem.build(fitted.vehicle, [campaign["1"], campaign["2"]]), some)


def test_after_table_2_braking_comes_first(after_table_2):
    """Oracle: the facts above: nothing else tells the front pivot."""
    assert after_table_2.ranked[0].key.startswith("brake")
    assert after_table_2.together[0] is after_table_2.ranked[0]
    gains = [one.gain for one in after_table_2.together]
    assert gains == sorted(gains)
    assert not after_table_2.excluded


def test_errors_so_far_are_those_of_the_fit(after_table_2, fitted):
    """Oracle: the fit; both take the same residuals, but the derivatives at the last but one of
    its steps."""
    found = [one.std_error for one in after_table_2.now]
    assert_allclose(found, [one.std_error for one in fitted.parameters], rtol=0.01)


def test_a_fit_with_the_advised_run_has_the_errors_that_were_promised(campaign, after_table_2):
    """Oracle: the fit, error over value, of an angle the error itself. The promise is made at
    values that are off by their errors before, some 10 % for bar and pivot in front, and both
    spectra are known to some 10 %."""
    best = after_table_2.ranked[0]
    fit = identify(Problem.build(CAR, [campaign[key] for key in ("1", "2", best.key)]))
    ratio = np.array(
        [
            one.std_error / abs(one.value if one.free.logarithmic else promised.value)
            for one, promised in zip(fit.parameters, best.after, strict=True)
        ]
    ) / [one.relative for one in best.after]
    assert np.all((ratio > 1 / 1.3) & (ratio < 1.3)), dict(zip(SYMBOLS, ratio, strict=True))


def test_stated_noise_of_the_inputs_foretells_the_errors_of_a_fit(fitted):
    """Oracle: a fit to runs with the same noise, whose values are off by a tenth and whose spectra
    are known to some 10 %: errors over value within a factor 1.35."""
    promised = advise_unmeasured(CAR, chosen(("1", "2")), planned=("1", "2"))
    ratio = relative_errors(fitted) / [one.relative for one in promised.now]
    assert np.all((ratio > 1 / 1.35) & (ratio < 1.35)), dict(zip(SYMBOLS, ratio, strict=True))


def test_without_runs_nothing_is_known_and_a_rig_tells_no_bars(quiet_inputs):
    """Heave moves both wheels of an axle alike, so no bar turns."""
    found = advise_unmeasured(CAR, chosen(("heave",)), noise=QUIET_INPUTS)
    assert all(np.isinf(one.std_error) and one.determined == "no" for one in found.now)
    [heave] = found.ranked
    after = in_percent(heave.after)
    assert after["K_F"] < 10.0
    assert np.isinf([after[symbol] for symbol in ("Ktor_F", "Ctor_F", "Ktor_R", "Ctor_R")]).all()
    assert np.isinf(heave.worst)
    assert advisory_to_json(found)["now"]["parameters"][0]["std_error"] is None


def test_a_car_without_brakes_is_told_what_to_add():
    found = advise_unmeasured(replace(CAR, brakes=None), chosen(("brake-54",)))
    assert "front share of 0.65" in found.ranked[0].remark
    assert '"brakes"' in found.ranked[0].remark


def test_a_road_that_lifts_the_tyres_comes_last_however_much_it_would_tell():
    """Where the model pulls on the road, a car would fly: what it would record is not known."""
    rough = {key: catalogue()[f"constant-speed-{key}"] for key in "ad"}
    smooth, lifted = advise_unmeasured(CAR, rough).ranked
    assert (smooth.key, lifted.key) == ("a", "d")
    assert lifted.gain > smooth.gain
    assert "a tyre would carry nothing" in lifted.remark.lower()
    assert not smooth.remark


def test_a_manoeuvre_that_the_car_does_not_survive_is_left_out_with_a_reason():
    wild = Manoeuvre("Full throttle", "road", 30.0, drive=DriveTable((0.0, 30.0), (5e3, 5e3)))
    found = advise_unmeasured(CAR, {"wild": wild, **chosen(("heave",))})
    assert [one.key for one in found.ranked] == ["heave"]
    assert "faster than" in found.excluded["wild"]
    with pytest.raises(ProblemError, match=r"wild is planned, but gives no run\."):
        advise_unmeasured(CAR, {"wild": wild}, planned=("wild",))


def test_a_plan_of_what_is_no_candidate_is_refused():
    with pytest.raises(ProblemError, match=r"bump is planned, but the candidates are heave; "):
        advise_unmeasured(CAR, chosen(("heave",)), planned=("bump",))
