"""Figures of a ride against closed forms on made-up runs; missing channels leave rows out."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.frames import CORNERS
from ridetune.engine.iso2631 import response
from ridetune.engine.run import Run
from ridetune.engine.simulation.metrics import comfort_word, metrics, rms

TIME = np.arange(0.0, 60.0, 0.005)


def figures(**channels):
    """Metrics by name of a run with channels named with double underscores for dots."""
    named = {name.replace("__", "."): values for name, values in channels.items()}
    return {metric.name: metric for metric in metrics(Run("test", TIME, named))}


def sine(amplitude, frequency, offset=0.0):
    return offset + amplitude * np.sin(2 * np.pi * frequency * TIME)


def test_body_motion_is_rms_about_the_mean():
    """Oracle: amplitude over sqrt(2), whatever the offset of the recording."""
    found = figures(
        chassis__z=sine(0.02, 1.5, offset=0.4),
        chassis__pitch=sine(0.01, 1.0),
        chassis__roll=sine(0.005, 2.0),
    )
    for name, amplitude in (("z", 0.02), ("pitch", 0.01), ("roll", 0.005)):
        metric = found[f"chassis.{name}.rms"]
        assert_allclose(metric.value, amplitude / 2**0.5, rtol=1e-3)
    assert_allclose(found["chassis.pitch.nose_up"].value, 0.01, rtol=1e-4)
    assert_allclose(found["chassis.pitch.nose_down"].value, 0.01, rtol=1e-4)
    assert_allclose(
        found["chassis.z.rms"].value * found["chassis.z.rms"].display_factor, 14.14, 1e-2
    )


def test_seat_acceleration_is_weighted_by_its_direction():
    """Oracle: |H| of the formula; ends of the record weigh less than 1 %."""
    found = figures(seat__driver__a_z=sine(1.0, 5.0), seat__driver__a_x=sine(0.5, 2.0))
    vertical = found["seat.driver.a_z.weighted_rms"]
    gain = abs(response("Wk", 5.0))
    assert_allclose(vertical.value, gain / 2**0.5, rtol=0.01)
    assert "fairly uncomfortable" in vertical.meaning
    assert "driver seat" in vertical.label
    assert_allclose(found["seat.driver.a_z.vdv"].value, gain * (0.375 * 60) ** 0.25, rtol=0.01)
    assert_allclose(found["seat.driver.a_z.mtvv"].value, gain / 2**0.5, rtol=0.05)
    along = found["seat.driver.a_x.weighted_rms"]
    assert_allclose(along.value, 0.5 * abs(response("Wd", 2.0)) / 2**0.5, rtol=0.01)
    assert "seat.driver.a_x.vdv" not in found


def test_uneven_samples_give_the_same_figures():
    """Oracle: the closed forms again, from samples drawn at random."""
    rng = np.random.default_rng(2)
    time = TIME[np.sort(rng.choice(TIME.size, size=9000, replace=False))]
    wave = np.sin(2 * np.pi * 3.0 * time)
    found = {m.name: m.value for m in metrics(Run("r", time, {"seat.a.a_z": wave}))}
    expected = abs(response("Wk", 3.0)) / 2**0.5
    assert_allclose(found["seat.a.a_z.weighted_rms"], expected, rtol=0.01)
    assert_allclose(rms(time, 0.3 + wave), 1 / 2**0.5, rtol=2e-3)


def test_travel_of_an_axle_pools_both_wheels():
    """Oracle: rms of amplitudes 3 and 4 is 5/2; peaks are of either wheel."""
    found = figures(
        suspension__fl__travel=sine(0.003, 1.0),
        suspension__fr__travel=sine(0.004, 2.0, offset=0.01),
    )
    assert_allclose(found["suspension.front.travel.rms"].value, 0.0025, rtol=1e-3)
    assert_allclose(found["suspension.front.travel.jounce"].value, 0.014, rtol=1e-4)
    assert_allclose(found["suspension.front.travel.rebound"].value, 0.003, rtol=1e-4)
    assert not any(name.startswith("suspension.rear") for name in found)


def test_tyre_load_varies_about_its_mean():
    """Oracle: amplitude over sqrt(2) and mean; a load below zero for a third of the time."""
    found = figures(
        tyre__rl__load=sine(600.0, 2.0, offset=3000.0),
        tyre__rr__load=sine(600.0, 2.0, offset=3000.0),
        tyre__fl__load=np.where(TIME < 20.0, -1.0, 2.0),
        tyre__fr__load=np.where(TIME < 20.0, -1.0, 2.0),
    )
    assert_allclose(found["tyre.rear.load.rms"].value, 600 / 2**0.5, rtol=1e-3)
    assert_allclose(found["tyre.rear.load.coefficient"].value, 0.2 / 2**0.5, rtol=1e-3)
    assert found["tyre.rear.load.lifted"].value == 0.0
    assert_allclose(found["tyre.front.load.lifted"].value, 1 / 3, rtol=1e-9)


def test_squat_and_dive_are_means_while_the_car_accelerates_and_brakes():
    """Oracle: -0.015 rad at 3 m/s2 and 0.02 rad at -4 m/s2, beneath a road's 2 Hz wave."""
    push = np.where((TIME > 10) & (TIME < 20), 3.0, 0.0) - np.where(TIME > 50, 4.0, 0.0)
    pitch = np.where(push > 0, -0.015, 0.0) + np.where(push < 0, 0.02, 0.0) + sine(0.005, 2.0)
    found = figures(chassis__pitch=pitch, chassis__a_x=push)
    assert_allclose(found["chassis.pitch.squat"].value, 0.015, rtol=0.02)
    assert_allclose(found["chassis.pitch.dive"].value, 0.02, rtol=0.02)


def test_a_car_that_only_coasts_neither_squats_nor_dives():
    found = figures(chassis__pitch=sine(0.005, 2.0), chassis__a_x=np.full(TIME.size, -0.0981))
    assert "chassis.pitch.squat" not in found
    assert "chassis.pitch.dive" not in found


def test_a_run_without_such_channels_has_no_figures():
    assert figures(chassis__v_x=sine(1.0, 1.0)) == {}


@pytest.mark.parametrize("corner", CORNERS)
def test_one_wheel_alone_is_no_axle(corner):
    assert figures(**{f"tyre__{corner}__load": sine(1.0, 1.0, 3.0)}) == {}


def test_a_short_run_has_figures_too():
    run = Run("short", np.array([0.0, 0.01, 0.02]), {"chassis.z": np.array([0.0, 1e-3, 0.0])})
    assert [metric.name for metric in metrics(run)] == ["chassis.z.rms"]


@pytest.mark.parametrize(
    ("acceleration", "word"),
    [(0.1, "not uncomfortable"), (0.4, "a little"), (1.0, "uncomfortable"), (9.0, "extremely")],
)
def test_comfort_has_a_word(acceleration, word):
    assert comfort_word(acceleration).startswith(word)
