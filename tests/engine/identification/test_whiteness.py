"""Bartlett's test of residuals."""

import numpy as np
import pytest
from ridetune.engine.identification.fit import Whiteness
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.identification.uncertainty import RunResiduals
from ridetune.engine.identification.whiteness import whiteness, whiteness_findings
from ridetune.engine.parameters import DAMPER_NAMES
from ridetune.engine.simulation.rims_settings import RimsSettings
from scipy.signal import lfilter
from scipy.stats import kstest

from ... import stand_in

CAR = stand_in.REFERENCE
SETTINGS = RimsSettings()


def bartlett(residuals, settings=SETTINGS):
    residuals = np.atleast_2d(residuals)
    run = RunResiduals(residuals, np.zeros((*residuals.shape, 1)), 0.005)
    return whiteness("lap", ["chassis.z"], run, settings)[0]


def test_p_of_white_noise_is_uniform():
    """Oracle: the definition of p. Kolmogorov's limit is conservative by a hundredth here; 200
    values are told from uniform at a distance of 1.63 / sqrt(200) in a hundredth of all cases."""
    rng = np.random.default_rng(0)
    values = [bartlett(rng.normal(size=2000)).p for _ in range(200)]
    assert kstest(values, "uniform").statistic < 1.63 / np.sqrt(200)


def test_the_statistic_of_a_single_tone_is_the_share_of_frequencies_on_its_further_side():
    """Oracle: all power at frequency j of q steps the cumulative periodogram from 0 to 1 there."""
    time = np.arange(1000)
    for j in (20, 400):
        tone = np.cos(2.0 * np.pi * j * time / 1000)
        assert bartlett(tone).statistic == pytest.approx(
            max((j - 1) / 499, 1.0 - j / 499), abs=1e-9
        )


def test_slow_residuals_are_far_from_white_and_worth_few_samples():
    """Oracle: an autoregression with p = 0.95 counts for (1 - p^2)/(1 + p^2) = 5 % of its
    samples; the sampled correlations and Bartlett's weights leave a factor 2."""
    noise = np.random.default_rng(1).normal(size=8000)
    found = bartlett(lfilter([1.0], [1.0, -0.95], noise))
    assert found.p < 1e-12
    assert 0.025 < found.effective_samples / found.samples < 0.1
    assert found.samples == 8000
    (sentence,) = whiteness_findings((found,))
    assert sentence.startswith("The residuals are not noise in chassis.z of run lap:")
    assert f"the 8000 samples are worth {found.effective_samples:.0f}." in sentence
    assert "two-slope dampers, if it has them: free rho_F, v_F, rho_R and v_R" in sentence
    assert "two-slope" not in whiteness_findings((found,), DAMPER_NAMES)[0]


def test_filtered_white_noise_is_white_where_the_filter_leaves_it():
    """Oracle: noise without power above 20 Hz, white below, and none below 5 Hz."""
    spectrum = np.fft.rfft(np.random.default_rng(2).normal(size=4000))
    spectrum[np.fft.rfftfreq(4000, 0.005) > 20.0] = 0.0
    filtered = np.fft.irfft(spectrum)
    assert bartlett(filtered).p < 1e-12
    assert bartlett(filtered, RimsSettings(output_cutoff_hz=20.0)).p > 0.01
    slow = np.fft.rfftfreq(4000, 0.005) < 5.0
    spectrum = np.where(slow, 0.0, np.fft.rfft(np.random.default_rng(3).normal(size=4000)))
    filtered = np.fft.irfft(spectrum)
    # The step of 0.05 over 2000 frequencies: p = 2 exp(-2 * 2000 * 0.05^2) = 1e-4.
    assert bartlett(filtered).p < 1e-3
    assert bartlett(filtered, RimsSettings(output_highpass_hz=5.0)).p > 0.01


def test_a_fit_tells_of_what_its_model_misses_and_of_nothing_else():
    """Oracle: white noise, and the same with a slow motion that no parameter makes."""

    def drifting(cars, inputs, traction):
        drift = 5e-3 * np.sin(0.7 * inputs.time)[:, np.newaxis]
        return stand_in.simulate(cars, inputs, traction) + drift * [1.0, 0.0, 0.0]

    problem = Problem.build(CAR, [stand_in.recording(CAR, seed=3)], ["K_F"])
    white = identify(problem, simulate=stand_in.simulate)
    assert [(one.run, one.channel) for one in white.whiteness] == [
        ("lap", channel) for channel in ("chassis.z", "chassis.pitch", "chassis.roll")
    ]
    assert min(one.p for one in white.whiteness) > 1e-3
    assert not white.warnings
    missed = identify(problem, simulate=drifting)
    assert "not noise in chassis.z of run lap" in " ".join(missed.warnings)
    assert "not noise in chassis.pitch" not in " ".join(missed.warnings)
    assert "or noise of the wheels or of a_x comes through" in " ".join(missed.warnings)


def test_nothing_is_said_of_a_channel_of_little_colour_or_of_rounding():
    assert not whiteness_findings((Whiteness("lap", "chassis.z", 1.0, 0.1, 1e-9, 900.0, 1000),))
    assert not whiteness_findings((Whiteness("lap", "chassis.z", 0.01, 0.9, 1e-9, 9.0, 1000),))
