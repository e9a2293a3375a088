"""Which column is which channel. Oracle throughout: a table made of channels that are known."""

import io
from dataclasses import replace

import numpy as np
import pytest
from ridetune.engine.formats.csv_file import CsvFile
from ridetune.engine.formats.table import Column, HeldTable
from ridetune.engine.frames import CORNERS
from ridetune.engine.mapping.apply import apply
from ridetune.engine.mapping.mapping import ChannelMapping, MappedColumn
from ridetune.engine.mapping.survey import survey

from .mapped_tables import guessed, held, renamed, truth

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
