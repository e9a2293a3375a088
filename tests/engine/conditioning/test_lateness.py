"""A speed that comes late, as pitch tells it. Oracles: the drive simulated, and a closed form."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from ridetune.engine.conditioning.chain import condition
from ridetune.engine.conditioning.lateness import find_lateness
from ridetune.engine.conditioning.motion import Angles, Speed
from ridetune.engine.conditioning.suggestion import suggest
from ridetune.engine.filters import in_band
from ridetune.engine.run import Run
from ridetune.engine.simulation.rims import prepare
from scipy.interpolate import CubicSpline

from ...factories import paper_vehicle
from ...raw_sensors import drive, recorded

CAR = paper_vehicle()
STEP = 0.005
PULLS = ("2", "brake-54")
"""Manoeuvres in which the car accelerates, and brakes."""


STEADY = ("bump", "coast", "constant-speed-c")
"""Manoeuvres whose speed tells little."""


@pytest.fixture(scope="module")
def drives():
    return {key: drive(CAR, key, STEP) for key in ("1", *PULLS, *STEADY)}


def conditioned(raw, *, without=()):
    steps = [step for step in suggest(raw, CAR).steps if step.kind not in without]
    return condition(raw, steps, CAR)


def warnings(run):
    return [warning for record in run.conditioning for warning in record.warnings]


def lag_error(driven):
    """Standard deviation of a lag that is fitted to a noisy speed's slope below 2 Hz, s.

    A shift d of a(t) is d a'(t), so var(d) = S / 2 / integral of a'^2 for noise of the one-sided
    density S. A speed's white noise s has 2 h s^2 (2 pi f)^2, most at 2 Hz; the accelerometer's
    is some hundredth of it.
    """
    density = 2.0 * STEP * 0.02**2 * (2.0 * math.pi * 2.0) ** 2
    jerk = CubicSpline(driven.time, in_band(driven.time, driven["chassis.a_x"], (0.3, 2.0)))
    return math.sqrt(density / 2.0 / (STEP * np.sum(jerk(driven.time, 1) ** 2)))


@pytest.mark.parametrize("key", PULLS)
@pytest.mark.parametrize("late", [0.12, 0.35, 0.5, -0.2])
def test_a_late_speed_is_told_with_its_lag_and_what_it_does_to_the_pitch(drives, key, late):
    """The lag within four standard deviations; the pitch's error, of which the noise is 0.1 deg.

    A filter at 0.2 Hz or a little above turns an error of the lag into a share of the change.
    """
    driven = drives[key]
    made = conditioned(recorded(CAR, driven, seed=1, delay=late), without=("delay",))
    [warning] = warnings(made)
    change, begin, end, lag, way, by = re.fullmatch(
        r"chassis.pitch changes by ([\d.]+) deg while the car \D+ from ([\d.]+) to ([\d.]+) s: "
        r"chassis.v_x seems ([\d.]+) ± [\d.]+ s (\w+) against chassis.body_a_x and the gyro; put a "
        r"delay step of chassis.v_x by (-?[\d.]+) s before the speed step.",
        warning,
    ).groups()
    assert way == ("late" if late > 0.0 else "early")
    tolerance = 4.0 * lag_error(driven)
    assert tolerance < 0.02
    assert float(by) == pytest.approx(late, abs=tolerance)
    assert float(lag) == abs(float(by))
    off = np.degrees(
        made["chassis.pitch"] - CubicSpline(driven.time, driven["chassis.pitch"])(made.time)
    )
    first, last = np.searchsorted(made.time, [float(begin), float(end)])
    assert abs(off[last] - off[first]) == pytest.approx(float(change), rel=0.06, abs=0.2)
    assert any(warning in one for one in prepare(made, CAR).warnings)


@pytest.mark.parametrize("key", PULLS)
@pytest.mark.parametrize("seed", [0, 1])
def test_the_suggested_chain_takes_the_lag_off(drives, key, seed):
    """What is left of the pitch's error: what there is without a lag, and what four standard
    deviations of the lag leave of it, away from the ends, where half a crossover's period counts.
    """
    driven, late = drives[key], 0.35

    def error(raw, **chosen):
        made = conditioned(raw, **chosen)
        off = made["chassis.pitch"] - CubicSpline(driven.time, driven["chassis.pitch"])(made.time)
        inner = (made.time > 2.0) & (made.time < driven.time[-1] - 2.0 - late)
        return np.std(off[inner])

    raw = recorded(CAR, driven, seed=seed, delay=late)
    suggestion = suggest(raw, CAR)
    [delay] = [step for step in suggestion.steps if step.kind == "delay"]
    kinds = [step.kind for step in suggestion.steps]
    assert kinds.index("delay") < kinds.index("rest")
    assert delay.channel == "chassis.v_x"
    assert delay.seconds == pytest.approx(late, abs=4.0 * lag_error(driven))
    [reason] = [one for one in suggestion.reasons if one.startswith("delay: ")]
    assert f"chassis.v_x seems {delay.seconds:.3f} ± " in reason
    assert warnings(conditioned(raw)) == []
    share = 4.0 * lag_error(driven) / late
    untouched = error(recorded(CAR, driven, seed=seed))
    spoilt = error(raw, without=("delay",))
    assert spoilt > np.radians(1.0)
    assert error(raw) < 2.0 * untouched + share * spoilt


@pytest.mark.parametrize("key", ["1", *PULLS, *STEADY])
@pytest.mark.parametrize("seed", [None, 0, 1, 2])
def test_nothing_is_told_of_a_speed_in_time(drives, key, seed):
    raw = recorded(CAR, drives[key], seed=seed)
    assert "delay" not in [step.kind for step in suggest(raw, CAR).steps]
    assert warnings(conditioned(raw)) == []


@pytest.mark.parametrize("key", [*PULLS, *STEADY])
def test_a_speed_held_ten_times_a_second_is_half_of_that_late_or_tells_nothing(drives, key):
    driven = drives[key]
    raw = recorded(CAR, driven, seed=0)
    held = raw["chassis.v_x"][np.arange(driven.time.size) // 20 * 20]
    raw = replace(raw, channels={**raw.channels, "chassis.v_x": held})
    late = [step.seconds for step in suggest(raw, CAR).steps if step.kind == "delay"]
    if key in PULLS:
        assert late == [pytest.approx(0.05, abs=4.0 * lag_error(driven))]
    else:
        assert late == []


def test_a_car_that_keeps_no_speed_is_said_to_drive():
    """Oracle: it brakes at 2 to 4 m/s2 all the time, its speed 0.4 s late; the road is level."""
    time = np.arange(0.0, 30.0, 0.01)
    slow = 2.0 * np.pi * 0.3
    a_x = -3.0 + np.sin(slow * time)
    late = time - 0.4
    channels = {
        "chassis.body_a_x": a_x,
        "chassis.pitch_rate": np.zeros(time.size),
        "chassis.v_x": 100.0 - 3.0 * late - np.cos(slow * late) / slow,
    }
    found = find_lateness(condition(Run("r", time, channels), [Speed(acceleration=True)]), 0.2)
    assert found is not None
    assert found.lag.seconds == pytest.approx(0.4, abs=0.02)
    assert "while the car drives from" in found.warning


def test_an_acceleration_that_is_recorded_late_is_named_itself(drives):
    driven = drives["2"]
    raw = recorded(CAR, driven, seed=0)
    late = CubicSpline(driven.time, driven["chassis.a_x"])(np.maximum(driven.time - 0.2, 0.0))
    raw = replace(raw, channels={**raw.channels, "chassis.a_x": late})
    [delay] = [step for step in suggest(raw, CAR).steps if step.kind == "delay"]
    assert delay.channel == "chassis.a_x"
    assert delay.seconds == pytest.approx(0.2, abs=4.0 * lag_error(driven))
    found = condition(raw, [Angles("pitch")])
    assert "of chassis.a_x by 0.2" in warnings(found)[0]
    assert warnings(found)[0].endswith("before this step.")


@pytest.mark.parametrize("turned", ["chassis.body_a_x", "chassis.pitch_rate"])
def test_a_sensor_that_is_mounted_the_other_way_round_is_no_lag(drives, turned):
    raw = recorded(CAR, drives["2"], seed=0)
    raw = replace(raw, channels={**raw.channels, turned: -raw[turned]})
    assert find_lateness(condition(raw, [Speed(acceleration=True)]), 0.2) is None


def test_a_car_that_has_stopped_seems_to_pitch_while_it_stands():
    """Oracle: the pitch is 0. Braking at 4 m/s2 that ends at once, its speed 0.3 s late, leaves
    0.3 s of 4 m/s2 by gravity, through the low-pass' impulse at 0.2 Hz: a change of the pitch of
    4 x 0.3 / 9.81 rad s times that impulse's height."""
    time = np.arange(0.0, 30.0, 0.01)
    a_x = np.where((time >= 10.0) & (time < 15.0), -4.0, 0.0)
    late_speed = 20.0 - 4.0 * np.clip(time - 0.3 - 10.0, 0.0, 5.0)
    channels = {
        "chassis.body_a_x": a_x,
        "chassis.body_a_z": np.full(time.size, 9.81),
        "chassis.pitch_rate": np.zeros(time.size),
        "chassis.v_x": late_speed,
    }
    run = Run("r", time, channels)
    late = find_lateness(condition(run, [Speed(acceleration=True)]), 0.2)
    assert late is not None
    assert late.lag.seconds == pytest.approx(0.3, abs=0.005)
    assert late.doing == "stands"
    assert late.begin > 15.0
    impulse = np.zeros(time.size)
    impulse[1500] = 100.0
    height = np.ptp(in_band(time, impulse, (None, 0.2)))
    assert late.change == pytest.approx(4.0 * 0.3 / 9.81 * height, rel=0.1)
    assert "while the car stands from 15" in late.warning
