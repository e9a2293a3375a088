import pytest
from ridetune.engine.channels import CHANNELS, channel, find_channel
from ridetune.engine.errors import MeasurementError
from ridetune.engine.units import to_si

DOCUMENTED = """
time s
chassis.z m
chassis.pitch rad
chassis.roll rad
chassis.a_x m/s^2
chassis.v_x m/s
chassis.a_z chassis.body_a_x chassis.body_a_y chassis.body_a_z m/s^2
wheel.fl.a_z m/s^2
wheel.rr.speed m/s
chassis.x m
wheel.fl.z wheel.fr.z wheel.rl.z wheel.rr.z m
tyre.rl.load N
suspension.fl.travel m
suspension.rr.spring_force suspension.fl.damper_force N
arm.fr.angle rad
road.fl.z m
drive.rl.torque brake.fl.torque N m
post.rr.z m
chassis.z_rate m/s
chassis.pitch_rate chassis.roll_rate rad/s
seat.driver.a_z m/s^2
stabilizer_bar.front.torque stabilizer_bar.rear.torque N m
mount.fl.force_x mount.fl.force_z pivot.rr.force_x pivot.rr.force_z N
"""
"""The table of channels as documented: names, then the SI unit."""


def test_every_documented_channel_has_its_documented_unit():
    for line in DOCUMENTED.strip().splitlines():
        words = line.split()
        names = [word for word in words if "." in word or word == "time"]
        for name in names:
            assert channel(name).unit == " ".join(words[len(names) :])


@pytest.mark.parametrize("info", CHANNELS.values(), ids=lambda info: info.name)
def test_a_channel_is_shown_in_a_unit_of_its_quantity(info):
    factor, offset = to_si(info.display_unit, info.unit)
    assert (factor * info.display_factor, offset) == (pytest.approx(1.0, rel=1e-12), 0.0)


def test_a_channel_of_a_corner_names_the_corner():
    assert channel("tyre.rl.load").label == "Rear left tyre load"
    assert channel("stabilizer_bar.front.torque").label == "Front stabilizer bar torque"
    assert len({info.label for info in CHANNELS.values()}) == len(CHANNELS)


def test_accelerations_at_the_user_s_own_points_are_channels():
    info = channel("seat.rear_left.a_z")
    assert (info.unit, info.sign) == ("m/s^2", "up")
    assert "rear left seat" in info.label


@pytest.mark.parametrize("name", ["seat.driver.a_w", "seat.a_z", "wheel.fl", "chassis", "", "Time"])
def test_other_names_are_no_channels(name):
    assert find_channel(name) is None


@pytest.mark.parametrize(
    ("name", "near"),
    [("chassis.pich", "chassis.pitch"), ("wheel_FL_z", "wheel.fl.z"), ("Time", "time")],
)
def test_a_misspelt_channel_is_answered_with_the_nearest(name, near):
    with pytest.raises(MeasurementError, match=f"did you mean {near}"):
        channel(name)


def test_an_unlike_name_gets_no_wrong_hint():
    with pytest.raises(MeasurementError, match="see the table of channels"):
        channel("temperature")
