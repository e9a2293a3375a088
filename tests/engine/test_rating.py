"""The rating of ISO/TS 18571 against closed forms and against every warping path there is."""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.rating import best_shift, rate, rate_samples, warped_error

TIME = np.arange(0.0, 5.0, 0.005)
WAVE = np.sin(2.0 * np.pi * 0.7 * TIME) * np.exp(-0.3 * TIME)


def test_identical_histories_are_rated_one():
    rating = rate(TIME, WAVE, WAVE)
    scores = (rating.overall, rating.corridor, rating.phase, rating.magnitude, rating.slope)
    assert scores == (1.0,) * 5


def test_the_slope_of_a_scaled_history_is_off_by_its_factor():
    """Oracle: C = 1.3 T, so |C' - T'| / |T'| = 0.3 and the score 1 - 0.3 / 2; no shift."""
    rating = rate_samples(WAVE, 1.3 * WAVE)
    assert rating.phase == 1.0
    assert_allclose(rating.slope, 0.85, rtol=1e-12)
    share = (0.5 - 0.3 * np.abs(WAVE) / np.max(np.abs(WAVE))) / 0.45
    assert_allclose(rating.corridor, np.mean(np.minimum(share, 1.0) ** 2), rtol=1e-12)
    # Warping may only bring the two nearer than the 0.3 by which they differ unwarped.
    assert 1.0 - 0.3 / 0.5 <= rating.magnitude < 1.0


@pytest.mark.parametrize("late", [-35, 80])
def test_a_delay_costs_phase_alone(late):
    """Oracle: a history cut from the same longer one, 1000 samples of which 200 may be shifted."""
    rng = np.random.default_rng(1)
    long = np.cumsum(rng.normal(size=1400))
    t, c = long[200:1200], long[200 - late : 1200 - late]
    assert best_shift(t, c) == late
    rating = rate_samples(t, c)
    assert_allclose(rating.phase, 1.0 - abs(late) / 200.0)
    assert (rating.magnitude, rating.slope) == (1.0, 1.0)


def test_an_opposite_history_is_worth_little():
    rating = rate_samples(WAVE, -WAVE + 3.0)
    assert rating.corridor == 0.0
    assert rating.magnitude == 0.0


@pytest.mark.parametrize("band", [1, 4])
def test_the_warping_path_is_the_best_of_all(band):
    """Oracle: every monotone path within the band, by its squared differences."""
    rng = np.random.default_rng(band)
    c, t = rng.normal(size=(2, 5))
    least = min(
        (sum((c[i] - t[j]) ** 2 for i, j in path), path) for path in paths(5) if within(path, band)
    )
    error, size = warped_error(c, t, band)
    assert_allclose(error, sum(abs(c[i] - t[j]) for i, j in least[1]))
    assert_allclose(size, sum(abs(t[j]) for _, j in least[1]))


def paths(count):
    """All warping paths of two histories of `count` samples."""
    steps = [(1, 0), (0, 1), (1, 1)]
    for length in range(count - 1, 2 * count - 1):
        for chosen in itertools.product(steps, repeat=length):
            path = [(0, 0)]
            for di, dj in chosen:
                path.append((path[-1][0] + di, path[-1][1] + dj))
            if path[-1] == (count - 1, count - 1):
                yield path


def with_one(value):
    """The wave with one sample that is no number."""
    return np.concatenate([WAVE[:7], [value], WAVE[8:]])


def within(path, band):
    return all(abs(i - j) <= band for i, j in path)


@pytest.mark.parametrize(
    ("measured", "simulated"),
    [
        (np.ones_like(TIME), WAVE),
        (np.zeros_like(TIME), np.zeros_like(TIME)),
        (with_one(np.nan), WAVE),
        (WAVE, with_one(np.inf)),
    ],
    ids=["constant", "zero", "gap measured", "gap simulated"],
)
def test_where_the_standard_says_nothing_there_is_no_rating(measured, simulated):
    assert rate(TIME, measured, simulated) is None


def test_a_flat_simulation_is_rated_and_a_short_record_is_not():
    """Oracle: nothing correlates, so nothing is shifted; all slope is missed: 1 - 1 / 2."""
    rating = rate(TIME, WAVE, np.zeros_like(TIME))
    assert rating.phase == 1.0
    assert rating.magnitude == 0.0
    assert_allclose(rating.slope, 0.5)
    assert rate(TIME[:19], WAVE[:19], WAVE[:19]) is None


def test_a_record_sampled_otherwise_is_rated_alike():
    """Oracle: the same curves on their own grid; linear interpolation between 1 ms samples."""
    fine = np.arange(0.0, 4.9951, 0.001)
    t, c = (np.interp(fine, TIME, values) for values in (WAVE, 1.2 * np.roll(WAVE, 20)))
    assert_allclose(
        rate(fine, t, c).overall, rate(TIME, WAVE, 1.2 * np.roll(WAVE, 20)).overall, atol=1e-9
    )
