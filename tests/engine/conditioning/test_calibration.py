import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.conditioning.calibration import Rest, Scale, standstill
from ridetune.engine.conditioning.chain import condition
from ridetune.engine.errors import ConditioningError
from ridetune.engine.run import Run

TIME = np.arange(0.0, 10.0, 0.01)
MOVES = np.where(TIME < 3.0, 0.0, np.sin(2 * np.pi * 1.5 * (TIME - 3.0)))
RNG = np.random.default_rng(3)


def test_scale_is_the_inverse_of_a_sensor():
    reading = -2.0 * MOVES + 0.3
    run = Run("r", TIME, {"chassis.pitch_rate": reading}, noise={"chassis.pitch_rate": 0.1})
    found = condition(run, [Scale("chassis.pitch_rate", gain=-2.0, bias=0.3)])
    assert_allclose(found["chassis.pitch_rate"], MOVES, rtol=0, atol=1e-15)
    assert found.noise["chassis.pitch_rate"] == 0.05


def test_rest_is_found_and_taken_off_to_its_standard_error():
    """Oracle: the offset that was put on, within four standard errors, s / sqrt(n) of white noise;
    an accelerometer that looks upwards is left reading gravity."""
    noise = 0.02 * RNG.standard_normal((2, TIME.size))
    channels = {
        "suspension.fl.travel": 0.01 * MOVES + 0.012 + 1e-2 * noise[0],
        "chassis.body_a_z": 9.81 + MOVES + 0.15 + noise[1],
    }
    found = condition(Run("r", TIME, channels), [Rest()])
    numbers = found.conditioning[0].numbers
    assert (numbers["begin_s"], numbers["end_s"]) == pytest.approx((0.0, 2.9), abs=0.15)
    for name, offset in (("suspension.fl.travel", 0.012), ("chassis.body_a_z", 0.15)):
        error = numbers[f"standard_error.{name}"]
        assert abs(numbers[f"offset.{name}"] - offset) < 4.0 * error < 0.01
    still = TIME < 2.8
    assert np.mean(found["chassis.body_a_z"][still]) == pytest.approx(9.81, abs=1e-9 + 0.004)


def test_a_car_stands_where_its_speed_is_zero_too():
    """Steady driving on a smooth road is quiet as well."""
    speed = np.where(TIME < 5.0, 0.01, 10.0)
    run = Run("r", TIME, {"chassis.v_x": speed, "chassis.a_x": np.zeros_like(TIME)})
    begin, end = standstill(run)
    assert (begin, end) == (0.0, 4.99)


def braking(**channels):
    """From 20 m/s at 1.2 m/s2, after 5 s of steady driving, on a smooth road: no channel moves."""
    slowing = np.where(TIME < 5.0, 0.0, -1.2)
    raw = {"chassis.body_a_x": slowing + 0.005, "chassis.pitch_rate": 0.001 + 0.0 * TIME}
    return Run("r", TIME, {**raw, **channels})


def test_a_car_whose_wheels_turn_does_not_stand():
    speed = 20.0 - np.where(TIME < 5.0, 0.0, 1.2 * (TIME - 5.0))
    assert standstill(braking(**{"wheel.rl.speed": speed})) is None
    locked = {"wheel.fl.speed": 0.0 * TIME, "wheel.rl.speed": speed}
    assert standstill(braking(**locked)) is None
    assert standstill(braking(**{"chassis.v_x": np.where(TIME < 5.0, speed, np.nan)})) is None


def test_without_a_speed_standing_is_assumed_and_never_while_it_brakes():
    found = condition(braking(), [Rest()]).conditioning[0]
    assert found.numbers["end_s"] == pytest.approx(5.0, abs=0.6)
    assert found.numbers["end_s"] < 5.0
    assert "is assumed: no speed is recorded" in found.sentences[-1]
    easing = braking(**{"chassis.body_a_x": 0.4 - 0.35 * TIME})
    assert standstill(easing) is None


def test_a_car_that_never_stands_has_no_rest():
    assert standstill(Run("r", TIME, {"chassis.pitch": np.sin(10 * TIME)})) is None
    assert standstill(Run("r", TIME, {"chassis.v_x": 5.0 + 0.0 * TIME})) is None


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        (Rest(), r"the car nowhere stands still for 0\.3 s .*; give the interval"),
        (Rest(("chassis.pitch",), (20.0, 30.0)), "fewer than 3 samples lie in the interval"),
        (Rest(("chassis.v_x",), (0.0, 1.0)), "chassis.v_x does not count from rest; leave it out"),
        (Rest(("chassis.z",), (0.0, 1.0)), "the run lacks chassis.z, it holds .*; record it"),
        (
            Scale("chassis.ptch"),
            r"No channel is called 'chassis.ptch'; did you mean chassis.pitch\?",
        ),
    ],
)
def test_what_cannot_be_done_is_said_in_one_sentence(step, sentence):
    run = Run("r", TIME, {"chassis.pitch": np.sin(10 * TIME), "chassis.v_x": 5.0 + 0 * TIME})
    with pytest.raises(ConditioningError, match=f"^Run r, step 1, {step.kind}: {sentence}"):
        condition(run, [step])
