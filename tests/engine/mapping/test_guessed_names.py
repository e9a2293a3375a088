"""Which channel a header alone tells, and which way. Oracle: headers of channels that are known."""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ridetune.engine.channels import CHANNELS, channel
from ridetune.engine.formats.table import Column
from ridetune.engine.frames import CORNERS
from ridetune.engine.mapping.guess import THRESHOLD, guess

from .mapped_tables import guessed_name, proposed

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


WHEEL, BODY = ("wheel", "whl", "rim", "rad"), ("body", "chassis", "aufbau")
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
