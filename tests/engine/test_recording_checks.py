import numpy as np
from ridetune.engine.channels import INPUT_CHANNELS, Run
from ridetune.engine.recording_checks import check_recording

TIME = np.arange(0.0, 10.0, 0.005)
PULL_AWAY = np.where((TIME > 2.0) & (TIME < 6.0), 2.0, 0.0)
SPEED = 2.0 * np.clip(TIME - 2.0, 0.0, 4.0)


def run(time=TIME, **changed):
    zero = np.zeros_like(time)
    return Run("lap", time, {**dict.fromkeys(INPUT_CHANNELS, zero), **changed})


def test_a_clean_recording_gives_no_finding():
    assert check_recording(run(**{"chassis.a_x": PULL_AWAY, "chassis.v_x": SPEED})) == []


def test_rest_values_are_named_with_their_size():
    [finding] = check_recording(
        run(**{"chassis.z": 0.012 + 0 * TIME, "wheel.rr.z": -0.03 + 0 * TIME})
    )
    assert "lap" in finding
    assert "chassis.z 12 mm" in finding
    assert "wheel.rr.z -30 mm" in finding


def test_a_car_that_rolls_at_the_start_has_no_rest_value():
    shaken = 0.01 * np.sin(20.0 * TIME)
    assert check_recording(run(**{"wheel.fl.z": shaken, "chassis.z": 0.02 + 0 * TIME})) == []
    rolling = {"chassis.v_x": 10.0 + 0 * TIME, "chassis.z": 0.02 + 0 * TIME}
    assert check_recording(run(**rolling)) == []


def test_acceleration_against_the_change_of_speed_is_found():
    [finding] = check_recording(run(**{"chassis.a_x": -PULL_AWAY, "chassis.v_x": SPEED}))
    assert "chassis.a_x" in finding
    assert "-1" in finding


def test_acceleration_in_g_beside_speed_in_metres_a_second_is_found():
    [finding] = check_recording(run(**{"chassis.a_x": PULL_AWAY / 9.80665, "chassis.v_x": SPEED}))
    assert "9.81 times" in finding


def test_a_constant_offset_of_a_x_is_not_a_wrong_unit():
    moving = {"chassis.a_x": PULL_AWAY + 0.09, "chassis.v_x": SPEED}
    assert check_recording(run(**moving)) == []


def test_a_hole_in_the_record_is_found_with_its_place():
    time = np.concatenate([np.arange(0.0, 4.0, 0.005), np.arange(4.8, 10.0, 0.005)])
    [finding] = check_recording(run(time))
    assert "between 3.99 and 4.80 s" in finding or "between 4.00 and 4.80 s" in finding


def test_one_wheel_turned_over_is_found_by_its_neighbour():
    road = 0.02 * np.sin(2.0 * TIME)
    wheels = {name: road for name in INPUT_CHANNELS if name.startswith("wheel")}
    assert check_recording(run(**wheels)) == []
    [finding] = check_recording(run(**{**wheels, "wheel.rl.z": -road}))
    assert "wheel.rl.z and wheel.rr.z" in finding


def test_a_rig_that_rolls_the_car_turns_no_wheel_over():
    road = 0.02 * np.sin(2.0 * TIME)
    left = {"wheel.fl.z": road, "wheel.rl.z": road}
    assert check_recording(run(**left, **{"wheel.fr.z": -road, "wheel.rr.z": -road})) == []
