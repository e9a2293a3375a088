"""Files of sensors: what they say, and how mistakes are told."""

import json
import math
import re

import pytest
from ridetune.engine.errors import MeasurementError
from ridetune.engine.sensor_file import check_sensors, noisy, read_sensors, sensors_from_json
from ridetune.engine.sensors import RECORDED, Sensor, SensorSet

DOCUMENTED = """
rate_hz = 100
[points]
"point.boot" = [-1.5, 0, 0.2]
[sensors."wheel.{corner}.z"]
noise = 0.0005
rate_hz = 50
cutoff_hz = 20
[sensors."wheel.rr.z"]
[sensors.point.boot.a_z]
bias = 0.02
"""


def check(data, duration=20.0):
    sensors, offered = sensors_from_json(data, "s.toml"), {*RECORDED, "point.boot.a_z"}
    check_sensors(sensors, car="concept", step=0.0025, duration=duration, offered=offered)


def test_a_file_is_read_with_and_without_quotes_and_a_later_line_goes_before(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(DOCUMENTED)
    wheel = Sensor(noise=0.0005, rate_hz=50.0, cutoff_hz=20.0)
    named = {f"wheel.{corner}.z": wheel for corner in ("fl", "fr", "rl")}
    expected = SensorSet(
        100.0,
        {**named, "wheel.rr.z": Sensor(), "point.boot.a_z": Sensor(bias=0.02)},
        {"point.boot": (-1.5, 0.0, 0.2)},
        "s.toml",
    )
    assert read_sensors(path) == expected
    path.write_text(
        json.dumps(
            {
                "rate_hz": 100,
                "points": {"point.boot": [-1.5, 0, 0.2]},
                "sensors": {
                    "wheel.{corner}.z": {"noise": 0.0005, "rate_hz": 50, "cutoff_hz": 20},
                    "wheel.rr.z": {},
                    "point.boot.a_z": {"bias": 0.02},
                },
            }
        )
    )
    assert read_sensors(path) == expected


def test_without_sensors_the_usual_ones_are_ideal():
    assert sensors_from_json({"rate_hz": 50}) == SensorSet(50.0)
    assert list(SensorSet().sensors) == list(RECORDED)
    assert set(SensorSet().sensors.values()) == {Sensor()}


def test_noise_is_told_in_the_sensor_s_unit():
    """Oracle: 0.5 mm = 5e-4 m, 0.02 deg = pi / 9000 rad."""
    data = {"chassis.z": {"unit": "mm", "noise": 0.5}, "chassis.roll": {"unit": "°", "noise": 0.02}}
    found = sensors_from_json({"sensors": data})
    assert found.noise() == pytest.approx({"chassis.z": 5e-4, "chassis.roll": math.pi / 9000})
    assert found.units() == {"chassis.z": "mm", "chassis.roll": "°"}
    spaced = sensors_from_json({"sensors": {"chassis.a_x": {"unit": "mm \n s^-2"}}})
    assert spaced.units() == {"chassis.a_x": "mm s^-2"}


def test_noise_alone_is_a_set_of_the_usual_sensors():
    found = noisy({"chassis.z": 1e-3}, "n.toml")
    assert found.noise() == {"chassis.z": 1e-3}
    assert list(found.sensors) == list(RECORDED)
    with pytest.raises(MeasurementError, match=r"n\.toml: noise is stated of chassis.x, which is"):
        noisy({"chassis.x": 1e-3}, "n.toml")


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ([], "s.toml: must be an object {...}, not a list"),
        ({"rate": 100}, 's.toml: rate is not known; did you mean "rate_hz"?'),
        ({"rate_hz": 0}, "s.toml: rate_hz is 0, but must lie between 1 and 100000 Hz"),
        ({"rate_hz": 500}, "rate_hz is 500, but the concept car is simulated in steps of 2.5 ms"),
        ({"sensors": {}}, "sensors lists 0 channels"),
        ({"sensors": 3}, "sensors must be a table, not 3"),
        ({"sensors": {"chassis.zz": {}}}, "sensors.chassis.zz is not known"),
        ({"sensors": {"chasis.z": {}}}, "did you mean chassis.z?"),
        ({"sensors": {"time": {}}}, "sensors.time is always recorded"),
        ({"sensors": {"chassis.z": 1}}, "sensors.chassis.z must be an object {...}, not 1"),
        ({"sensors": {"chassis.z": {"nose": 1}}}, 'z.nose is not known; did you mean "noise"?'),
        ({"sensors": {"chassis.z": {"noise": -1}}}, "chassis.z.noise is -1, but must lie between"),
        ({"sensors": {"chassis.z": {"noise": float("nan")}}}, "noise is nan, but must lie between"),
        ({"sensors": {"chassis.z": {"gain": 0}}}, "chassis.z.gain is 0, but must lie between"),
        ({"sensors": {"chassis.z": {"delay": -0.1}}}, "delay is -0.1, but must lie between 0 and"),
        ({"sensors": {"chassis.z": {"rate_hz": 300}}}, "more than the recording's rate_hz of 200"),
        ({"sensors": {"chassis.z": {"cutoff_hz": 100}}}, "take less than 100, or leave the filter"),
        ({"sensors": {"chassis.z": {"unit": "deg"}}}, "sensors.chassis.z.unit cannot be: "),
        ({"sensors": {"chassis.z": {"unit": "mn"}}}, "sensors.chassis.z.unit cannot be: "),
        ({"sensors": {"chassis.z": {"resolution": -1}}}, "resolution is -1, but must lie between"),
        ({"sensors": {"chassis.body_a_z": {}}}, "chassis.body_a_z is what raw instruments record"),
        ({"sensors": {"wheel.fl.a_z": {}}}, "or an accelerometer at a point"),
        ({"sensors": {"post.fl.z": {}}}, "post.fl.z is nothing that the concept car on a road has"),
        ({"sensors": {"seat.rear.a_z": {}}}, "add points.seat.rear = [x, y, z] in metres"),
        ({"points": {"boot": [0, 0, 0]}}, 'points.boot must be called "seat.NAME" or "point.NAME"'),
        ({"points": {"point.boot": [0, 0]}}, "points.point.boot has 2 values, but must have 3"),
        ({"points": {"point.boot": [0, 0, 99]}}, "but must lie between -20 and 20 m"),
    ],
)
def test_a_mistake_is_named_with_the_remedy(data, sentence):
    with pytest.raises(MeasurementError, match=re.escape(sentence)):
        check(data)


def test_a_delay_as_long_as_the_run_is_refused():
    data = {"sensors": {"chassis.z": {"delay": 6.0}}}
    check(data)
    with pytest.raises(MeasurementError, match="delay is 6 s, as long as a run of 6 s; shorten it"):
        check(data, duration=6.0)


def test_a_rate_that_leaves_one_sample_is_refused():
    """Oracle: a recording begins with a sample, and the next comes 1/rate later."""
    check({"rate_hz": 2}, duration=0.5)
    with pytest.raises(MeasurementError, match=r"rate_hz is 2, .* of 0\.4 s one sample; take 2\.5"):
        check({"rate_hz": 2}, duration=0.4)


def test_a_file_that_cannot_be_read_is_refused(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text("rate_hz = ")
    with pytest.raises(MeasurementError, match=r"s\.toml: not valid TOML"):
        read_sensors(path)
    path.write_text('{"rate_hz": 100, "rate_hz": 200}')
    with pytest.raises(MeasurementError, match=r"s\.toml: rate_hz is given twice; keep one"):
        read_sensors(path)
    path.write_text("[sensors]\n" + "a." * 100 + "b = {}")
    with pytest.raises(
        MeasurementError, match=r"s\.toml: sensors\.a\.\S+ is nested deeper than any"
    ):
        read_sensors(path)
    with pytest.raises(MeasurementError, match=r"gone\.toml: cannot be read \(No such file"):
        read_sensors(tmp_path / "gone.toml")
