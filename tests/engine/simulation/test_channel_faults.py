import numpy as np
import pytest
from ridetune.engine.simulation.channel_faults import dead_sensor, wrong_sign, wrong_unit

TIME = np.linspace(0.0, 20.0, 2001)
BODY = 0.01 * np.sin(7.0 * TIME) + 0.003 * np.cos(3.0 * TIME)


def test_a_channel_turned_over_is_named_with_its_remedy():
    finding = wrong_sign("lap 1", "chassis.z", -BODY, BODY, BODY)
    assert "chassis.z of run lap 1" in finding.sentence
    assert "multiply it by -1" in finding.sentence


def test_a_turned_channel_that_the_fit_has_bent_the_car_to_is_still_named():
    assert "at the start values" in wrong_sign("lap", "chassis.z", -BODY, BODY, -BODY).sentence
    assert "after the fit" in wrong_sign("lap", "chassis.z", -BODY, -0.1 * BODY, BODY).sentence


def test_a_badly_guessed_start_is_no_wrong_sign():
    """Oracle: a quarter of a period late has correlation 0."""
    late = 0.01 * np.sin(7.0 * TIME - np.pi / 2)
    assert wrong_sign("lap", "chassis.z", BODY, late, BODY) is None


@pytest.mark.parametrize(
    ("channel", "factor", "numbers", "header"),
    [
        ("chassis.z", 1000.0, "mm", "m"),
        ("chassis.z", 1e-3, "m", "mm"),
        ("chassis.pitch", 180.0 / np.pi, "deg", "rad"),
        ("chassis.roll", np.pi / 180.0, "rad", "deg"),
    ],
)
@pytest.mark.parametrize("guess", [0.6, 1.0, 1.8])
def test_a_mistaken_unit_shows_in_the_amplitude(channel, factor, numbers, header, guess):
    """The start values may be off by nearly a factor of two."""
    finding = wrong_unit("lap", channel, factor * BODY, guess * BODY)
    assert f"{channel} of run lap" in finding.sentence
    assert f"in {numbers} under a header that says {header}" in finding.sentence


def test_a_spike_is_no_mistaken_unit():
    """One sample 500 times as large multiplies the standard deviation, but not the motion."""
    spiked = BODY.copy()
    spiked[700] = 5.0
    assert wrong_unit("lap", "chassis.z", spiked, BODY) is None


def test_a_car_that_stands_most_of_the_time_has_no_mistaken_unit():
    """A bump of a second in two minutes of rest: the noise of the rest is not the motion."""
    time = np.arange(0.0, 120.0, 0.005)
    bump = 0.01 * np.exp(-(((time - 100.0) / 0.3) ** 2)) * np.sin(8.0 * (time - 100.0))
    noisy = bump + 1e-4 * np.random.default_rng(8).normal(size=time.size)
    assert wrong_unit("lap", "chassis.z", noisy, bump) is None
    assert "multiply it by -1" in wrong_sign("lap", "chassis.z", -noisy, bump, bump).sentence


def test_a_channel_at_rest_in_the_model_has_no_unit_to_mistake():
    """Roll on a flat road is rounding, in the record as in the model."""
    rounding = 1e-17 * np.cos(40.0 * TIME)
    assert wrong_unit("lap", "chassis.roll", 0.03 * rounding, rounding) is None


def test_a_model_that_has_fallen_over_is_no_witness():
    """A car on its nose by 0.3 rad looks like degrees taken for radians, the other way round."""
    fallen = 0.3 * np.tanh(TIME - 8.0)
    assert wrong_unit("lap", "chassis.pitch", BODY, fallen) is None
    assert wrong_sign("lap", "chassis.pitch", -0.2 * fallen, fallen, fallen) is None


@pytest.mark.parametrize("factor", [0.2, 1.0, 5.0])
def test_a_wrong_guess_of_the_car_is_no_mistaken_unit(factor):
    assert wrong_unit("lap", "chassis.z", factor * BODY, BODY) is None
    assert wrong_unit("lap", "chassis.roll", factor * BODY, BODY) is None


def test_a_dead_channel_is_named():
    """A channel at rest is dead only where the model moves by more than the noise."""
    still = np.zeros_like(TIME)
    assert "never moves" in dead_sensor("lap", "chassis.roll", still, BODY, 5e-4).sentence
    assert dead_sensor("lap", "chassis.roll", still, 1e-3 * BODY, 5e-4) is None
    assert dead_sensor("lap", "chassis.roll", BODY, BODY, 5e-4) is None
