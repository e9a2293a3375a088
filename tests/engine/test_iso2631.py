"""Weightings against the standard's tables and its burst; closed forms for the doses."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.iso2631 import response, running_rms, vibration_dose, weighted

TABLE = """
0.5 418 853    0.63 459 944   0.8 477 992    1 482 1011    1.25 484 1008   1.6 494 968
2 531 890      2.5 631 776    3.15 804 642   4 967 512     5 1039 409      6.3 1054 323
8 1036 253     10 988 202     12.5 902 161   16 768 125    20 636 100      25 513 80
31.5 405 63.2  40 314 49.4    50 246 38.8    63 186 29.5   80 132 21.1
"""
ENTRIES = [tuple(row.split()) for row in re.findall(r"\S+ \S+ \S+", TABLE)]
BURST = {1: (0.0299, 0.323, 0.0944, 0.0922), 16: (0.115, 0.648, 0.363, 0.289)}


@pytest.mark.parametrize(("frequency", "wk", "wd"), ENTRIES)
def test_the_formula_gives_every_entry_of_the_table(frequency, wk, wd):
    """Oracle: ISO 2631-1's table at nominal third octaves, x 1000, within one printed digit."""
    for weighting, printed in (("Wk", wk), ("Wd", wd)):
        digit = 0.1 if "." in printed else 1.0
        gain = 1000.0 * np.abs(response(weighting, float(frequency)))
        assert_allclose(gain, float(printed), rtol=0, atol=digit)


def test_the_table_is_whole():
    assert len(ENTRIES) == 23


@pytest.mark.parametrize(("weighting", "corner"), [("Wd", 2.0), ("We", 1.0), ("Wc", 8.0)])
def test_plain_weightings_differ_only_in_their_corner(weighting, corner):
    """Oracle: sqrt(2) Q4 at the corner, 0.63 sqrt(2) = 0.891, where the band limits are passed.

    Both band limits take off (f1/f)^4/2 and (f/f2)^4/2 of the gain at most.
    """
    loss = (0.4 / corner) ** 4 / 2 + (corner / 100) ** 4 / 2
    assert_allclose(np.abs(response(weighting, corner)), 0.63 * 2**0.5, rtol=1.01 * loss + 1e-9)


def test_a_constant_acceleration_counts_for_nothing():
    """Oracle: 0 but for both ends, which ring at the Nyquist frequency by |H|/(pi samples)."""
    assert response("Wk", 0.0) == 0.0
    history = weighted(np.full(6000, 9.81), 0.01, "Wk")
    ringing = 2 * 9.81 * np.abs(response("Wk", 50.0)) / (np.pi * 2000)
    assert np.abs(history[2000:4000]).max() < ringing


@pytest.mark.parametrize("step", [0.01, 0.005, 0.002])
@pytest.mark.parametrize("frequency", [0.6, 4.0, 16.0, 40.0])
def test_a_sampled_sine_is_weighted_like_the_formula_at_every_rate(step, frequency):
    """Oracle: |H| over 20 s of whole periods, away from the ends where the sine sets in."""
    time = np.arange(0.0, 60.0, step)
    history = weighted(np.sin(2 * np.pi * frequency * time), step, "Wk")
    middle = history[(time >= 20.0) & (time < 40.0)]
    gain = np.sqrt(2.0 * np.mean(middle**2))
    assert_allclose(gain, np.abs(response("Wk", frequency)), rtol=1e-3)


@pytest.mark.parametrize("cycles", [1, 16])
def test_the_standards_burst(cycles):
    """Oracle: ISO 8041-1 Table 8, saw-tooth of 1 m/s2 and 100 rad/s at 1 s and every 10 s for 60 s.

    Printed to three digits; sampling the saw-tooth's edges at 10 kHz errs by 1e-3 at most.
    """
    step = 1e-4
    time, acceleration = np.arange(0.0, 60.0, step), np.zeros(600_000)
    for begin in range(1, 60, 10):
        turns = (time - begin) * 100.0 / (2 * np.pi)
        inside = (turns >= 0) & (turns < cycles)
        acceleration[inside] = 2.0 * ((turns[inside] + 0.5) % 1.0) - 1.0
    history = weighted(acceleration, step, "Wk")
    found = (
        np.sqrt(np.mean(history**2)),
        vibration_dose(history, step),
        running_rms(history, step).max(),
        running_rms(history, step, "exponential").max(),
    )
    assert_allclose(found, BURST[cycles], rtol=3e-3)


def test_the_dose_of_a_sine_is_its_closed_form():
    """Oracle: (3/8 a^4 T)^(1/4) over whole periods."""
    time = np.linspace(0.0, 10.0, 10_001)
    history = 0.7 * np.sin(2 * np.pi * 3.0 * time)
    assert_allclose(vibration_dose(history, 0.001), (0.375 * 0.7**4 * 10.0) ** 0.25, rtol=1e-9)


def test_the_running_rms_of_a_step_rises_within_its_second():
    """Oracle: sqrt(t) up to 1 s, then 1; exponentially sqrt(1 - exp(-t))."""
    step = 0.001
    time = step * np.arange(1, 4001)
    history = np.ones(4000)
    assert_allclose(running_rms(history, step), np.sqrt(np.minimum(time, 1.0)), rtol=1e-9)
    slow = running_rms(history, step, "exponential")
    assert_allclose(slow, np.sqrt(1.0 - np.exp(-time)), rtol=1e-9)
