import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ridetune.engine.channels import channel
from ridetune.engine.conditioning.chain import condition
from ridetune.engine.conditioning.sampling import Cut, Despike, Fill, Resample
from ridetune.engine.errors import ConditioningError
from ridetune.engine.run import Run
from ridetune.engine.spikes import spikes

STEP = 0.002
TIME = np.arange(0.0, 10.0, STEP)


def wave(hertz):
    return np.sin(2 * np.pi * hertz * TIME)


def test_thinning_out_keeps_what_the_new_rate_holds_and_folds_nothing_back():
    """Oracle: two passes of order 8 at f_c = 40 Hz, 1 / (1 + (tan(pi f h) / tan(pi f_c h))^16).

    80 Hz would come back as 20 Hz at 100 samples a second; 2^-16 of it does.
    """
    run = Run("fast", TIME, {"chassis.z": wave(5.0), "chassis.pitch": wave(80.0)})
    thin = condition(run, [Resample(100.0)])
    assert_allclose(thin.time, np.arange(1000) / 100.0, atol=1e-12)
    inner = slice(100, -100)
    true = np.sin(2 * np.pi * 5.0 * thin.time)
    assert_allclose(thin["chassis.z"][inner], true[inner], rtol=0, atol=1e-6)
    ratio = np.tan(np.pi * 80.0 * STEP) / np.tan(np.pi * 40.0 * STEP)
    left = 1.0 / (1.0 + ratio**16)
    assert np.max(np.abs(thin["chassis.pitch"][inner])) < 1.05 * left < 1e-4


def test_uneven_samples_become_even():
    """Oracle: the sine at the new times; a cubic spline errs by (2 pi f h)^4 5 / 384 at most, h the
    largest step, here 1.6 times the usual one."""
    uneven = TIME.copy()
    uneven[1:-1] += np.random.default_rng(0).uniform(-0.3, 0.3, len(TIME) - 2) * STEP
    run = Run("uneven", uneven, {"chassis.z": np.sin(2 * np.pi * 5.0 * uneven)})
    even = condition(run, [Resample(500.0)])
    assert_allclose(np.diff(even.time), STEP, rtol=1e-9)
    bound = (2 * np.pi * 5.0 * 1.6 * STEP) ** 4 * 5.0 / 384.0
    true = np.sin(2 * np.pi * 5.0 * even.time)
    # At the very ends a spline without known slopes errs by some ten times as much.
    assert_allclose(even["chassis.z"][5:-5], true[5:-5], rtol=0, atol=2 * bound)
    assert "uneven" in even.conditioning[0].sentences[0]


def test_noise_shrinks_with_the_share_of_the_spectrum_that_is_left():
    """Oracle: white noise through the low-pass; standard deviation of 2500 samples to 3 / sqrt(2 n)
    of it, and 4 % for the filter's slope."""
    noise = np.random.default_rng(1).standard_normal(TIME.size)
    run = Run("noise", TIME, {"chassis.z": noise}, noise={"chassis.z": 1.0})
    thin = condition(run, [Resample(100.0)])
    assert thin.noise["chassis.z"] == pytest.approx(np.sqrt(2 * 40.0 * STEP))
    assert np.std(thin["chassis.z"]) == pytest.approx(thin.noise["chassis.z"], rel=0.11)


def test_gaps_are_bridged_and_counted():
    """Oracle: the sine; a cubic over 4 steps of 1 Hz errs by far less than 1e-4."""
    holed = wave(1.0)
    holed[200:203] = np.nan
    filled = condition(Run("holed", TIME, {"chassis.z": holed}), [Fill()])
    assert_allclose(filled["chassis.z"], wave(1.0), rtol=0, atol=1e-4)
    assert filled.conditioning[0].numbers["filled.chassis.z"] == 3.0
    assert filled.conditioning[0].numbers["longest_gap_s"] == pytest.approx(4 * STEP)


def test_missing_samples_are_put_back():
    there = np.delete(np.arange(TIME.size), [300, 301])
    run = Run("lossy", TIME[there], {"chassis.z": wave(1.0)[there]})
    whole = condition(run, [Fill()])
    assert_allclose(whole.time, TIME, rtol=0, atol=1e-12)
    assert_allclose(whole["chassis.z"], wave(1.0), rtol=0, atol=1e-4)


def test_spikes_go_and_so_does_the_warning_of_them():
    """Oracle: what the line between the neighbours leaves of 1 Hz, (2 pi h)^2 / 2 of it."""
    spiked = 0.01 * wave(1.0)
    spiked[[700, 1500]] += 0.3
    found = spikes(channel("chassis.z"), TIME, spiked)
    run = Run("spiked", TIME, {"chassis.z": spiked}, warnings=(*found, "another"))
    mended = condition(run, [Despike()])
    assert_allclose(
        mended["chassis.z"], 0.01 * wave(1.0), rtol=0, atol=0.01 * (2 * np.pi * STEP) ** 2
    )
    assert mended.warnings == ("another",)
    assert mended.conditioning[0].numbers == {"spikes.chassis.z": 2.0}


def test_a_cut_keeps_the_samples_between():
    run = condition(Run("long", TIME, {"chassis.z": wave(1.0)}), [Cut(2.0, 3.0)])
    assert (run.time[0], run.time[-1]) == (2.0, 3.0)
    assert_array_equal(run["chassis.z"], wave(1.0)[1000:1501])


@pytest.mark.parametrize(
    ("values", "time", "step", "sentence"),
    [
        (
            np.nan,
            2000,
            Fill(),
            r"has no values between 3\.998 and 4\.398 s, longer than 0\.1 s; cut",
        ),
        (np.nan, 0, Fill(), "chassis.z has no values at its start, which nothing bridges; cut"),
        (np.nan, 2000, Resample(100.0), r"has gaps \(not a number\) from 4 s on; fill or cut"),
        (0.0, 0, Resample(1.0), "10 samples|at least 10"),
        (0.0, 0, Cut(20.0, None), r"fewer than 10 samples lie between 20 and 9\.998 s"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_sentence(values, time, step, sentence):
    broken = wave(1.0)
    if np.isnan(values):
        broken[time : time + 199] = np.nan
    short = TIME if not isinstance(step, Resample) or np.isnan(values) else TIME[TIME < 8.0]
    run = Run("r", short, {"chassis.z": broken[: len(short)]})
    with pytest.raises(ConditioningError, match=f"^Run r, step 1, {step.kind}: .*({sentence})"):
        condition(run, [step])
