"""What is at a bound: a matter of the variable in which the search works."""

import math

import pytest
from ridetune.engine.identification.variables import FreeParameter

BAR = FreeParameter("rear.stabilizer_bar.damping", 100.0, 5.0, 1e5)
BEHIND = FreeParameter("front.pivot.distance", -1.6, -10.0, -0.1)
ANGLE = FreeParameter("front.pivot.angle", 0.1, -0.3, 1.3)


@pytest.mark.parametrize(
    ("one", "lower", "upper"),
    [
        (BAR, lambda part: 5.0 * 2e4**part, lambda part: 1e5 / 2e4**part),
        (BEHIND, lambda part: -10.0 / 100.0**part, lambda part: -0.1 * 100.0**part),
        (ANGLE, lambda part: -0.3 + 1.6 * part, lambda part: 1.3 - 1.6 * part),
    ],
    ids=["logarithm", "negative", "angle"],
)
def test_a_value_is_at_a_bound_within_a_thousandth_of_the_variable_s_range(one, lower, upper):
    """Oracle: that part of the range, in the logarithm or of an angle itself, in closed form."""
    assert one.at_lower(lower(0.0))
    assert one.at_lower(lower(0.9e-3))
    assert not one.at_bound(lower(1.1e-3))
    assert not one.at_bound(upper(1.1e-3))
    assert one.at_upper(upper(0.9e-3))
    assert not one.at_lower(upper(0.9e-3))
    assert not one.at_upper(lower(0.9e-3))


def test_a_value_far_from_a_bound_by_its_factor_is_not_at_it():
    """100 is twenty times 5, though 95 is less than a thousandth of the range to 100000."""
    assert not BAR.at_bound(100.0)


def test_the_ends_are_those_of_the_variable():
    """Oracle: ln |p / s|, of which the larger magnitude is the upper end."""
    assert BAR.ends == pytest.approx((math.log(5.0 / BAR.scale), math.log(1e5 / BAR.scale)))
    assert BEHIND.ends == pytest.approx((math.log(0.1 / 1.6), math.log(10.0 / 1.6)))
    assert ANGLE.ends == pytest.approx((-3.0, 13.0))
