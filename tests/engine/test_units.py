"""Oracle: definitions of the units (BIPM; 1 in = 25.4 mm, 1 lb = 0.45359237 kg, g = 9.80665)."""

import math

import pytest
from ridetune.engine import units
from ridetune.engine.units import UnitError, in_percent, to_si


@pytest.mark.parametrize(
    ("text", "si_unit", "factor"),
    [
        ("mm", "m", 1e-3),
        ("µm", "m", 1e-6),
        ("\u03bcm", "m", 1e-6),
        ("in", "m", 0.0254),
        ("nm", "m", 1e-9),
        ("km/h", "m/s", 1 / 3.6),
        ("KM/H", "m/s", 1 / 3.6),
        ("kmh", "m/s", 1 / 3.6),
        ("mph", "m/s", 0.44704),
        ("m/s2", "m/s^2", 1.0),
        ("m/s**2", "m/s^2", 1.0),
        ("m s-2", "m/s^2", 1.0),
        ("m·s⁻²", "m/s^2", 1.0),
        ("m/s/s", "m/s^2", 1.0),
        ("mm/s²", "m/s^2", 1e-3),
        ("deg", "rad", math.pi / 180),
        ("°", "rad", math.pi / 180),
        ("Deg", "rad", math.pi / 180),
        ("mrad", "rad", 1e-3),
        ("°/s", "rad/s", math.pi / 180),
        ("rev/min", "rad/s", 2 * math.pi / 60),
        ("kN", "N", 1e3),
        ("lbf", "N", 0.45359237 * 9.80665),
        ("kp", "N", 9.80665),
        ("Nm", "N m", 1.0),
        ("kNm", "N m", 1e3),
        ("N·mm", "N m", 1e-3),
        ("Nms/°", "N m s/rad", 180 / math.pi),
        ("ms", "s", 1e-3),
        ("sec", "s", 1.0),
        ("1/s", "Hz", 1.0),
        ("%", "1", 0.01),
        ("-", "1", 1.0),
        ("", "1", 1.0),
    ],
)
def test_a_unit_has_its_defined_factor(text, si_unit, factor):
    assert to_si(text, si_unit) == (pytest.approx(factor, rel=1e-12), 0.0)


@pytest.mark.parametrize(("text", "si_unit"), units._EVERYDAY)
def test_a_unit_of_our_own_files_is_pints(text, si_unit):
    assert to_si(text, si_unit) == pytest.approx(units._converted(text, si_unit), rel=1e-15)


@pytest.mark.parametrize("text", ["g", "G", "gn", "g_n"])
def test_g_is_gravity_where_an_acceleration_is_expected(text):
    assert to_si(text, "m/s^2")[0] == pytest.approx(9.80665, rel=1e-12)


def test_g_is_gram_where_a_mass_is_expected():
    assert to_si("g", "kg")[0] == pytest.approx(1e-3, rel=1e-12)


def test_mg_is_a_thousandth_of_gravity_for_an_acceleration():
    assert to_si("mg", "m/s^2")[0] == pytest.approx(9.80665e-3, rel=1e-12)


def test_a_scale_with_another_zero_has_an_offset():
    factor, offset = to_si("degC", "K")
    assert factor == pytest.approx(1.0, rel=1e-12)
    assert offset == pytest.approx(273.15, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "si_unit"),
    [("V", "m"), ("g", "m"), ("m^2", "m"), ("s", "m"), ("Hz", "rad/s"), ("-", "rad"), ("1", "m")],
)
def test_a_unit_of_another_quantity_is_refused(text, si_unit):
    with pytest.raises(UnitError, match="does not measure the same quantity"):
        to_si(text, si_unit)


@pytest.mark.parametrize(
    "text",
    ["furlog", "m/", "/m", "m//s", "()", "\ud800", "__import__('os')", "m" * 1000, "2 m", "m m("],
)
def test_an_unknown_unit_is_refused(text):
    with pytest.raises(UnitError, match="is not known"):
        to_si(text, "m")


@pytest.mark.parametrize("text", ["m**9**9**9", "9**9**9**9", "m^(9^9)", "1e9999 m", "m^99"])
def test_arithmetic_in_a_unit_is_never_evaluated(text):
    with pytest.raises(UnitError):
        to_si(text, "m")


@pytest.mark.parametrize(
    ("share", "said"),
    [
        (1.1, "110 %"),
        (12.34, "1200 %"),
        (0.0996, "10 %"),
        (0.052, "5.2 %"),
        (0.005, "0.5 %"),
        (5e-5, "<0.01 %"),
        (-0.25, "-25 %"),
        (0.0, "0 %"),
    ],
)
def test_a_percentage_has_two_digits_and_no_exponent(share, said):
    assert in_percent(share) == said
