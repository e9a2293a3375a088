import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from ridetune.engine.identification.combinations import COMBINATIONS
from ridetune.engine.identification.fit import ParameterEstimate
from ridetune.engine.identification.fit_findings import bound_findings, undetermined_findings
from ridetune.engine.identification.uncertainty import Uncertainty
from ridetune.engine.identification.variables import FreeParameter
from ridetune.engine.identification.verdict import by_class, verdict, without_verdict
from ridetune.engine.parameters import default_bounds
from ridetune.engine.vehicle import Brakes

from ...factories import paper_vehicle

CAR = paper_vehicle()
BAR, DISTANCE, ANGLE = "front.stabilizer_bar.stiffness", "front.pivot.distance", "front.pivot.angle"
NAMES = (BAR, DISTANCE)
REAR = ("rear.pivot.distance", "rear.pivot.angle")
NAMED = {one.name: one for one in COMBINATIONS}


def estimated(words=("weakly", "weakly"), names=NAMES, at_bound=False, car=CAR):
    return [
        ParameterEstimate(name, car.value(name), "", 0.0, (0, 0), 1.0, *bounds, at_bound, word)
        for name, word in zip(names, words, strict=True)
        for bounds in [default_bounds(name, 1.0)]
    ]


def judged(
    covariance,
    unknown=(),
    words=("weakly", "weakly"),
    names=NAMES,
    at_bound=False,
    car=CAR,
    released=None,
):
    """The verdict on parameters with some covariance of their logarithms."""
    n = len(names)
    errors = Uncertainty(
        np.array(covariance), np.array(unknown).reshape(-1, n), quantile=2.0, alone=np.zeros(n)
    )
    return verdict(estimated(words, names, at_bound, car), errors, car, released)


def along(*directions):
    """Covariance with variances along directions that are at right angles: pairs of both."""
    units = [(variance, np.array(axis) / np.linalg.norm(axis)) for variance, axis in directions]
    return sum(variance * np.outer(axis, axis) for variance, axis in units)


def test_a_bar_is_known_by_its_rate_at_the_wheels_where_its_stiffness_is_not():
    """Oracle: Var ln(Ktor/d^2) = Var ln Ktor + 4 Var ln d - 4 Cov. K_tor and d move by 20 % and
    10 % together, their rate by 1 %: along (1, -2)/sqrt(5) a variance of 1e-4 / 5."""
    found = judged(along((0.05, (2, 1)), (1e-4 / 5, (1, -2))))
    rate = next(one for one in found.combinations if one.name == "front.bar_rate")
    assert rate.value == pytest.approx(CAR.value(BAR) / CAR.value(DISTANCE) ** 2)
    assert rate.std_error == pytest.approx(0.01 * rate.value, rel=1e-6)
    low, high = rate.confidence_interval
    assert (low, high) == pytest.approx((rate.value * np.exp(-0.02), rate.value * np.exp(0.02)))
    assert rate.determined == "yes"
    [sentence] = [one for one in found.sentences if "bar's rate" in one]
    assert sentence.startswith("Ktor_F and d_F are determined only together, as Ktor_F/d_F^2")


def test_a_pair_is_told_once():
    """Its combination says what the runs know of it; a warning stands where there is none."""
    covariance = along((0.5, (2, 1)), (1e-4 / 5, (1, -2)))
    errors = Uncertainty(covariance, np.empty((0, 2)), quantile=2.0, alone=np.zeros(2))
    estimates = estimated(("no", "no"))
    [warning] = undetermined_findings(estimates, errors)
    assert f"hardly tell {BAR} from {DISTANCE}" in warning
    combinations = verdict(estimates, errors, CAR).combinations
    assert "front.bar_rate" in [one.name for one in combinations]
    assert undetermined_findings(estimates, errors, combinations) == []


def test_what_follows_from_a_combination_is_not_told_again():
    """Oracle: K + 2 Ktor/d^2 with K known moves with Ktor and d as Ktor/d^2 does; with K unknown,
    it is news."""
    spring = "front.suspension.stiffness"
    together = np.array([[0.04, 0.02, 0.0], [0.02, 0.01 + 1e-6, 0.0], [0.0, 0.0, 1e-6]])
    rates = ["front.bar_rate", "front.wheel_rate_in_roll"]
    found = judged(together, words=("no", "no", "yes"), names=(*NAMES, spring))
    assert [one.name for one in found.combinations] == rates
    assert [one for one in found.sentences if "together" in one] == [
        one for one in found.sentences if "Ktor_F/d_F^2, the front" in one
    ]
    roll = np.array([*(2.0 * CAR.value(BAR) / CAR.value(DISTANCE) ** 2 * np.array([1, -2]))])
    gradient = np.array([*roll, CAR.value(spring)]) / NAMED[rates[1]].value(CAR)
    across = np.cross(gradient, [2.0, 1.0, 0.0])
    unsprung = along((0.05, (2, 1, 0)), (0.05, across), (1e-6, gradient))
    found = judged(unsprung, words=("no", "no", "no"), names=(*NAMES, spring))
    assert sum("wheel rate in roll" in one for one in found.sentences) == 1


def test_a_wider_bound_is_no_remedy_for_what_only_a_combination_tells():
    """Where the runs know the rate alone, its parts may lie at any bound."""
    estimates = estimated(("no", "no"), at_bound=True)
    [first, _] = bound_findings(estimates, without_verdict(estimates))
    assert first.endswith("widen the bound or fix the parameter.")
    together = along((0.5, (2, 1)), (1e-4 / 5, (1, -2)))
    found = judged(together, words=("no", "no"), at_bound=True)
    [first, _] = bound_findings(estimates, found)
    assert f"only together with {DISTANCE}, as Ktor_F/d_F^2" in first
    assert "widen the bound" not in first
    held = judged(together, words=("no", "no"), at_bound=True, released={BAR: np.array([0.2, 0.0])})
    [first, _] = bound_findings(estimates, held)
    assert "widen the bound" in first


def test_what_is_not_free_is_not_told_of():
    """With d_F known, K_F and Ktor_F alone make the wheel rate in roll."""
    names = ("front.suspension.stiffness", BAR)
    roll = NAMED["front.wheel_rate_in_roll"]
    bar = 2.0 * CAR.value(BAR) / CAR.value(DISTANCE) ** 2
    gradient = np.array([CAR.value(names[0]), bar]) / roll.value(CAR)
    across = np.array([gradient[1], -gradient[0]])
    found = judged(along((0.05, across), (1e-5, gradient)), words=("no", "no"), names=names)
    [rate] = [one for one in found.combinations if one.name == roll.name]
    assert rate.of == names
    assert found.sentences[-1].startswith("K_F and Ktor_F are determined only together")


def test_a_direction_that_no_run_moves_leaves_the_rate_known():
    """Oracle: (2, 1) in (ln Ktor, ln d) leaves Ktor/d^2 as it is, so its error stays finite."""
    found = judged(
        along((1e-4 / 5, (1, -2))), unknown=[np.array([2, 1]) / math.sqrt(5)], words=("no", "no")
    )
    rate = next(one for one in found.combinations if one.name == "front.bar_rate")
    assert rate.std_error == pytest.approx(0.01 * rate.value, rel=1e-6)
    first, second = found.directions
    assert first.half_width == math.inf
    assert dict(first.parts) == pytest.approx({BAR: 2 / math.sqrt(5), DISTANCE: 1 / math.sqrt(5)})
    assert second.half_width == pytest.approx(2.0 * math.sqrt(1e-4 / 5))
    assert second.combination == "front.bar_rate"


def test_a_parameter_without_a_part_in_a_combination_leaves_it_told():
    """Oracle: without a bar's rate its arm d, which no run moves, has no part in K + 2 Ktor/d^2,
    whose logarithm moves by 1 with ln K and by 2 s/(d^2 K) with Ktor/s, s the scale."""
    spring = "front.suspension.stiffness"
    car = CAR.with_values({BAR: 0.0})
    bar = FreeParameter(BAR, 0.0, 0.0, 2e5)
    slope = 2.0 * bar.scale / (car.value(DISTANCE) ** 2 * car.value(spring))
    gradient, across = np.array([1.0, slope, 0.0]), np.array([slope, -1.0, 0.0])
    errors = Uncertainty(
        along((0.05, across), (1e-4 / (gradient @ gradient), gradient)),
        np.array([[0.0, 0.0, 1.0]]),
        quantile=2.0,
        alone=np.zeros(3),
    )
    estimates = [
        ParameterEstimate(name, car.value(name), "", 0.0, (0, 0), start, *bounds, False, "no")
        for name, start, bounds in (
            (spring, 24e3, (1e3, 1e5)),
            (BAR, 0.0, (0.0, 2e5)),
            (DISTANCE, 1.6, (0.1, 10.0)),
        )
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = verdict(estimates, errors, car)
    [rate] = [one for one in found.combinations if one.name == "front.wheel_rate_in_roll"]
    assert rate.value == car.value(spring)
    assert rate.std_error == pytest.approx(0.01 * rate.value, rel=1e-6)


def test_a_parameter_at_its_bound_may_be_known_together_with_another():
    """Oracle: as above; beyond the bound the other would follow, and leave their rate as it is."""
    covariance = along((0.05, (2, 1)), (1e-4 / 5, (1, -2)))
    found = judged(covariance, words=("no", "weakly"), at_bound=True)
    assert "front.bar_rate" in [one.name for one in found.combinations]


@pytest.mark.parametrize(
    ("step", "held"),
    [([0.5, 0.0], False), ([0.5, 0.0021], True), ([0.5, -0.0021], True)],
)
def test_what_is_determined_hangs_on_a_bound_that_would_move_it(step, held):
    """Oracle: d_F is known to 2 x 0.001. Were the bar's bound further away, d_F would go by more
    than that, or stay."""
    apart = np.diag([0.09, 1e-6])
    found = judged(apart, words=("no", "yes"), at_bound=True, released={BAR: np.array(step)})
    assert found.conditions == ({BAR: (DISTANCE,)} if held else {})
    condition = ", if Ktor_F is where its bound puts it" if held else ""
    assert found.sentences[0] == f"Determined to better than 15 %{condition}: d_F."


def test_a_bound_along_the_valley_of_a_combination_holds_nothing():
    """Oracle: Ktor/d^2 stays where ln Ktor goes by 2 and ln d by 1; it goes by 0.2 with Ktor alone,
    and is known to 0.02."""
    together = along((0.05, (2, 1)), (1e-4 / 5, (1, -2)))
    rates = ("front.bar_rate", "front.wheel_rate_in_roll")
    for step, held in (([0.2, 0.1], {}), ([0.2, 0.0], {BAR: rates})):
        released = {BAR: np.array(step)}
        found = judged(together, words=("no", "no"), at_bound=True, released=released)
        assert found.conditions == held
        assert ("if Ktor_F is where its bound puts it" in found.sentences[-1]) == bool(held)


def test_independent_parameters_are_not_told_together():
    """Oracle: uncorrelated, the rate is as uncertain as its parts make it."""
    assert not judged(np.diag([0.02, 0.02])).combinations


def test_well_known_parameters_need_no_combination():
    covariance = along((0.05, (2, 1)), (1e-4 / 5, (1, -2)))
    assert not judged(covariance, words=("yes", "yes")).combinations


def test_the_traction_slope_s_error_is_absolute():
    """Oracle: d(tan phi - r/d) = s / cos^2 phi dx + r/d dln(d), x = phi/s with s the start, 1."""
    pivot, radius = CAR.rear.pivot, CAR.rear.wheel.radius
    gradient = np.array(
        [radius / pivot.distance, 1.0 / math.cos(pivot.angle) ** 2],
    )
    across = np.array([gradient[1], -gradient[0]])
    covariance = along((0.05, across), (1e-6 / (gradient @ gradient), gradient))
    found = judged(covariance, names=REAR)
    slope = next(one for one in found.combinations if one.name == "rear.traction_slope")
    assert slope.std_error == pytest.approx(1e-3, rel=1e-6)
    assert slope.value == pytest.approx(math.tan(pivot.angle) - radius / pivot.distance)
    low, high = slope.confidence_interval
    assert (low, high) == pytest.approx((slope.value - 2e-3, slope.value + 2e-3))


def test_a_traction_slope_of_0_is_determined_as_one_of_0_05():
    """Oracle: tan phi = r/d, so the slope is 0; its error as above, +-0.002 of 0.05: 4 %."""
    pivot, radius = CAR.rear.pivot, CAR.rear.wheel.radius
    car = CAR.with_values({REAR[1]: math.atan(radius / pivot.distance)})
    gradient = np.array([radius / pivot.distance, 1.0 + (radius / pivot.distance) ** 2])
    across = np.array([gradient[1], -gradient[0]])
    covariance = along((0.05, across), (1e-6 / (gradient @ gradient), gradient))
    found = judged(covariance, names=REAR, car=car)
    slope = next(one for one in found.combinations if one.name == "rear.traction_slope")
    assert slope.value == pytest.approx(0.0, abs=1e-12)
    assert slope.determined == "yes"
    [sentence] = [one for one in found.sentences if "slope" in one]
    assert sentence.endswith("± 0.002.")


@pytest.mark.parametrize(
    ("driven", "reaction", "braked", "told"),
    [
        (True, "chassis", "arm", True),
        (True, "arm", "arm", False),
        (False, "chassis", "arm", False),
        (False, "chassis", "chassis", True),
    ],
)
def test_a_traction_slope_is_told_where_the_chassis_holds_a_torque(driven, reaction, braked, told):
    """Oracle: moments about the pivot. A force at the ground whose torque the arm holds lifts by
    tan phi alone; the chassis's torque turns the arm by r times the force more."""
    axle = replace(CAR.rear, driven=driven, torque_reaction=reaction)
    car = replace(CAR, rear=axle, brakes=Brakes(0.65, braked))
    pivot, radius = CAR.rear.pivot, CAR.rear.wheel.radius
    gradient = np.array([radius / pivot.distance, 1.0 / math.cos(pivot.angle) ** 2])
    covariance = along((0.05, (gradient[1], -gradient[0])), (1e-6, gradient))
    found = judged(covariance, names=REAR, car=car)
    assert ("rear.traction_slope" in [one.name for one in found.combinations]) == told


def test_a_bar_that_is_turned_by_opposite_wheels_stiffens_each():
    """Oracle: energy. Wheels at +z and -z turn the arms by z/d each way, so the bar holds
    1/2 Ktor (2 z/d)^2 and the springs 2 x 1/2 K z^2: both wheels' 1/2 rate z^2."""
    bar, distance, z = CAR.front.stabilizer_bar.stiffness, CAR.front.pivot.distance, 0.01
    energy = 0.5 * bar * (2 * z / distance) ** 2 + CAR.front.suspension.stiffness * z**2
    rate = NAMED["front.wheel_rate_in_roll"].value(CAR)
    assert 2 * 0.5 * rate * z**2 == pytest.approx(energy)


def test_a_fit_without_errors_has_classes_alone():
    estimate = ParameterEstimate(BAR, 1.0, "", 0.0, (0, 0), 1.0, 0.1, 9.0, False, "no")
    found = without_verdict([estimate])
    assert found.parameters == by_class([estimate]) == {"yes": (), "weakly": (), "no": (BAR,)}
    assert [found.combinations, found.directions, found.sentences] == [(), (), ()]
    assert found.conditions == {}
