"""Closed forms, and a simulated drive whose instruments are made up by textbook formulas."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.channels import CORNERS
from ridetune.engine.conditioning.chain import condition
from ridetune.engine.conditioning.motion import Angles, Displacement, Gravity, Speed
from ridetune.engine.conditioning.rims import RimFromTravel
from ridetune.engine.errors import ConditioningError
from ridetune.engine.filters import ORDER, in_band
from ridetune.engine.run import Run

from ...factories import paper_vehicle
from ...raw_sensors import BOOT, G, drive, recorded, specific_force

CAR = paper_vehicle()
TIME = np.arange(0.0, 40.0, 0.01)


@pytest.fixture(scope="module")
def driven():
    """Manoeuvre 2: 5 s at rest, accelerating on class A, then class C."""
    return drive(CAR)


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


def gain(frequency, step, low, high):
    """Amplitude that the two zero-phase filters leave, closed form (bilinear transform)."""
    warped = np.tan(np.pi * frequency * step)
    below = (warped / np.tan(np.pi * low * step)) ** (2 * ORDER)
    above = (warped / np.tan(np.pi * high * step)) ** (2 * ORDER)
    return below / (1.0 + below) / (1.0 + above)


@pytest.mark.parametrize("hertz", [0.5, 1.0, 4.0])
def test_a_sine_is_integrated_twice_to_its_closed_form(hertz):
    """Oracle: -a / (2 pi f)^2, with the filters' gain. A bias leaves nothing in the middle.

    The spline errs by (2 pi f h)^4 / 720 of a twice, below 1e-5 of the amplitude at 4 Hz.
    """
    reading = 9.81 + 0.05 + 2.0 * np.sin(2 * np.pi * hertz * TIME)
    run = Run("r", TIME, {"wheel.fl.a_z": reading})
    found = condition(run, [Displacement(("wheel.fl.a_z",), (0.25, 20.0))])
    amplitude = -2.0 / (2 * np.pi * hertz) ** 2 * gain(hertz, 0.01, 0.25, 20.0)
    inner = slice(1500, -1500)
    true = amplitude * np.sin(2 * np.pi * hertz * TIME)
    assert_allclose(found["wheel.fl.z"][inner], true[inner], rtol=0, atol=2e-5 * abs(amplitude))


def test_one_milli_g_at_a_fifth_of_a_hertz_is_six_millimetres():
    """Oracle: 9.81e-3 / (2 pi 0.2)^2 = 6.212 mm."""
    run = Run("r", TIME, {"chassis.a_z": np.sin(TIME)})
    record = condition(run, [Displacement(("chassis.a_z",), (0.2, 20.0))]).conditioning[0]
    assert record.numbers["of_1_mg_m"] == pytest.approx(6.212e-3, rel=1e-3)
    assert record.band_hz == (0.2, 20.0)
    assert "1 mg at 0.2 Hz is 6.2 mm" in record.sentences[0]


def test_the_noise_of_a_displacement_is_stated():
    """Oracle: the scatter over 30 records, known to 1 / sqrt(2 n_eff) with some 12 independent
    values in each: 4 % and as much again for the ends."""
    random = np.random.default_rng(0)
    found = []
    for _ in range(30):
        noise = {"chassis.a_z": 0.1}
        run = Run("r", TIME, {"chassis.a_z": 0.1 * random.standard_normal(TIME.size)}, noise)
        done = condition(run, [Displacement(("chassis.a_z",), (0.3, 20.0))])
        found.append(done["chassis.z"])
    assert rms(np.array(found)[:, 500:-500]) == pytest.approx(done.noise["chassis.z"], rel=0.15)


def test_a_displacement_is_what_the_band_leaves_of_the_true_one(driven):
    """Oracle: the same filters on the simulated z; what is taken off is by Parseval's theorem.

    Without its mean the acceleration's integral drifts, which the filters take off away from the
    ends; there an error of the mean e leaves e / (2 pi f_low)^2 of 1 mg at most.
    """
    run = Run("r", driven.time, {"chassis.a_z": driven["point.cg.a_z"]})
    band = (0.3, 50.0)
    found = condition(run, [Displacement(("chassis.a_z",), band)])["chassis.z"]
    true = in_band(driven.time, driven["chassis.z"], band)
    # Two periods of 0.5 Hz from the ends.
    inner = slice(2000, -2000)
    assert rms((found - true)[inner]) < 1e-3 * rms(true)
    spectrum = np.fft.rfft(driven["chassis.z"] - np.mean(driven["chassis.z"]))
    frequency = np.fft.rfftfreq(driven.time.size, 0.002)
    lost = spectrum * (1.0 - gain(np.maximum(frequency, 1e-9), 0.002, *band))
    excluded = np.sqrt(2.0 * np.sum(np.abs(lost) ** 2)) / driven.time.size
    kept = driven["chassis.z"] - np.mean(driven["chassis.z"])
    assert rms(kept - found) == pytest.approx(excluded, rel=0.15)


@pytest.mark.parametrize("with_vertical", [True, False])
def test_a_car_that_stands_tilted_does_not_accelerate(with_vertical):
    """Oracle: g sin(0.88 deg) = 0.1507 m/s2 of gravity along the body's axis is all of it."""
    pitch, zero = np.radians(0.88), np.zeros_like(TIME)
    channels = {"chassis.pitch": pitch + zero, "chassis.body_a_x": -G * np.sin(pitch) + zero}
    if with_vertical:
        channels["chassis.body_a_z"] = G * np.cos(pitch) + zero
    found = condition(Run("r", TIME, channels), [Gravity()])
    assert_allclose(found["chassis.a_x"], 0.0, atol=1e-13)
    removed = found.conditioning[0].numbers["removed_m_s2"]
    assert removed == pytest.approx(0.1507, abs=1e-4)
    if with_vertical:
        assert_allclose(found["chassis.a_z"], 0.0, atol=1e-13)


def test_gravity_is_taken_off_to_full_order(driven):
    """Oracle: rotation matrices on the simulated accelerations; equality but for rounding."""
    force = specific_force(driven)
    channels = {f"chassis.body_a_{axis}": force[:, k] for k, axis in enumerate("xyz")}
    channels |= {name: driven[name] for name in ("chassis.pitch", "chassis.roll")}
    found = condition(Run("r", driven.time, channels), [Gravity()])
    assert_allclose(found["chassis.a_x"], driven["chassis.a_x"], rtol=0, atol=1e-12)
    assert_allclose(found["chassis.a_z"], driven["point.cg.a_z"], rtol=0, atol=1e-12)
    # The model has no motion sideways, so nothing is lost without the third axis.
    channels.pop("chassis.body_a_y")
    found = condition(Run("r", driven.time, channels), [Gravity()])
    assert_allclose(found["chassis.a_x"], driven["chassis.a_x"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("gyros", [True, False])
def test_a_sensor_away_from_the_centre_of_gravity_is_brought_there(driven, gyros):
    """Oracle: the simulation's acceleration of the CG, from its acceleration of the boot.

    What the rates hold above their low-pass of 100 Hz stays, and what the spline's derivative
    misses at the corners of the torque: less than a hundredth of the swing that is taken off.
    """
    force = specific_force(driven, "point.boot")
    channels = {f"chassis.body_a_{axis}": force[:, k] for k, axis in enumerate("xyz")}
    names = ["chassis.pitch", "chassis.roll"]
    names += ["chassis.pitch_rate", "chassis.roll_rate"] * gyros
    run = Run("r", driven.time, channels | {name: driven[name] for name in names})
    found = condition(run, [Gravity(BOOT, rate_cutoff_hz=100.0)])
    for name, true in (("chassis.a_x", "chassis.a_x"), ("chassis.a_z", "point.cg.a_z")):
        swing = rms(driven[f"point.boot{name[7:]}"] - driven[true])
        assert swing > 0.03
        assert rms(found[name] - driven[true]) < 1e-2 * swing


def test_without_a_vertical_axis_the_vertical_acceleration_leaks_in_by_the_pitch(driven):
    """Oracle: with a_Z left out, a_x is off by a_Z tan p exactly."""
    channels = {"chassis.body_a_x": specific_force(driven)[:, 0]}
    channels["chassis.pitch"] = driven["chassis.pitch"]
    found = condition(Run("r", driven.time, channels), [Gravity()])
    leak = -driven["point.cg.a_z"] * np.tan(driven["chassis.pitch"])
    assert_allclose(found["chassis.a_x"] - driven["chassis.a_x"], leak, rtol=0, atol=1e-12)
    assert "no acceleration upwards is assumed" in found.conditioning[0].sentences[1]


def test_a_gyro_s_bias_leaves_an_angle_held_to_gravity_alone():
    """Oracle: a constant tilt. The bias is a line in the integral, which goes as a whole."""
    pitch, zero = 0.02, np.zeros_like(TIME)
    channels = {
        "chassis.pitch_rate": zero + np.radians(0.1),
        "chassis.body_a_x": -G * np.sin(pitch) + zero,
        "chassis.body_a_z": G * np.cos(pitch) + zero,
    }
    found = condition(Run("r", TIME, channels), [Angles("pitch")])
    assert_allclose(found["chassis.pitch"], pitch, rtol=0, atol=1e-6)
    bias = found.conditioning[0].numbers["gyro_bias_rad_s"]
    assert bias == pytest.approx(np.radians(0.1), rel=1e-6)


def test_angles_of_a_drive_are_the_true_ones(driven):
    """Oracle: the simulation. By gravity alone, a_x from the speed below 2 Hz, the angle is off by
    what a_x has above, which the crossover keeps out; 0.01 deg is half the usual gyro's noise."""
    raw = recorded(CAR, driven)
    steps = [Speed(acceleration=True), Angles("pitch"), Angles("roll")]
    found = condition(raw, steps)
    for name in ("chassis.pitch", "chassis.roll"):
        assert rms(found[name] - driven[name]) < np.radians(0.01)
    unaware = condition(raw, [Angles("pitch")])
    assert np.ptp(unaware["chassis.pitch"] - driven["chassis.pitch"]) > np.radians(10.0)
    assert "1 m/s2 of the car's own are 5.8 deg" in unaware.conditioning[0].sentences[0]


def test_a_gyro_alone_is_integrated_from_rest(driven):
    """Oracle: the simulation; the bodies' axes are tilted by cos(roll) and no more."""
    raw = recorded(CAR, driven)
    bare = condition(raw, [Angles("pitch", False, 0.0)])
    slack = np.max(1.0 - np.cos(driven["chassis.roll"])) * np.ptp(driven["chassis.pitch"])
    assert_allclose(bare["chassis.pitch"], driven["chassis.pitch"], rtol=0, atol=slack + 1e-7)
    high = condition(raw, [Angles("roll", False, 0.5)])
    true = in_band(driven.time, driven["chassis.roll"], (0.5, None))
    assert_allclose(high["chassis.roll"], true, rtol=0, atol=1e-5 * np.ptp(true))
    assert high.conditioning[0].band_hz == (0.5, None)


def test_speed_comes_from_the_undriven_wheels():
    speeds = {f"wheel.{c}.speed": 10.0 + 0.1 * k + 0.0 * TIME for k, c in enumerate(CORNERS)}
    run = Run("r", TIME, speeds)
    assert_allclose(condition(run, [Speed("wheels")], CAR)["chassis.v_x"], 10.05)
    assert_allclose(condition(run, [Speed("wheels")])["chassis.v_x"], 10.15)


def test_acceleration_is_the_derivative_of_the_speed():
    """Oracle: 2 pi f cos, times the gain of the low-pass, away from the ends."""
    speed = 10.0 + np.sin(2 * np.pi * 0.3 * TIME)
    found = condition(Run("r", TIME, {"chassis.v_x": speed}), [Speed(acceleration=True)])
    slope = 2 * np.pi * 0.3 * np.cos(2 * np.pi * 0.3 * TIME)
    slope *= 1.0 / (1.0 + (0.3 / 2.0) ** (2 * ORDER))
    assert_allclose(found["chassis.a_x"][500:-500], slope[500:-500], rtol=0, atol=1e-4)
    assert found.conditioning[0].band_hz == (None, 2.0)


def test_wheels_on_their_arms_are_where_the_simulation_has_them(driven):
    """Oracle: the simulation's own travel and wheel heights; equality but for rounding."""
    found = condition(driven, [RimFromTravel(geometry="arm")], CAR)
    for corner in CORNERS:
        name = f"wheel.{corner}.z"
        assert_allclose(found[name], driven[name], rtol=0, atol=1e-12)


def test_wheels_straight_up_and_down_are_off_by_what_the_record_says(driven):
    """Oracle: the simulation; of second order in the travel: D^2 / (2 H) and D sin p, with D a
    tenth of 40 mm, H 0.40 m and p 0.02, are 0.02 and 0.08 mm."""
    found = condition(driven, [RimFromTravel()], CAR)
    worst = max(np.max(np.abs(found[f"wheel.{c}.z"] - driven[f"wheel.{c}.z"])) for c in CORNERS)
    assert worst == pytest.approx(found.conditioning[0].numbers["arm_less_vertical_m"], rel=1e-9)
    assert worst < 0.1e-3


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        (Displacement(("chassis.a_z",), (0.05, 20.0)), r"a record of 60 s, and .* 40 s; raise it"),
        (Displacement(("chassis.a_z",), (0.5, 90.0)), "holds 45 Hz; lower it"),
        (Displacement(("chassis.pitch",)), "does not become a displacement; choose from"),
        (Displacement(()), "no channel is named"),
        (Displacement(("wheel.fl.a_z",)), "the run lacks wheel.fl.a_z, it holds .*; record it"),
        (Angles("roll"), "the run lacks chassis.roll_rate"),
        (Angles("pitch", crossover_hz=0.03), "crossover_hz begins at 0.03 Hz"),
        (Gravity(), "the run lacks chassis.body_a_x"),
        (Speed(), "nothing is to be made"),
        (Speed("wheels"), "the run lacks wheel.fl.speed, wheel.fr.speed"),
        (RimFromTravel(), "where the wheels are is not known; give a vehicle"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_sentence(step, sentence):
    channels = {"chassis.a_z": np.sin(TIME), "chassis.pitch": np.sin(TIME)}
    run = Run("r", TIME, channels | {"chassis.pitch_rate": np.cos(TIME)})
    with pytest.raises(ConditioningError, match=f"^Run r, step 1, {step.kind}: .*{sentence}"):
        condition(run, [step])


def test_a_travel_beyond_the_arm_is_refused():
    still = dict.fromkeys(("chassis.z", "chassis.pitch", "chassis.roll"), 0.0 * TIME)
    travel = {f"suspension.{corner}.travel": 0.5 * np.sin(TIME) for corner in CORNERS}
    with pytest.raises(ConditioningError, match="suspension.fl.travel goes beyond"):
        condition(Run("r", TIME, still | travel), [RimFromTravel()], CAR)
