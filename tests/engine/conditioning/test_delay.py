import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.conditioning.chain import condition
from ridetune.engine.conditioning.delay import Delay, find_lag
from ridetune.engine.errors import ConditioningError
from ridetune.engine.filters import in_band
from ridetune.engine.run import Run
from scipy.interpolate import CubicSpline

from ...factories import paper_vehicle
from ...raw_sensors import drive, recorded

STEP = 0.005
TIME = np.arange(0.0, 20.0, STEP)
BAND = (0.5, 5.0)


def signal(seed=0):
    """Random motion between 0.3 and 6 Hz, as a spline so that it can be read anywhere."""
    time = np.arange(-2.0, 22.0, STEP)
    noise = np.random.default_rng(seed).standard_normal(time.size)
    values = in_band(time, noise, (0.3, 6.0))
    return CubicSpline(time, values / np.std(values))


@pytest.mark.parametrize("delay", [0.0, 0.0372, -0.0213, 0.3])
def test_a_delay_is_found_to_a_fraction_of_a_sample(delay):
    """Oracle: the delay. The window's ends see the two histories shifted against each other, over
    a fifth of the record at a slope of 1/400 a sample: no more than 2 % of a sample comes of it."""
    motion = signal()
    lag = find_lag(TIME, motion(TIME - delay), motion(TIME), 0, BAND, 0.5)
    assert lag.seconds == pytest.approx(delay, abs=0.02 * STEP)
    assert lag.correlation > 0.99


@pytest.mark.parametrize(("order", "how"), [(1, 1), (2, 2)])
def test_a_derivative_of_the_reference_may_be_what_is_late(order, how):
    motion = signal()
    lag = find_lag(TIME, motion(TIME - 0.0123, how), motion(TIME), order, BAND, 0.5)
    assert lag.seconds == pytest.approx(0.0123, abs=0.02 * STEP)


def test_an_integral_of_the_reference_may_be_what_is_late():
    """A speed against an acceleration, as GPS comes late."""
    motion = signal()
    lag = find_lag(TIME, motion(TIME - 0.0871), motion(TIME, 1), -1, BAND, 0.5)
    assert lag.seconds == pytest.approx(0.0871, abs=0.02 * STEP)


@pytest.mark.parametrize("coloured", [False, True])
def test_the_standard_error_is_the_scatter_over_many_noises(coloured):
    """Oracle: the standard deviation of 200 estimates, itself known to 5 %, white noise or not;
    the window and the spread of the error's own estimate may add as much again."""
    motion, random = signal(), np.random.default_rng(5)
    found = []
    for _ in range(200):
        noise = 0.3 * random.standard_normal(TIME.size)
        if coloured:
            noise = 3.0 * in_band(TIME, noise, (None, 2.0))
        lag = find_lag(TIME, motion(TIME - 0.02) + noise, motion(TIME), 0, BAND, 0.2)
        found.append((lag.seconds, lag.standard_error))
    delays, errors = np.array(found).T
    assert np.std(delays) == pytest.approx(np.mean(errors), rel=0.2)
    assert abs(np.mean(delays) - 0.02) < 4.0 * np.std(delays) / np.sqrt(200)
    assert np.mean(errors) < 0.3 * STEP


def test_the_delay_is_taken_off_and_the_record_cut_to_what_is_known():
    """Oracle: the motion itself, but for what the delay and the spline, (2 pi 6 h)^4 / 384, err."""
    motion = signal()
    run = Run("r", TIME, {"chassis.z": motion(TIME - 0.0372), "chassis.a_z": motion(TIME, 2)})
    found = condition(run, [Delay("chassis.z", reference="chassis.a_z", order=-2)])
    record = found.conditioning[0]
    assert record.numbers["delay_s"] == pytest.approx(0.0372, abs=0.02 * STEP)
    assert found.time[-1] <= TIME[-1] - 0.0371
    assert_allclose(found["chassis.a_z"], motion(found.time, 2), rtol=0, atol=1e-12)
    shift = 0.02 * STEP * np.max(np.abs(motion(TIME, 1)))
    assert_allclose(found["chassis.z"], motion(found.time), rtol=0, atol=shift + 1e-4)


def test_a_given_delay_is_taken_as_it_is():
    motion = signal()
    run = Run("r", TIME, {"chassis.z": motion(TIME + 0.1)})
    found = condition(run, [Delay("chassis.z", seconds=-0.1)])
    assert found.time[0] == pytest.approx(0.1)
    assert_allclose(found["chassis.z"], motion(found.time), rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ({"seconds": 30.0}, r"a delay of 30 s leaves nothing of a record of 20 s"),
        ({"reference": "chassis.pitch"}, "chassis.pitch does not move between 0.5 and 5 Hz"),
        ({"reference": "chassis.roll"}, r"chassis.z does not follow chassis.roll \(correlation"),
        ({"reference": "chassis.z"}, "chassis.z is its own reference"),
        ({"reference": "chassis.a_x"}, "the run lacks chassis.a_x"),
        ({"reference": "chassis.roll", "longest": 8.0}, "longest is 8 s, more than a quarter"),
        ({"reference": "chassis.roll", "band_hz": (0.05, 5.0)}, "which takes a record of 60 s"),
        ({"reference": "chassis.roll", "band_hz": (2.0, 2.1)}, "is 0.1 Hz wide"),
        ({"reference": "chassis.roll", "band_hz": (5.0, 0.5)}, "give the lower frequency first"),
        ({"reference": "chassis.roll", "band_hz": (0.5, 95.0)}, "holds 90 Hz; lower it"),
    ],
)
def test_what_cannot_be_found_is_said_in_one_sentence(how, sentence):
    others = {"chassis.pitch": 0.01 + 0.0 * TIME, "chassis.roll": signal(9)(TIME)}
    run = Run("r", TIME, {"chassis.z": signal()(TIME), **others})
    with pytest.raises(ConditioningError, match=f"^Run r, step 1, delay: .*{sentence}"):
        condition(run, [Delay("chassis.z", **how)])


def test_a_late_gps_is_found_against_an_accelerometer():
    """Oracle: the delay, within two standard errors, which hold what gravity adds by the pitch."""
    car = paper_vehicle()
    raw = recorded(car, drive(car, sample_step=0.005), seed=4, delay=0.12)
    step = Delay("chassis.v_x", reference="chassis.body_a_x", order=-1, band_hz=(0.2, 2.0))
    numbers = condition(raw, [step]).conditioning[0].numbers
    assert abs(numbers["delay_s"] - 0.12) < 2.0 * numbers["standard_error_s"] < 0.02


@pytest.mark.parametrize("how", [{}, {"seconds": 0.1, "reference": "chassis.a_z"}])
def test_a_delay_is_given_or_found(how):
    with pytest.raises(ConditioningError, match="either given in seconds or found"):
        Delay("chassis.z", **how)
