import math
from dataclasses import replace

import numpy as np
import pytest
from ridetune.engine.errors import MeasurementError
from ridetune.engine.run import Run
from ridetune.engine.run_notes import (
    checked_noise,
    doubtful_noise,
    notes_of,
    parse_notes,
    read_notes,
)
from ridetune.engine.step_record import StepRecord
from ridetune.engine.toml_text import LARGEST_FILE


def test_notes_state_noise_and_description():
    notes = parse_notes(
        b'description = "Monday"\nvehicle = "Escort"\nplant = "detailed"\n'
        b'[noise]\n"chassis.z" = 0.0005\n',
        "r.toml",
    )
    assert notes.description == "Monday"
    assert (notes.vehicle, notes.plant) == ("Escort", "detailed")
    assert notes.noise == {"chassis.z": 0.0005}


def test_quotes_around_a_channel_may_be_left_off():
    text = b"[noise]\nchassis.z = 5e-4\nchassis.a_x = 1\nwheel.fl.z = 1e-3\r\n"
    noise = {"chassis.z": 5e-4, "chassis.a_x": 1.0, "wheel.fl.z": 1e-3}
    assert parse_notes(text, "r.toml").noise == noise


def test_empty_notes_state_nothing():
    assert parse_notes(b"", "r.toml").noise == {}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"[noise", "r.toml: not valid TOML (Expected ']'"),
        (b"a=1\xff", "r.toml: not UTF-8 text (byte 4); save it as TOML in UTF-8."),
        (b"a=" + b"[" * 100_000, "r.toml: nested too deeply"),
        (b"[a.b]\n[a.b]\n", "r.toml: not valid TOML (Cannot declare [a.b] twice (at line 2"),
        (b"[noise]\n" + b"a." * 5000 + b"b = 1", "r.toml: line 2 has more than 200 dots"),
        (b" " * (LARGEST_FILE + 1), "r.toml: larger than 1 MB"),
        (b"[nosie]\na = 1", "r.toml: nosie is not known; did you mean noise?"),
        (b"noise = 3", "r.toml: noise must be a table"),
        (b"description = 3", "r.toml: description must be a text"),
        (b"vehicle = 3", "r.toml: vehicle must be a text"),
        (b'[noise]\n"chassis.zz" = 1', "did you mean chassis.z?"),
        (b'[noise]\n"chassis.z" = -1', "noise of chassis.z is -1; give a positive number in m"),
        (b'[noise]\n"chassis.z" = 1' + b"0" * 400, "noise of chassis.z is 1000"),
        (b'[noise]\n"chassis.z" = 2026-01-01', "noise of chassis.z is no number; give a pos"),
        (b"a = \0", "r.toml: not valid TOML (Invalid value"),
        (b'a = "\0"', "Illegal character 'U+0000'"),
        (b'[noise]\n"chassis.z" = "1 mm"', "noise of chassis.z is '1 mm'; give a positive"),
        (b'[noise]\n"chassis.z" = true', "noise of chassis.z is true; give a positive"),
        (b'[noise]\n"chassis.z" = nan', "noise of chassis.z is nan; give a positive"),
        (b'[noise]\n"chassis.roll" = 0', "noise of chassis.roll is 0; give a positive"),
        (b'[noise]\n"chassis.z" = 1e-200', "give a positive number in m, from 1e-12 to 1e+12."),
        (b'[noise]\n"chassis.z" = 1e13', "give a positive number in m, from 1e-12 to 1e+12."),
    ],
)
def test_a_fault_in_the_notes_is_named(text, message):
    with pytest.raises(MeasurementError) as caught:
        parse_notes(text, "r.toml")
    assert str(caught.value).startswith("r.toml: ")
    assert message in str(caught.value)


def test_notes_that_are_not_there_are_named(tmp_path):
    with pytest.raises(MeasurementError, match=r"r\.toml: cannot be read"):
        read_notes(tmp_path / "r.toml")


@pytest.mark.parametrize(
    ("name", "stated", "doubted"),
    [
        ("chassis.z", 0.0005, False),
        ("chassis.z", 0.5, True),  # mm
        ("chassis.pitch", math.radians(0.02), False),
        ("chassis.pitch", 0.02, True),  # deg
        ("chassis.roll", math.radians(0.02), False),  # nothing but noise
        ("chassis.a_x", 0.3, False),  # a poor sensor, but the car brakes
    ],
)
def test_noise_in_the_wrong_unit_is_doubted_by_name(name, stated, doubted):
    """Oracle: by hand; a car bounces by 5 mm and 0.3 deg, sensors err by 0.5 mm and 0.02 deg."""
    time = np.linspace(0.0, 20.0, 2001)
    values = {
        "chassis.z": 0.005 * np.sin(8.0 * time),
        "chassis.pitch": math.radians(0.3) * np.sin(9.0 * time),
        "chassis.roll": np.random.default_rng(2).normal(scale=math.radians(0.02), size=time.size),
        "chassis.a_x": np.where(time > 10.0, -4.0, 0.0),
    }
    warnings = doubtful_noise({name: stated}, values)
    assert len(warnings) == doubted
    assert all(f"noise of {name}, {stated:g}" in warning for warning in warnings)


def test_noise_given_otherwise_is_checked_the_same_way():
    with pytest.raises(MeasurementError, match="run: noise of chassis.z is 0.0"):
        checked_noise({"chassis.z": 0.0}, "run")


def test_what_conditioning_did_goes_into_notes_and_back():
    """Quotes, backslashes and a channel's dots in the keys among it."""
    record = StepRecord(
        {"kind": "rest", "channels": ["chassis.z"], "interval": [0.0, 1.5]},
        ("chassis.z",),
        {"offset.chassis.z": -1.25e-3, "begin_s": 0.0},
        (0.3, None),
        ('Took "off" a \\ and é.', "Another."),
        ("It drifts.",),
    )
    run = Run("r", [0.0, 1.0], {"chassis.z": [0.0, 1.0]}, {"chassis.z": 1e-4}, (), 'a "b"')
    done = replace(run, conditioning=(record,) * 2, vehicle="Escort", plant="concept")
    notes = parse_notes(notes_of(done).encode(), "r.toml")
    assert (notes.vehicle, notes.plant) == ("Escort", "concept")
    assert notes.conditioning == (record, record)
    assert (notes.noise, notes.description) == ({"chassis.z": 1e-4}, 'a "b"')


def test_a_record_of_conditioning_that_is_none_is_refused():
    with pytest.raises(MeasurementError, match="^r.toml: conditioning must be a list of what was"):
        parse_notes(b"conditioning = 3", "r.toml")
