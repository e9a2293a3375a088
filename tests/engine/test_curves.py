"""Oracle: the closed forms, and derivatives by central differences."""

import numpy as np
from numpy.testing import assert_allclose
from ridetune.engine.curves import SweptSine, smooth_step


def test_a_smooth_step_is_level_with_no_curvature_at_both_ends():
    """Oracle: 6 s^5 - 15 s^4 + 10 s^3 is at most 10 s^3 off its ends, and symmetric."""
    small = np.array([1e-3, 1e-2])
    assert np.all(smooth_step(small) <= 10 * small**3)
    s = np.linspace(0, 1, 21)
    assert_allclose(smooth_step(s) + smooth_step(1 - s), 1.0, rtol=1e-14)
    assert_allclose(smooth_step([-1.0, 0.0, 1.0, 7.0]), [0, 0, 1, 1])


def test_a_sweep_has_the_stated_frequency_at_every_time():
    """Oracle: dphi/dt = 2 pi f1 (f2/f1)^(t/T), by differences of relative error below 1e-6."""
    sweep = SweptSine(span=40.0, first=0.3, last=20.0, amplitude=1.0, last_amplitude=1.0)
    t, h = np.linspace(0.1, 39.9, 200), 1e-4
    rate = (sweep.phase(t + h) - sweep.phase(t - h)) / (2 * h)
    assert_allclose(rate, 2 * np.pi * 0.3 * (20 / 0.3) ** (t / 40), rtol=1e-6)


def test_a_sweep_of_one_frequency_is_a_sine():
    sweep = SweptSine(span=10.0, first=2.0, last=2.0, amplitude=0.1, last_amplitude=0.1)
    t = np.linspace(0.6, 7.9, 1000)
    assert_allclose(sweep(t), 0.1 * np.sin(4 * np.pi * t), atol=1e-12)


def test_a_sweep_rests_before_and_after_and_keeps_within_its_amplitudes():
    sweep = SweptSine(span=20.0, first=0.5, last=10.0, amplitude=0.02, last_amplitude=0.001)
    assert_allclose(sweep(np.array([-1.0, 0.0, 20.0, 25.0])), 0.0, atol=1e-15)
    t = np.linspace(0, 20, 20001)
    bound = 0.02 * (0.001 / 0.02) ** (t / 20)
    assert np.all(np.abs(sweep(t)) <= bound * (1 + 1e-12))
    middle = (t > 2) & (t < 19.5)
    assert np.max(np.abs(sweep(t)[middle]) / bound[middle]) > 0.9999
