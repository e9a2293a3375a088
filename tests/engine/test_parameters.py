import math

import pytest
from ridetune.engine.errors import ParameterError
from ridetune.engine.parameters import (
    ALL_NAMES,
    ALL_PARAMETERS,
    DAMPER_NAMES,
    PARAMETERS,
    damper_starts,
    default_bounds,
    parameter,
)
from ridetune.engine.units import to_si
from ridetune.engine.vehicle import numbers
from ridetune.engine.vehicle_file import reference_vehicles


def test_the_twelve_stand_in_the_order_of_table_3():
    symbols = "K_F C_F K_R C_R Ktor_F Ctor_F Ktor_R Ctor_R d_F phi_F d_R phi_R"
    assert [row.symbol for row in PARAMETERS] == symbols.split()


def cars_with(row):
    """Reference cars that have the parameter."""
    return [car for car in reference_vehicles().values() if car.value(row.name) is not None]


@pytest.mark.parametrize("row", ALL_PARAMETERS, ids=lambda row: row.symbol)
class TestEveryParameter:
    def test_its_name_is_a_number_of_the_vehicle_with_the_same_unit(self, row):
        assert numbers()[row.name].unit == row.unit

    def test_its_display_factor_is_that_of_its_units(self, row):
        factor, offset = to_si(row.display_unit, row.unit)
        assert (row.display_factor * factor, offset) == (pytest.approx(1.0, rel=1e-12), 0.0)

    def test_its_slider_stays_where_the_vehicle_is_accepted(self, row):
        accepted = numbers()[row.name]
        assert accepted.holds(row.slider_lower)
        assert accepted.holds(row.slider_upper)

    def test_its_slider_reaches_every_reference_car(self, row):
        for car in cars_with(row):
            assert row.slider_lower <= car.value(row.name) <= row.slider_upper

    def test_its_slider_has_steps_a_hand_can_use(self, row):
        assert 50 <= (row.slider_upper - row.slider_lower) / row.step <= 2500

    def test_its_default_bounds_hold_the_start_of_every_reference_car(self, row):
        cars = [car for car in cars_with(row) if car.value(row.name) != 0.0]
        for car in cars:
            start = car.value(row.name)
            lower, upper = default_bounds(row.name, start)
            assert lower < start < upper
            for bound in (lower, upper):
                assert car.with_values({row.name: bound}).value(row.name) == bound

    def test_its_default_bounds_stay_where_the_vehicle_is_accepted(self, row):
        accepted = numbers()[row.name]
        for start in (max(accepted.lower, 1e-3), accepted.upper):
            lower, upper = default_bounds(row.name, start)
            assert accepted.holds(lower)
            assert accepted.holds(upper)

    def test_it_is_found_by_name_and_by_symbol_in_any_case(self, row):
        assert parameter(row.name) is parameter(row.symbol) is row
        assert parameter(row.symbol.lower()) is row


def test_stiffness_and_damping_are_bounded_by_multiples_of_the_start():
    assert default_bounds("rear.suspension.damping", 2000.0) == (100.0, 16000.0)
    assert default_bounds("front.stabilizer_bar.stiffness", 2e4) == (1000.0, 160000.0)


def test_pivot_angles_have_fixed_bounds():
    assert default_bounds("front.pivot.angle", 0.0) == (-0.3, 1.3)


def test_a_pivot_stays_on_its_side_of_the_wheel():
    assert default_bounds("rear.pivot.distance", 1.1) == (0.1, 10.0)
    assert default_bounds("rear.pivot.distance", -1.1) == (-10.0, -0.1)


@pytest.mark.parametrize("start", [0.0, -1.0, math.nan])
def test_no_bounds_follow_from_a_bar_that_is_not_there(start):
    with pytest.raises(ParameterError, match=r"rear\.stabilizer_bar\.stiffness starts at .* fix"):
        default_bounds("rear.stabilizer_bar.stiffness", start)


@pytest.mark.parametrize(
    ("name", "near"),
    [("front.pivot.angel", "front.pivot.angle"), ("ktorf", "Ktor_F")],
)
def test_a_misspelt_parameter_is_answered_with_the_nearest(name, near):
    with pytest.raises(ParameterError, match=f"did you mean {near}"):
        parameter(name)


def test_an_unknown_parameter_is_answered_with_all_names():
    with pytest.raises(ParameterError) as caught:
        parameter("xyz")
    assert all(name in str(caught.value) for name in ALL_NAMES)


def test_a_linear_damper_lacks_start_values_which_a_bent_one_has():
    car = reference_vehicles()["paper"]
    starts = {"rebound_ratio": 1.5, "knee_speed": 0.5}
    assert damper_starts(car, ALL_NAMES) == {
        name: starts[name.rpartition(".")[2]] for name in DAMPER_NAMES
    }
    front = car.with_values({"front.suspension.knee_speed": 0.3})
    assert damper_starts(front, DAMPER_NAMES) == {
        "rear.suspension.rebound_ratio": 1.5,
        "rear.suspension.knee_speed": 0.5,
    }
    assert damper_starts(car, ["front.suspension.damping"]) == {}
