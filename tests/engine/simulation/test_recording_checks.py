from pathlib import Path

import numpy as np
import pytest
from ridetune.engine.channels import INPUT_CHANNELS, WHEEL_CHANNELS
from ridetune.engine.measurement import read_run
from ridetune.engine.run import Run
from ridetune.engine.simulation.recording_checks import check_on_car, check_recording, stands
from ridetune.engine.simulation.wheel_order import wheel_rises

from ...factories import paper_vehicle

CAR = paper_vehicle()
SAMPLES = Path(__file__).parents[3] / "sample_runs"

TIME = np.arange(0.0, 10.0, 0.005)
PULL_AWAY = np.where((TIME > 2.0) & (TIME < 6.0), 2.0, 0.0)
SPEED = 2.0 * np.clip(TIME - 2.0, 0.0, 4.0)


def run(time=TIME, **changed):
    zero = np.zeros_like(time)
    return Run("lap", time, {**dict.fromkeys(INPUT_CHANNELS, zero), **changed})


def findings(recording):
    on_car = check_on_car(recording, stands(recording), wheel_rises(recording), CAR)
    return [*check_recording(recording), *on_car]


def test_a_clean_recording_gives_no_finding():
    assert findings(run(**{"chassis.a_x": PULL_AWAY, "chassis.v_x": SPEED})) == []


def test_rest_values_are_named_with_their_size():
    [finding] = findings(run(**{"chassis.z": 0.012 + 0 * TIME, "wheel.rr.z": -0.03 + 0 * TIME}))
    assert "lap" in finding.sentence
    assert "chassis.z reads 12 instead of -7.3" in finding.sentence
    assert not finding.fault


def test_a_car_that_stands_on_uneven_ground_has_no_rest_value():
    """Oracle: a rigid car on four wheels, the front ones 20 mm higher than the rear ones."""
    front = 0.02 + 0 * TIME
    nose_up = -0.02 / CAR.wheelbase
    body = {"chassis.z": -nose_up * CAR.rear.cg_distance, "chassis.pitch": nose_up}
    uneven = {"wheel.fl.z": front, "wheel.fr.z": front}
    recorded = {name: value + 0 * TIME for name, value in body.items()}
    assert findings(run(**uneven, **recorded)) == []
    assert findings(run(**uneven)) == []
    [finding] = findings(run(**uneven, **{"chassis.pitch": 0 * TIME}))
    assert "chassis.pitch reads 0 instead of -0.431 deg" in finding.sentence


def test_a_spike_in_what_drives_the_model_is_a_fault():
    spiked = np.zeros_like(TIME)
    spiked[800] = 0.1
    [finding] = findings(run(**{"wheel.rl.z": spiked}))
    assert "wheel.rl.z jumps to 100 mm" in finding.sentence
    assert finding.fault


def test_a_car_that_rolls_at_the_start_has_no_rest_value():
    shaken = 0.01 * np.sin(20.0 * TIME)
    assert findings(run(**{"wheel.fl.z": shaken, "chassis.z": 0.02 + 0 * TIME})) == []
    rolling = {"chassis.v_x": 10.0 + 0 * TIME, "chassis.z": 0.02 + 0 * TIME}
    assert findings(run(**rolling)) == []


def test_acceleration_against_the_change_of_speed_is_a_fault():
    [finding] = findings(run(**{"chassis.a_x": -PULL_AWAY, "chassis.v_x": SPEED}))
    assert "multiply chassis.a_x by -1" in finding.sentence
    assert finding.fault


def test_a_speed_recorded_backwards_leaves_what_drives_the_model_alone():
    [finding] = findings(run(**{"chassis.a_x": PULL_AWAY, "chassis.v_x": -SPEED}))
    assert "multiply chassis.v_x by -1" in finding.sentence
    assert not finding.fault


@pytest.mark.parametrize(
    ("channel", "factor", "numbers", "header", "fault"),
    [
        ("chassis.a_x", 1 / 9.80665, "g", "m/s^2", True),
        ("chassis.a_x", 9.80665, "m/s^2", "g", True),
        ("chassis.v_x", 3.6, "km/h", "m/s", False),
        ("chassis.v_x", 1 / 3.6, "m/s", "km/h", False),
    ],
)
def test_a_mistaken_unit_of_acceleration_or_speed_is_named(channel, factor, numbers, header, fault):
    """Oracle: the unit's factor. Rolling resistance alone depends on v_x, and on its sense only."""
    channels = {"chassis.a_x": PULL_AWAY, "chassis.v_x": SPEED}
    [finding] = findings(run(**{**channels, channel: factor * channels[channel]}))
    assert f"{channel} are probably in {numbers} under a header that says {header}" in (
        finding.sentence
    )
    assert finding.fault == fault


def test_a_factor_that_is_no_unit_s_is_told_of_without_a_guess():
    [finding] = findings(run(**{"chassis.a_x": PULL_AWAY / 60.0, "chassis.v_x": SPEED}))
    assert "check the units of both" in finding.sentence
    assert not finding.fault


def test_a_noisy_speed_says_nothing_of_a_x():
    """A satellite's speed at 15 m/s, ten times a second, beside an a_x at rest."""
    rng = np.random.default_rng(2)
    received = np.arange(0.0, 10.0, 0.1)
    speed = np.interp(TIME, received, 15.0 + 0.2 * rng.normal(size=received.size))
    assert (
        findings(run(**{"chassis.a_x": 0.02 * rng.normal(size=TIME.size), "chassis.v_x": speed}))
        == []
    )


def test_a_constant_offset_of_a_x_is_not_a_wrong_unit():
    moving = {"chassis.a_x": PULL_AWAY + 0.09, "chassis.v_x": SPEED}
    assert findings(run(**moving)) == []


def test_a_hole_in_the_record_is_found_with_its_place():
    time = np.concatenate([np.arange(0.0, 4.0, 0.005), np.arange(4.8, 10.0, 0.005)])
    [finding] = findings(run(time))
    assert "between 3.99 and 4.80 s" in finding.sentence or "4.00 and 4.80 s" in finding.sentence
    assert not finding.fault


def test_one_wheel_turned_over_is_found_by_its_neighbour():
    road = 0.02 * np.sin(2.0 * TIME)
    wheels = {name: road for name in INPUT_CHANNELS if name.startswith("wheel")}
    assert findings(run(**wheels)) == []
    [finding] = findings(run(**{**wheels, "wheel.rl.z": -road}))
    assert "wheel.rl.z and wheel.rr.z" in finding.sentence
    assert finding.fault


def test_wheels_that_hardly_move_slowly_turn_none_over():
    """A sine road whose right track lies half a wave behind: 5 Hz, and slowly nothing."""
    fast = 0.01 * np.sin(2 * np.pi * 5.0 * TIME)
    wheels = {name: fast for name in INPUT_CHANNELS if name.startswith("wheel")}
    assert findings(run(**{**wheels, "wheel.rl.z": -fast})) == []


def test_a_rig_that_rolls_the_car_turns_no_wheel_over():
    road = 0.02 * np.sin(2.0 * TIME)
    left = {"wheel.fl.z": road, "wheel.rl.z": road}
    assert findings(run(**left, **{"wheel.fr.z": -road, "wheel.rr.z": -road})) == []


@pytest.mark.parametrize("path", sorted(SAMPLES.glob("**/*.csv")), ids=lambda path: path.stem)
def test_wheels_a_thousand_times_too_small_are_a_fault_of_every_shipped_recording(path):
    """Oracle: the recordings as they are, on rough roads, over a bump and braking, and with mm for
    the wheels' m.
    """
    shipped = read_run(path)
    assert not [one for one in check_recording(shipped) if one.fault]
    channels = {name: shipped[name] for name in shipped.columns}
    channels |= {name: 1e-3 * shipped[name] for name in WHEEL_CHANNELS}
    [finding] = check_recording(run(shipped.time, **channels))
    assert finding.fault
    assert "go with the wheels" in finding.sentence
    assert "unit of the wheel.*.z is probably wrong" in finding.sentence


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_car_that_dives_on_a_flat_road_has_no_mistaken_unit(noise):
    """The body moves by hundreds of times what the wheels' sensors are noisy by."""
    rng = np.random.default_rng(4)
    dive = np.convolve(np.where((TIME > 3.0) & (TIME < 7.0), -8.0, 0.0), np.ones(40) / 40, "same")
    wheels = {name: noise * rng.standard_normal(TIME.size) for name in WHEEL_CHANNELS}
    body = {"chassis.z": 0.003 * dive, "chassis.pitch": -0.005 * dive}
    assert findings(run(**wheels, **body, **{"chassis.a_x": dive})) == []


def test_a_rig_moves_wheels_as_much_as_the_body():
    post = 0.02 * np.sin(2.0 * TIME)
    wheels = dict.fromkeys(WHEEL_CHANNELS, post)
    assert findings(run(**wheels, **{"chassis.z": 3.0 * post})) == []
