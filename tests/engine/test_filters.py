import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.filters import (
    ORDER,
    high_pass,
    in_band,
    is_uniform,
    low_pass,
    noise_gain,
    smoothed,
    too_coarse,
)

CUTOFF, STEP = 20.0, 0.005


def gain(frequency):
    """Two passes of a discrete Butterworth filter (bilinear transform), closed form."""
    ratio = np.tan(np.pi * frequency * STEP) / np.tan(np.pi * CUTOFF * STEP)
    return 1.0 / (1.0 + ratio ** (2 * ORDER))


def test_a_sine_keeps_its_phase_and_loses_the_amplitude_of_the_closed_form():
    """Oracle: |H|^2 of the filter. Away from the ends nothing else is left of a sine."""
    time = np.arange(0.0, 10.0, STEP)
    inner = slice(400, -400)
    for frequency in (1.0, 12.0, 20.0, 40.0):
        sine = np.sin(2 * np.pi * frequency * time)
        filtered = low_pass(time, sine, CUTOFF)
        assert_allclose(filtered[inner], gain(frequency) * sine[inner], rtol=0, atol=1e-6)


def test_a_straight_line_passes_unchanged_to_its_very_ends():
    """Oracle: odd reflection continues a line, and the filter's gain at zero is 1.

    What the far end of the reflection leaves decays with the slowest pole, of real part
    0.5 * 2 pi 20 / s, over three periods of 20 Hz: exp(-9.4) of the line's rise in that time.
    """
    time = np.arange(0.0, 2.0, STEP)
    line = 3.0 - 0.5 * time
    assert_allclose(low_pass(time, line, CUTOFF), line, rtol=0, atol=np.exp(-9.4) * 0.5 * 0.15)


def test_unequal_sampling_gives_what_equal_sampling_gives():
    """Oracle: the filtered sine at the same instants; the two splines of a 5 Hz sine sampled at
    5 ms err by about (2 pi 5 h)^4 / 384 = 2e-6 of it each, h the largest step."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 10.0, STEP)
    time[1:-1] += rng.uniform(-0.3, 0.3, len(time) - 2) * STEP
    assert not is_uniform(time)
    sine = np.sin(2 * np.pi * 5.0 * time)
    filtered = low_pass(time, sine, CUTOFF)
    inner = slice(400, -400)
    assert_allclose(filtered[inner], gain(5.0) * sine[inner], rtol=0, atol=2e-5)


def test_channels_are_filtered_one_by_one():
    time = np.arange(0.0, 2.0, STEP)
    both = np.column_stack([np.sin(30.0 * time), np.cos(50.0 * time)])
    filtered = low_pass(time, both, CUTOFF)
    for column in range(2):
        alone = low_pass(time, both[:, column], CUTOFF)
        assert_allclose(filtered[:, column], alone, rtol=0, atol=1e-14)


def test_a_record_too_coarse_for_the_cutoff_is_left_as_it_is():
    time = np.arange(0.0, 2.0, 0.025)
    values = np.random.default_rng(1).normal(size=len(time))
    assert too_coarse(0.025, CUTOFF)
    assert not too_coarse(STEP, CUTOFF)
    assert_allclose(smoothed(time, values, CUTOFF), values, rtol=0, atol=0)
    assert_allclose(smoothed(time, values, None), values, rtol=0, atol=0)


def test_the_high_pass_leaves_what_the_low_pass_takes():
    """Oracle: 1 - |H|^2 of the low-pass is |H|^2 of the Butterworth high-pass; a parabola t^2 is
    gone, as the filter's gain rises with the sixth power of the frequency.

    The middle of 100 periods is 50 periods from ends that are no parabola's: exp(-9.4) of three
    periods is 1e-65 of fifty, so that rounding (1e-16 of 1e4) is all that is left.
    """
    time = np.arange(0.0, 100.0, 0.01)
    sine = np.sin(2 * np.pi * 2.0 * time)
    filtered = high_pass(time, sine + (time - 50.0) ** 2 + 7.0 * time, 1.0)
    ratio = np.tan(np.pi * 2.0 * 0.01) / np.tan(np.pi * 1.0 * 0.01)
    inner = slice(3000, -3000)
    kept = ratio ** (2 * ORDER) / (1.0 + ratio ** (2 * ORDER))
    assert_allclose(filtered[inner], kept * sine[inner], rtol=0, atol=1e-8)


def test_a_band_without_ends_is_everything():
    time = np.arange(0.0, 2.0, STEP)
    values = np.sin(30.0 * time)
    assert in_band(time, values, (None, None)) is values


@pytest.mark.parametrize(
    ("band", "width"), [((None, 3.0), 3.0), ((0.5, None), 100.0), ((0.5, 3.0), 2.5)]
)
def test_noise_behind_a_filter_is_told_from_that_before(band, width):
    """Oracle: white noise through the filter; in `width` Hz T seconds of it are worth 2 T width
    samples, so that its rms scatters by 1 / sqrt(4 T width): four times."""
    noise, time = 3.0, STEP * np.arange(400_000)
    values = np.random.default_rng(5).normal(scale=noise, size=len(time))
    found = np.sqrt(np.mean(in_band(time, values, band) ** 2))
    scatter = 1.0 / np.sqrt(4.0 * time[-1] * width)
    assert_allclose(noise * noise_gain(time, band), found, rtol=4.0 * scatter)


def test_the_noise_that_a_low_pass_leaves_is_that_of_the_closed_form():
    """Oracle: the integral of 1 / (1 + x^6)^2 over x >= 0, (5/6) (pi/6) / sin(pi/6), of the share
    of the cutoff in the Nyquist frequency; the bilinear transform moves 1 Hz by (pi / 200)^2 / 3
    of it."""
    time = STEP * np.arange(1000)
    share = 5.0 / 6.0 * (np.pi / 6.0) / np.sin(np.pi / 6.0) * 1.0 / 100.0
    assert_allclose(noise_gain(time, (None, 1.0)) ** 2, share, rtol=1e-3)
    assert noise_gain(time, (None, None)) == 1.0
    assert noise_gain(time[::5], (None, CUTOFF)) == 1.0  # too coarse to be filtered
