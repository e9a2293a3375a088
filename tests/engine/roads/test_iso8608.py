"""Random roads have the spectrum, the coherence and the reproducibility that they claim.

Statistical tolerances are four standard deviations of the estimator. A wave of the synthesis has an
exponentially distributed power, so the power summed over many waves of variance s_k scatters by
sqrt(sum s_k^2); the mean over N seeds by 1/sqrt(N) of it.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.errors import RoadError
from ridetune.engine.roads.iso8608 import (
    CLASSES,
    SPACING,
    Roughness,
    coherence,
    iso_road,
    mean_square,
)
from scipy import signal
from scipy.interpolate import CubicSpline
from scipy.special import k1

BAND = (0.011, 2.83)
PERIOD = 2048.0
LONG = 2000.0


def test_classes_are_the_geometric_means_of_the_standard():
    """Oracle: the standard's table, not the upper limits, which are twice as much."""
    table = {"A": 16, "B": 64, "C": 256, "D": 1024, "E": 4096, "F": 16384, "G": 65536, "H": 262144}
    assert list(CLASSES) == list(table)
    assert_allclose(list(CLASSES.values()), 1e-6 * np.array(list(table.values())), rtol=1e-12)


@pytest.mark.parametrize(("letter", "rms"), [("A", 3.81), ("B", 7.61), ("C", 15.23), ("D", 30.45)])
def test_rms_over_the_reference_band_is_the_tabulated_one(letter, rms):
    """Oracle: rms elevation in mm by class, printed to 0.005 mm."""
    assert_allclose(1e3 * np.sqrt(mean_square(CLASSES[letter], BAND)), rms, rtol=0, atol=0.0051)


@pytest.mark.parametrize("waviness", [1.0, 1.7, 2.0, 3.0])
def test_mean_square_is_the_integral_of_the_spectrum(waviness):
    """Oracle: trapezoidal rule on a logarithmic grid fine enough for 1e-6."""
    n = np.geomspace(*BAND, 20001)
    expected = np.trapezoid(16e-6 * (n / 0.1) ** -waviness, n)
    assert_allclose(mean_square(16e-6, BAND, waviness), expected, rtol=1e-6)


def test_many_metres_of_road_have_the_class_rms():
    """Oracle: the closed form. Bins near 0.011 cycle/m dominate: 12 % scatter a seed."""
    seeds = 40
    squares = []
    for seed in range(seeds):
        road = iso_road([("C", 0.0)], LONG, seed)
        squares += [np.mean(road.left**2), np.mean(road.right**2)]
    waves = np.arange(round(BAND[0] * PERIOD), round(BAND[1] * PERIOD)) / PERIOD
    scatter = np.sqrt(np.sum(waves**-4.0)) / np.sum(waves**-2.0) / np.sqrt(seeds)
    expected = mean_square(256e-6, BAND)
    assert_allclose(np.mean(squares), expected, rtol=4 * scatter)
    assert 4 * scatter < 0.1


def test_the_spectrum_has_the_level_of_its_class_in_every_octave():
    """Oracle: Gd(n) by Welch's method; an octave from n holds n * LONG waves a seed.

    The Hann window of 205 m spreads a bin over 0.005 cycle/m, which on n^-2 raises the lowest
    octave by 1 %.
    """
    seeds, spectra = 12, []
    for seed in range(seeds):
        road = iso_road([("B", 0.0)], LONG, seed)
        for track in (road.left, road.right):
            n, psd = signal.welch(track[40:], fs=1 / SPACING, nperseg=4096)
            spectra.append(psd)
    ratio = np.mean(spectra, axis=0)[1:] / (64e-6 * (n[1:] / 0.1) ** -2)
    for low in (0.05, 0.1, 0.2, 0.4, 0.8, 1.6):
        octave = (n[1:] >= low) & (n[1:] < min(2 * low, 2.7))
        scatter = 1 / np.sqrt(seeds * LONG * (min(2 * low, 2.7) - low))
        assert_allclose(ratio[octave].mean(), 1.0, rtol=0, atol=4 * scatter + 0.01)


def test_nothing_is_outside_the_band():
    """Oracle: on one period of the synthesis, waves outside the band are rounding."""
    road = iso_road([("A", -2.0)], PERIOD - SPACING, 3, Roughness(band=(0.1, 1.0)))
    inside = road.left[40:]
    assert inside.size == round(PERIOD / SPACING)
    power = np.abs(np.fft.rfft(inside)) ** 2
    n = np.fft.rfftfreq(inside.size, SPACING)
    outside = (n < 0.0995) | (n > 1.0005)
    assert power[outside].max() < 1e-20 * power.max()


@pytest.mark.parametrize("law", ["exponential", "isotropic", "none", "full"])
def test_left_and_right_have_the_stated_coherence(law):
    """Oracle: scipy.signal.coherence, which returns g^2, averaged over octaves.

    An octave holds length * width independent waves, so its mean scatters by
    sqrt(2/waves) g (1 - g^2). The bias of K segments is (1 - g^2)^2 / K (Bendat and Piersol); half
    overlapping Hann segments count 1.9-fold, and over the few bins of the lowest octave the bias
    scatters by half of itself.
    """
    roughness, length = Roughness(coherence=law), 16_000.0
    road = iso_road([("A", 0.0)], length, 7, roughness)
    n, squared = signal.coherence(road.left, road.right, fs=1 / SPACING, nperseg=2048)
    segments = road.left.size / 2048
    for low in (0.05, 0.1, 0.2, 0.4, 0.8):
        octave = (n >= low) & (n < 2 * low)
        g = coherence(n[octave], roughness)
        spread = np.sqrt(2 / (length * low)) * np.mean(g * (1 - g**2))
        bias = np.mean((1 - g**2) ** 2) / (1.9 * segments)
        expected = np.mean(g**2) + bias
        tolerance = 4 * (spread + 0.5 * bias) + 1e-9
        assert_allclose(squared[octave].mean(), expected, rtol=0, atol=tolerance)


def test_coherence_laws_have_their_closed_forms():
    """Oracle: exp(-1.44 n); q K1(q), q = 2 pi b n, for w = 2; both 1 at n = 0 and falling."""
    n = np.array([0.0, 0.01, 0.1, 0.5, 2.0])
    assert_allclose(coherence(n, Roughness()), np.exp(-1.44 * n))
    isotropic = coherence(n, Roughness(coherence="isotropic", track=1.5))
    q = 2 * np.pi * 1.5 * n[1:]
    assert_allclose(isotropic[1:], q * k1(q), rtol=1e-12)
    assert_allclose(isotropic[0], 1.0, rtol=1e-9)
    assert np.all(np.diff(isotropic) < 0)


def test_same_seed_same_road_and_another_seed_another():
    sections = [("A", 1.3), ("C", 40.0)]
    one, again, other = (iso_road(sections, 150.0, seed) for seed in (1, 1, 2))
    assert np.array_equal(one.left, again.left)
    assert np.array_equal(one.right, again.right)
    assert not np.allclose(one.left, other.left)
    assert not np.allclose(one.left, one.right)


def test_a_longer_road_or_another_car_continues_the_same_road():
    """Oracle: equality at shared grid points once the beginning has blended in."""
    x = SPACING * np.arange(100, 1900)
    short = iso_road([("B", 1.3)], 100.0, 4)
    for begin, length in ((1.3, 1900.0), (2.1, 100.0), (-3.0, 500.0)):
        other = iso_road([("B", begin)], length, 4)
        assert_allclose(other.height(0, x), short.height(0, x), rtol=0, atol=1e-15)


def test_the_road_is_flat_up_to_the_front_contact_and_full_2_m_later():
    """Oracle: a road that began long before."""
    contact = 1.337
    road, full = iso_road([("D", contact)], 60.0, 5), iso_road([("D", -20.0)], 60.0, 5)
    assert not road.height(0, np.linspace(-5.0, contact, 100)).any()
    assert not road.slope(0, np.linspace(-5.0, contact, 100)).any()
    later = np.arange(contact + 2.2, 60.0, 0.31)
    assert_allclose(road.height(0, later), full.height(0, later), atol=1e-7)
    begin = np.abs(road.height(0, np.linspace(contact, contact + 0.2, 20)))
    assert begin.max() < 0.01 * np.abs(full.left).max()


def test_a_class_changes_within_2_m_from_its_position():
    """Oracle: roads of one class; A to C multiplies the amplitude by sqrt(256/16) = 4."""
    changing = iso_road([("A", 1.0), ("C", 40.0)], 90.0, 6)
    only_a, only_c = (iso_road([(letter, 1.0)], 90.0, 6) for letter in "AC")
    before, after = changing.x <= 40.0, changing.x >= 42.0
    assert_allclose(changing.right[before], only_a.right[before], atol=1e-12)
    assert_allclose(changing.right[after], only_c.right[after], atol=1e-12)
    assert_allclose(only_c.right, 4.0 * only_a.right, rtol=1e-12, atol=1e-15)


def test_class_factor_scales_the_power():
    """Oracle: the lower limit of a class has half its power."""
    mean = iso_road([("C", 0.0)], 50.0, 1)
    lower = iso_road([("C", 0.0)], 50.0, 1, Roughness(class_factor=0.5))
    assert_allclose(lower.left, np.sqrt(0.5) * mean.left, rtol=1e-12, atol=1e-15)


def test_the_grid_resolves_the_shortest_wave():
    """Oracle: a sine of 2.83 cycle/m on the grid against its spline, away from the ends."""
    x, between = np.arange(0.0, 40.0, SPACING), np.linspace(10.0, 30.0, 7001)
    wave = CubicSpline(x, np.sin(2 * np.pi * 2.83 * x))(between)
    assert_allclose(wave, np.sin(2 * np.pi * 2.83 * between), rtol=0, atol=0.002)


@pytest.mark.parametrize(
    ("sections", "length", "sentence"),
    [
        ([], 10.0, "at least one section"),
        ([("J", 0.0)], 10.0, '"J" is unknown; use one of A, B, C'),
        ([("A", 5.0), ("B", 5.0)], 10.0, "put them in order"),
        ([("A", 0.0)], 1e6, "20000 m long at most"),
        ([("A", 0.0)], np.nan, "20000 m long at most"),
    ],
)
def test_impossible_random_roads_are_refused(sections, length, sentence):
    with pytest.raises(RoadError, match=sentence):
        iso_road(sections, length, 1)
