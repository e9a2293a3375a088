"""Sensors do to a known motion what their definition says."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.run import Run
from ridetune.engine.sensors import RECORDED, Sensor, SensorSet, measured

DENSE = np.arange(4001) * 0.0025
IDEAL = Sensor()


def wave(time, frequency=1.5):
    return 0.01 * np.sin(2 * np.pi * frequency * time)


def recorded(sensor=IDEAL, *, rate=200.0, frequency=1.5, seed=0, stream=0):
    """What a sensor of chassis.z makes of a sine, and when."""
    true = Run("run", DENSE, {"chassis.z": wave(DENSE, frequency)})
    run = measured(true, SensorSet(rate, {"chassis.z": sensor}), seed, stream)
    return run.time, run["chassis.z"]


def test_an_ideal_sensor_records_the_truth_at_its_instants():
    """Oracle: the sine itself; every second sample of the truth is one of the recording."""
    time, values = recorded()
    assert_allclose(time, np.arange(2001) / 200.0, rtol=0, atol=1e-12)
    assert_allclose(values, wave(time), rtol=0, atol=1e-14)


def test_a_rate_that_divides_nothing_falls_between_the_samples_of_the_truth():
    """Oracle: the sine; a cubic spline of step h errs by 5/384 h^4 w^4 of the amplitude, at its
    ends by some 20 times as much.
    """
    time, values = recorded(rate=130.0)
    assert time.size == 1301
    bound = 0.01 * 20 * 5 / 384 * (0.0025 * 2 * np.pi * 1.5) ** 4
    assert_allclose(values, wave(time), rtol=0, atol=bound)


def test_gain_bias_and_delay_are_those_of_the_definition():
    """Oracle: 1.2 sin(w (t - delay)) + bias, and the first value before anything has arrived."""
    time, values = recorded(Sensor(gain=1.2, bias=0.003, delay=0.0213))
    expected = 1.2 * wave(np.maximum(time - 0.0213, 0.0)) + 0.003
    assert_allclose(values, expected, rtol=0, atol=1e-9)


def test_a_reading_is_the_nearest_multiple_of_the_resolution():
    """Oracle: the sine in mm, rounded to hundredths and shifted by the bias in mm."""
    time, values = recorded(Sensor(unit="mm", bias=0.5, resolution=0.01))
    assert_allclose(1e3 * values, np.round(1e3 * wave(time) + 0.5, 2), rtol=0, atol=1e-9)


@pytest.mark.parametrize(("frequency", "gain"), [(4.0, 1.0), (20.0, 2**-0.5), (60.0, 0.0123)])
def test_the_anti_alias_filter_is_the_stated_butterworth(frequency, gain):
    """Oracle: |H| = (1 + (f/fc)^8)^-1/2 at 20 Hz; the bilinear transform moves a frequency f to
    tan(pi f / fs) / tan(pi fc / fs) of the cutoff.
    """
    warped = np.tan(np.pi * frequency / 400.0) / np.tan(np.pi * 20.0 / 400.0)
    assert gain == pytest.approx((1 + (frequency / 20.0) ** 8) ** -0.5, rel=0.01)
    time, values = recorded(Sensor(cutoff_hz=20.0), frequency=frequency)
    settled = time > 1.0
    amplitude = np.sqrt(2.0 * np.mean(values[settled] ** 2))
    assert_allclose(amplitude, 0.01 * (1 + warped**8) ** -0.5, rtol=0.01)


def test_a_filter_begins_settled():
    """Oracle: a constant stays one."""
    true = Run("run", DENSE, {"chassis.z": np.full(DENSE.size, 0.02)})
    sensors = SensorSet(sensors={"chassis.z": Sensor(cutoff_hz=10.0)})
    assert_allclose(measured(true, sensors, 0, 0)["chassis.z"], 0.02, rtol=1e-9)


def test_a_slow_sensor_holds_its_values_until_the_next():
    """Oracle: the sine at multiples of 1/20 s."""
    time, values = recorded(Sensor(rate_hz=20.0))
    assert_allclose(values, wave(np.floor(time * 20.0 + 1e-9) / 20.0), rtol=0, atol=1e-12)


def test_a_sensor_of_a_rate_that_does_not_divide_the_recording_s_never_looks_ahead():
    """Oracle: the last of its instants, k / 30 s, at or before each sample."""
    time, values = recorded(Sensor(rate_hz=30.0))
    assert_allclose(values, wave(np.floor(time * 30.0 + 1e-9) / 30.0), rtol=0, atol=1e-9)


def test_noise_is_white_of_the_stated_deviation():
    """Oracle: n samples scatter by 1/sqrt(2 n) about the deviation, correlation by 1/sqrt(n)."""
    time, values = recorded(Sensor(noise=0.002), seed=4)
    error = values - wave(time)
    assert np.std(error) == pytest.approx(0.002, rel=4 / np.sqrt(2 * time.size))
    assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 4 / np.sqrt(time.size)


def test_noise_follows_seed_run_and_channel_and_nothing_else():
    true = Run("run", DENSE, {name: wave(DENSE) for name in RECORDED})
    both = SensorSet(sensors={name: Sensor(noise=1e-3) for name in RECORDED})
    alone = replace(both, sensors={"seat.driver.a_z": Sensor(noise=1e-3)})

    def noise(sensors, name, seed=1, stream=0):
        run = measured(true, sensors, seed, stream)
        return run[name] - wave(run.time)

    same = noise(alone, "seat.driver.a_z")
    assert np.array_equal(noise(both, "seat.driver.a_z"), same)
    others = [noise(both, name) for name in RECORDED if name != "seat.driver.a_z"]
    others += [noise(alone, "seat.driver.a_z", seed=2), noise(alone, "seat.driver.a_z", stream=1)]
    for other in others:
        assert abs(np.corrcoef(other, same)[0, 1]) < 5 / np.sqrt(same.size)


def test_the_recording_states_the_noise_and_nothing_of_bias_gain_or_delay():
    sensors = SensorSet(sensors={"chassis.z": Sensor(noise=1e-3, bias=1.0, gain=2.0, delay=0.1)})
    run = measured(Run("run", DENSE, {"chassis.z": wave(DENSE)}), sensors, 0, 0)
    assert run.noise == {"chassis.z": 1e-3}
    assert (run.description, run.warnings) == ("", ())


def test_a_noise_too_small_to_be_read_from_notes_is_not_stated():
    sensors = SensorSet(sensors={"chassis.z": Sensor(noise=1e-200)})
    assert measured(Run("run", DENSE, {"chassis.z": wave(DENSE)}), sensors, 0, 0).noise == {}
