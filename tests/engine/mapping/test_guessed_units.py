"""Which unit a column is in, by what is stated and by the size of its numbers, which is known."""

import numpy as np
import pytest
from ridetune.engine.mapping.apply import apply
from ridetune.engine.mapping.guess import chosen_by_hand
from ridetune.engine.mapping.survey import survey

from .mapped_tables import guessed, guessed_name, held, proposed


@pytest.mark.parametrize(
    ("name", "stated", "taken"),
    [
        ("acc_x", "g", "g"),
        ("acc_x", "G", "G"),
        ("brake torque fl", "Nm", "Nm"),
        ("pitch", "Grad", "deg"),
        ("acc_x", "m|s2", "m/s2"),
        ("acc_x", "[m/sec^2]", "m/s^2"),
        ("roll rate", "deg/sec", "deg/s"),
        ("speed", "kph", "kph"),
    ],
)
def test_units_that_mean_something_else_to_others(name, stated, taken):
    """g is no gram, G no gauss, Nm no number, Grad no gradian."""
    assert proposed(name, stated)[1] == taken


@pytest.mark.parametrize(
    ("name", "stated", "factor"),
    [("acc_x", "G", 9.80665), ("pitch", "Grad", np.pi / 180), ("accel_x", "m|s2", 1.0)],
)
def test_their_numbers_become_si(name, stated, factor):
    """Oracle: standard gravity, degrees, and hours of 3600 s."""
    time = np.arange(0.0, 5.0, 0.01)
    table = held({"Time": ("s", time), name: (stated, np.sin(time))})
    run = apply(guessed(table).mapping, table)
    np.testing.assert_allclose(run[run.columns[0]], factor * np.sin(time), rtol=1e-12)


@pytest.mark.parametrize("stated", ["", "-", "1"])
def test_without_a_unit_the_numbers_decide(stated):
    """Wheels move centimetres: what reaches 30 is in mm, what reaches 0.03 in m."""
    time = np.arange(0.0, 5.0, 0.01)
    for size, unit in ((30.0, "mm"), (0.03, "m")):
        table = held({"Time": ("s", time), "Rad VL z": (stated, size * np.sin(time))})
        [one] = [one for one in guessed(table).chosen.values() if one.channel == "wheel.fl.z"]
        assert one.unit == unit
        assert one.reason.startswith("name only; values to")
        assert one.confidence < 0.9


@pytest.mark.parametrize(("size", "unit"), [(30.0, "mm"), (0.009, "m")])
def test_a_column_chosen_by_hand_takes_its_unit_from_its_numbers(size, unit):
    """Its name tells nothing of a wheel; the wheel's size is that of the rule for a guess."""
    time = np.arange(0.0, 5.0, 0.01)
    found = survey(held({"Time": ("s", time), "whl_z(1)": ("", size * np.sin(time))}))
    one = chosen_by_hand(found.columns[1], found.known[1], "wheel.fl.z")
    assert (one.channel, one.unit, one.sign, one.doubted) == ("wheel.fl.z", unit, 1, True)
    assert one.reason == f"choice only; values to {size:.4g} fit {unit}"


@pytest.mark.parametrize(
    ("name", "stated", "unit", "doubted"),
    [("c1", "mm", "mm", False), ("wheel_mm", "", "mm", False), ("c1", "m", "mm", True)],
)
def test_a_column_chosen_by_hand_keeps_the_unit_that_its_numbers_fit(name, stated, unit, doubted):
    time = np.arange(0.0, 5.0, 0.01)
    found = survey(held({"Time": ("s", time), name: (stated, 30.0 * np.sin(time))}))
    one = chosen_by_hand(found.columns[1], found.known[1], "wheel.fl.z")
    assert (one.unit, one.doubted) == (unit, doubted)


def test_a_unit_of_another_quantity_is_not_followed():
    """A pitch in seconds is offered as a candidate with its doubt, not proposed."""
    found = guessed_name("pitch", "s")
    assert not found.chosen
    [one] = found.candidates[0]
    assert one.channel == "chassis.pitch"
    assert "its unit s measures time" in one.reason


def test_angle_by_unit_is_a_rate_by_unit():
    assert proposed("pitch", "deg/s") == ("chassis.pitch_rate", "deg/s")
    assert proposed("Nick", "deg") == ("chassis.pitch", "deg")
