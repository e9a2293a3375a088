"""Which column is which channel. Oracle throughout: a table made of channels that are known."""

import io
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ridetune.engine.channels import CHANNELS, channel
from ridetune.engine.formats.csv_file import CsvFile
from ridetune.engine.formats.table import Column, HeldTable
from ridetune.engine.mapping.apply import apply
from ridetune.engine.mapping.guess import THRESHOLD, chosen_by_hand, guess
from ridetune.engine.mapping.mapping import ChannelMapping, MappedColumn
from ridetune.engine.mapping.survey import survey

from .mapped_tables import guessed, guessed_name, held, renamed, truth

CORNERS = ("fl", "fr", "rl", "rr")


def proposed(name, unit=""):
    """(channel, unit) that a header alone is proposed as, None for nothing."""
    one = guessed_name(name, unit).chosen.get(0)
    return one and (one.channel, one.unit)


# --- names ------------------------------------------------------------------------------------

KNOWN_NAMES = [
    ("Time", "s", "time"),
    ("Zeit", "s", "time"),
    ("t", "s", "time"),
    ("Car.CFL.tz", "m", "wheel.fl.z"),
    ("Car.CRR.tz", "m", "wheel.rr.z"),
    ("Car.ax", "m/s^2", "chassis.a_x"),
    ("Car.vx", "m/s", "chassis.v_x"),
    ("Car.v", "m/s", "chassis.v_x"),
    ("Car.tz", "m", "chassis.z"),
    ("Car.Pitch", "rad", "chassis.pitch"),
    ("Car.PitchVel", "rad/s", "chassis.pitch_rate"),
    ("Car.FzFL", "N", "tyre.fl.load"),
    ("Vhcl.Roll", "rad", "chassis.roll"),
    ("Vhcl.sRoad", "m", "chassis.x"),
    ("a_x_Vehicle_CoG[m|s2]", "", "chassis.a_x"),
    ("v_x_Vehicle_CoG[km|h]", "", "chassis.v_x"),
    ("z_Wheel_FL[m]", "", "wheel.fl.z"),
    ("chassis_displacements.vertical", "mm", "chassis.z"),
    ("chassis_accelerations.longitudinal", "g", "chassis.a_x"),
    ("wheel_displacement.vertical_left_front", "mm", "wheel.fl.z"),
    ("velocity kmh", "", "chassis.v_x"),
    ("Longitudinal acceleration", "g", "chassis.a_x"),
    ("pitch rate", "deg/s", "chassis.pitch_rate"),
    ("gyro_y", "deg/s", "chassis.pitch_rate"),
    ("Nickwinkel", "°", "chassis.pitch"),
    ("Wankwinkel", "Grad", "chassis.roll"),
    ("Wankrate", "°/s", "chassis.roll_rate"),
    ("Längsbeschleunigung", "m/s²", "chassis.a_x"),
    ("Laengsbeschl.", "g", "chassis.a_x"),
    ("Fahrzeuggeschwindigkeit", "km/h", "chassis.v_x"),
    ("Aufbauhub", "mm", "chassis.z"),
    ("Vertikalweg Aufbau", "mm", "chassis.z"),
    ("Radhub VL", "mm", "wheel.fl.z"),
    ("Rad vorne links z", "mm", "wheel.fl.z"),
    ("Radmittelpunkt_z_HL", "mm", "wheel.rl.z"),
    ("Weg_Rad_HR", "mm", "wheel.rr.z"),
    ("Federweg_VR", "mm", "suspension.fr.travel"),
    ("Einfederung HL", "mm", "suspension.rl.travel"),
    ("Radlast VR", "N", "tyre.fr.load"),
    ("wheel_front_left_z", "mm", "wheel.fl.z"),
    ("WheelFLz", "mm", "wheel.fl.z"),
    ("rim centre FL z", "mm", "wheel.fl.z"),
    ("hub_z_RR", "mm", "wheel.rr.z"),
    ("axle_disp_lr", "mm", "wheel.rl.z"),
    ("string pot LF", "mm", "suspension.fl.travel"),
    ("damper_pos_RR", "mm", "suspension.rr.travel"),
    ("susp travel rear left", "mm", "suspension.rl.travel"),
    ("heave", "mm", "chassis.z"),
    ("bounce", "m", "chassis.z"),
    ("VehSpd", "kph", "chassis.v_x"),
    ("AccelX", "g", "chassis.a_x"),
    ("SeatDriver_az", "m/s^2", "seat.driver.a_z"),
    ("BrakeTrq_FL", "Nm", "brake.fl.torque"),
    ("AccY", "g", "chassis.body_a_y"),
    ("heave acceleration", "m/s^2", "chassis.body_a_z"),
    ("Wheel Speed FL", "km/h", "wheel.fl.speed"),
    ("Radgeschwindigkeit HR", "km/h", "wheel.rr.speed"),
    ("Wheel_FL_az", "m/s^2", "wheel.fl.a_z"),
    ("HubAcc_Z_RL", "g", "wheel.rl.a_z"),
    ("Beschleunigung Radträger VR", "g", "wheel.fr.a_z"),
]


@pytest.mark.parametrize(("name", "unit", "expected"), KNOWN_NAMES)
def test_usual_names_are_known(name, unit, expected):
    assert proposed(name, unit)[0] == expected


@pytest.mark.parametrize("known", ["time", *CHANNELS])
def test_our_own_names_are_themselves(known):
    assert proposed(known, channel(known).unit) == (known, channel(known).unit)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("Yaw rate", "deg/s"),
        ("Wheel Speed FL", "rad/s"),
        ("Wheel_FL_ay", "m/s^2"),
        ("Lenkradwinkel", "deg"),
        ("latitude", "deg"),
        ("Car.PitchAcc", "rad/s^2"),
        ("Oil temperature", "degC"),
        ("Bremsdruck VL", "bar"),
        ("signal 7", "mm"),
        ("", ""),
    ],
)
def test_other_quantities_are_left_alone(name, unit):
    assert proposed(name, unit) is None


WHEEL, BODY, GERMAN = ("wheel", "whl", "rim", "rad"), ("body", "chassis", "aufbau"), ("z", "weg")
CORNER_WORDS = {
    "fl": (("front", "left"), ("fl",), ("lf",), ("vl",), ("vorne", "links")),
    "fr": (("front", "right"), ("fr",), ("rf",), ("vr",), ("vorn", "rechts")),
    "rl": (("rear", "left"), ("rl",), ("lr",), ("hl",), ("hinten", "links")),
    "rr": (("rear", "right"), ("rr",), ("hr",), ("rechts", "hinten")),
}
SUBJECTS = {
    **{
        f"wheel.{corner}.z": [(w, *c) for w in WHEEL for c in CORNER_WORDS[corner]]
        for corner in CORNERS
    },
    "chassis.z": [(word,) for word in BODY],
    "chassis.pitch": [("pitch",), ("nick",), ("body", "pitch"), ("chassis", "pitch", "angle")],
    "chassis.roll": [("roll", "angle"), ("wank", "winkel"), ("vehicle", "roll")],
    "chassis.a_x": [("acc", "x"), ("accel", "long"), ("laengs", "beschleunigung"), ("body", "ax")],
    "chassis.v_x": [
        ("vehicle", "speed"),
        ("geschwindigkeit",),
        ("car", "velocity"),
        ("speed", "x"),
    ],
}
HEIGHTS = ("z", "disp", "vertical", "weg", "pos")
STYLES = {
    "snake": "_".join,
    "dots": ".".join,
    "spaces": " ".join,
    "dashes": "-".join,
    "camel": lambda words: "".join(word.capitalize() for word in words),
    "shout": lambda words: "_".join(words).upper(),
}
UNITS = {"m": ["m", "mm", "cm"], "rad": ["rad", "deg", "°"], "m/s": ["m/s", "km/h"]}
UNITS["m/s^2"] = ["m/s^2", "m/s²", "g"]


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_words_of_a_channel_are_found_however_they_are_written(data):
    """Subject and quantity in either order, joined in any style, in any unit of the quantity."""
    known = data.draw(st.sampled_from(sorted(SUBJECTS)))
    words = list(data.draw(st.sampled_from(SUBJECTS[known])))
    if known.endswith(".z"):
        height = ["z"] if known == "chassis.z" else [data.draw(st.sampled_from(HEIGHTS))]
        words = data.draw(st.sampled_from([words + height, height + words]))
    name = STYLES[data.draw(st.sampled_from(sorted(STYLES)))](words)
    unit = data.draw(st.sampled_from(UNITS[channel(known).unit]))
    assert proposed(name, unit) == (known, unit), name


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.text(max_size=60), st.text(max_size=12)), min_size=1, max_size=6))
@example([("uV0gB", ""), ("uV0gB", "")])
def test_any_header_is_taken_without_failing_and_no_channel_twice(header):
    found = guess([Column(name, unit, 100) for name, unit in header], {})
    channels = [one.channel for one in found.mapping.columns]
    assert len(channels) == len(set(channels))
    assert all(one.confidence >= THRESHOLD for one in found.chosen.values())


# --- whole files ------------------------------------------------------------------------------

SCHEMES = {
    "CarMaker": {
        "time": ("Time", "s", "s"),
        "chassis.z": ("Car.tz", "m", "m"),
        "chassis.pitch": ("Car.Pitch", "rad", "rad"),
        "chassis.roll": ("Car.Roll", "rad", "rad"),
        "chassis.a_x": ("Car.ax", "m/s^2", "m/s^2"),
        "chassis.v_x": ("Car.vx", "m/s", "m/s"),
        **{f"wheel.{c}.z": (f"Car.C{c.upper()}.tz", "m", "m") for c in CORNERS},
    },
    "German": {
        "time": ("Zeit", "ms", "ms"),
        "chassis.z": ("Aufbau_Hub", "mm", "mm"),
        "chassis.pitch": ("Nickwinkel", "Grad", "deg"),
        "chassis.roll": ("Wankwinkel", "Grad", "deg"),
        "chassis.a_x": ("Laengsbeschl", "g", "g"),
        "chassis.v_x": ("Geschwindigkeit", "km/h", "km/h"),
        **{
            f"wheel.{c}.z": (f"Radweg {g}", "mm", "mm")
            for c, g in zip(CORNERS, ("VL", "VR", "HL", "HR"), strict=True)
        },
    },
    "units in names": {
        "time": ("time", "", "s"),
        "chassis.z": ("body_z_mm", "", "mm"),
        "chassis.pitch": ("pitch_deg", "", "deg"),
        "chassis.roll": ("roll_deg", "", "deg"),
        "chassis.a_x": ("acc_x_g", "", "g"),
        "chassis.v_x": ("speed_kmh", "", "km/h"),
        **{f"wheel.{c}.z": (f"wheel_{c}_z_mm", "", "mm") for c in CORNERS},
    },
    "lying units": {
        "time": ("Time", "s", "ms"),
        "chassis.z": ("heave", "m", "mm"),
        "chassis.pitch": ("pitch", "rad", "deg"),
        "chassis.roll": ("roll", "rad", "deg"),
        "chassis.a_x": ("acc_x_g", "", "mg"),
        "chassis.v_x": ("speed", "-", "m/s"),
        **{f"wheel.{c}.z": (f"hub {c} z", "mm", "m") for c in CORNERS},
    },
}


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_file_of_another_house_becomes_the_run_that_it_was(scheme):
    """Rounding is that of a division and a multiplication."""
    table = renamed(truth(), SCHEMES[scheme])
    found = guessed(table)
    names = {one.column: one.channel for one in found.mapping.columns}
    assert names == {name: one for one, (name, _, _) in SCHEMES[scheme].items()}
    units = {one.channel: one.unit for one in found.mapping.columns}
    assert units == {one: unit for one, (_, _, unit) in SCHEMES[scheme].items()}
    run = apply(found.mapping, table)
    for one in SCHEMES[scheme]:
        np.testing.assert_allclose(run[one], truth()[one], rtol=1e-12, atol=1e-15)


def test_a_unit_that_lies_is_said_with_the_numbers_that_give_it_away():
    """A column named _g that holds mg, and metres that are millimetres."""
    found = guessed(renamed(truth(), SCHEMES["lying units"]))
    reasons = {one.channel: one.reason for one in found.chosen.values()}
    assert reasons["chassis.a_x"].startswith("the unit in the name lies: values to ")
    assert reasons["chassis.a_x"].endswith("fit mg, not g")
    assert "unit lies" in reasons["chassis.z"]
    assert "fit mm, not m" in reasons["chassis.z"]
    assert any(
        "heave is taken as chassis.z in mm" in one and "unit lies" in one for one in found.warnings
    )
    assert all(one.doubted for one in found.chosen.values() if "lies" in one.reason)


# --- units ------------------------------------------------------------------------------------


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


# --- signs ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "comment", "sign"),
    [
        ("pitch", "nose up positive", -1),
        ("pitch", "positive nose down", 1),
        ("roll", "right side up", -1),
        ("heave", "z down", -1),
        ("heave", "positive down", -1),
        ("Verzoegerung", "", -1),
        ("damper travel fl", "rebound positive", -1),
        ("acc_x", "", 1),
        ("acc_x", "rearward positive", -1),
        ("LaengsVerzoegerung", "", -1),
        ("pitch_NoseUp", "", -1),
        ("acc_x", "acceleration (positive) / deceleration (negative)", 1),
        ("acc_x", "by backward difference", 1),
        ("heave", "not z-down", 1),
        ("heave", "z down is negative", 1),
        ("roll", "signal of right update rate", 1),
        ("roll", "left side up, right side down", 1),
        ("pitch", "negative for nose up", 1),
        ("pitch", "not calibrated, nose up", -1),
    ],
)
def test_a_stated_sign_is_followed(name, comment, sign):
    units = {"pitch": "deg", "roll": "deg", "pitch_NoseUp": "deg", "heave": "mm"}
    unit = units.get(name, "mm" if "travel" in name else "g")
    found = guessed_name(name, unit, comment)
    assert found.chosen[0].sign == sign
    assert [f"{name} is taken as" in one for one in found.warnings] == [True] * (sign < 0)


# --- rivals and numbers -----------------------------------------------------------------------


def test_of_two_columns_that_fit_the_first_is_proposed_and_the_other_named():
    time = np.arange(0.0, 5.0, 0.01)
    table = held(
        {"Time": ("s", time), "acc_x imu1": ("g", np.sin(time)), "acc_x imu2": ("g", np.sin(time))}
    )
    found = guessed(table)
    assert found.chosen[1].channel == "chassis.a_x"
    assert "acc_x imu2 fits as well" in found.chosen[1].reason
    assert 2 not in found.chosen
    assert found.candidates[2][0].channel == "chassis.a_x"


RAW = {
    "Accel_X_body": ("g", lambda t: 0.3 * np.sin(t), "chassis.body_a_x"),
    "Accel_Y_body": ("g", lambda t: 0.1 * np.cos(t), "chassis.body_a_y"),
    "Accel_Z_body": ("g", lambda t: -1.0 + 0.2 * np.sin(9 * t), "chassis.body_a_z"),
    "Gyro_Pitch": ("deg/s", lambda t: 5 * np.cos(2 * t), "chassis.pitch_rate"),
    "HubAcc_Z_FL": ("g", lambda t: 1.0 + 2 * np.sin(30 * t), "wheel.fl.a_z"),
    "StringPot_FL": ("mm", lambda t: 12 * np.sin(9 * t), "suspension.fl.travel"),
}


def raw_table(*without):
    time = np.arange(0.0, 10.0, 0.01)
    columns = {name: (unit, make(time)) for name, (unit, make, _) in RAW.items()}
    kept = {name: one for name, one in columns.items() if name not in without}
    return held({"Time": ("s", time), **kept})


def test_raw_sensors_are_told_from_inertial_channels_by_gravity():
    """A vertical accelerometer that reads -1 g stands on its head; what has no mean is inertial."""
    found = guessed(raw_table())
    chosen = {one.channel: one for one in found.chosen.values()}
    assert set(chosen) == {"time", *(name for *_, name in RAW.values())}
    assert chosen["chassis.body_a_z"].sign == -1
    assert "reads gravity as -0.99" in chosen["chassis.body_a_z"].reason
    assert chosen["wheel.fl.a_z"].sign == 1
    # Without a gyro nothing could take gravity off a_x.
    alone = {one.channel for one in guessed(raw_table("Gyro_Pitch")).chosen.values()}
    assert "chassis.a_x" in alone
    time = np.arange(0.0, 10.0, 0.01)
    inertial = guessed(held({"Time": ("s", time), "az": ("m/s^2", 2 * np.sin(9 * time))}))
    assert inertial.chosen[1].channel == "chassis.a_z"
    assert inertial.chosen[1].sign == 1


def test_columns_of_one_name_are_told_apart_by_number():
    """What is proposed of such a file can be applied, and each of the columns be mapped."""
    time = np.arange(0.0, 5.0, 0.01)
    one, other = 3.0 * np.sin(time), 5.0 * np.cos(time)
    described = [Column(name, "mm", time.size, step=0.01) for name in ("z", "z (2)", "z", "z")]
    table = HeldTable("lap", "test", tuple(described), [one, one, other, time])
    found = survey(table)
    assert [column.name for column in found.columns] == ["z", "z (2)", "z (3)", "z (4)"]
    apply(guessed(table).mapping, table)
    run = apply(ChannelMapping((MappedColumn("z (3)", "chassis.z", "mm"),)), table)
    np.testing.assert_allclose(run["chassis.z"], 1e-3 * other)
    text = b"time [s],heave [mm],heave [mm]\n" + b"".join(
        b"%g,%g,%g\n" % row for row in zip(time, one, other, strict=True)
    )
    table = CsvFile(io.BytesIO(text), "lap.csv")
    mapping = guessed(table).mapping
    assert [entry.column for entry in mapping.columns] == ["time", "heave"]
    np.testing.assert_allclose(apply(mapping, table)["chassis.z"], 1e-3 * one, rtol=1e-5)


def test_stand_ins_gaps_and_constant_columns_are_named():
    sample = np.arange(500)
    time, lost = 0.01 * sample, (sample >= 200) & (sample < 209)
    dropped = np.where(lost, -64.0, 0.02 * np.sin(time))
    holes = np.where(lost, np.nan, np.sin(time))
    table = held(
        {
            "Time": ("s", time),
            "heave": ("m", dropped),
            "pitch": ("deg", holes),
            "roll": ("deg", np.ones_like(time)),
        }
    )
    found = guessed(table)
    said = " ".join(found.warnings)
    assert "heave is -64 in 9 samples, far outside the rest" in said
    assert "if that stands for nothing measured, give -64 as missing" in said
    assert "pitch has no number in 9 of 500 samples" in said
    assert "roll never changes" in said
    by_channel = {one.channel: one for one in found.chosen.values()}
    assert by_channel["chassis.z"].unit == "m"
    assert by_channel["chassis.z"].reason == "name and unit"


def test_a_bare_axis_is_a_guess_to_confirm():
    """The page marks what is less sure than 0.7; a name of car or quantity is enough not to be."""
    time = np.arange(0.0, 5.0, 0.01)
    for title, sure in (("x", False), ("a_x", True), ("vehicle x", True)):
        [one] = guessed(held({title: ("m/s^2", np.sin(time))})).chosen.values()
        assert one.channel == "chassis.a_x"
        assert (one.confidence >= 0.7) is sure


def test_of_a_file_too_large_only_what_may_be_a_channel_is_read(monkeypatch):
    time = np.arange(0.0, 5.0, 0.01)
    table = held({"Time": ("s", time), "oil": ("bar", time), "heave": ("mm", np.sin(time))})
    assert sorted(survey(table).known) == [0, 1, 2]
    monkeypatch.setattr("ridetune.engine.mapping.survey.MOST_SURVEYED", 1499)
    assert sorted(survey(table).known) == [0, 2]


def test_a_template_that_fits_is_proposed_in_place_of_the_guess():
    table = renamed(truth(), SCHEMES["German"])
    other = ChannelMapping((MappedColumn("Nickwinkel", "chassis.roll", "deg", sign=-1),))
    missing = ChannelMapping((MappedColumn("not there", "chassis.roll", "mrad"),))
    found = survey(table).with_templates({"a": missing, "b": other})
    assert (found.template, found.guess.mapping) == ("b", other)
    [one] = found.guess.chosen.values()
    assert (one.channel, one.unit, one.sign, one.reason) == ("chassis.roll", "deg", -1, "template")
    assert survey(table).with_templates({"a": missing}).template == ""


def test_a_template_in_another_unit_than_the_file_states_is_doubted():
    """The template comes from a file in mm; spellings of a unit are no other unit."""
    time = np.arange(0.0, 5.0, 0.01)
    entries = (
        MappedColumn("z", "chassis.z", "mm"),
        MappedColumn("ax", "chassis.a_x", "m/s^2"),
        MappedColumn("roll", "chassis.roll", "deg"),
    )
    table = held(
        {
            "z": ("cm", 2.0 * np.sin(time)),
            "ax": ("m|s2", np.sin(time)),
            "roll": ("", np.sin(time)),
        }
    )
    found = survey(table).with_templates({"mm": ChannelMapping(entries)})
    doubted = [(one.doubted, one.confidence < 1.0) for one in found.guess.chosen.values()]
    assert doubted == [(True, True), (False, False), (False, False)]
    [said] = found.warnings
    assert said.startswith("z is in cm by the file, but the template takes chassis.z in mm")
    same = replace(entries[0], unit="cm")
    assert not survey(table).with_templates({"cm": ChannelMapping((same,))}).warnings
