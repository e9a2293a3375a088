"""Whether residuals are white: noise, or something that the model misses.

Bartlett's test of the cumulative periodogram (Bartlett, An Introduction to Stochastic Processes,
1955, 9.22; Durbin, Biometrika 56, 1969). With the periodogram I_j at the frequencies j = 1 ... q
below half the sampling rate,

    D = max |sum_{i <= j} I_i / sum_{i <= q} I_i - j / q|,

and for white noise sqrt(q - 1) D follows Kolmogorov's distribution. It looks at all time scales at
once and takes no number of lags. Where the outputs are filtered, only frequencies that the filter
leaves alone count.
"""

from collections.abc import Collection, Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.stats import kstwobign

from ..parameters import DAMPER_NAMES, parameter
from ..simulation.rims_settings import RimsSettings
from ..units import listed
from .fit import Whiteness
from .uncertainty import RunResiduals, bandwidth, effective_samples

Array = NDArray[np.float64]

UNTOUCHED = 0.5
"""Share of a low-pass's cutoff up to which it takes less than 2 % off the amplitude; a high-pass
does so from its cutoff over this share on."""

FEWEST_FREQUENCIES = 10
DOUBTFUL = 1e-6
"""Probability of such residuals, were they white, below which ..."""

FEW_EFFECTIVE = 0.5
"""... and share of effective samples below which something is said, ..."""

LEAST_RMS = 0.1
"""... unless the residuals are smaller than this share of the noise: rounding has a colour too."""


def whiteness(
    name: str, channels: list[str], run: RunResiduals, settings: RimsSettings
) -> list[Whiteness]:
    """One test a channel of a run; none where there are too few frequencies to tell."""
    width = bandwidth(run.residuals, run.step)
    found = []
    for channel, residuals in zip(channels, run.residuals, strict=True):
        periodogram = np.abs(np.fft.rfft(residuals)[1 : (len(residuals) + 1) // 2]) ** 2
        low, high = settings.output_band
        lasts = run.step * len(residuals)
        first = 0 if low is None else int(low / UNTOUCHED * lasts)
        last = len(periodogram) if high is None else int(UNTOUCHED * high * lasts)
        periodogram = periodogram[first:last]
        q, power = len(periodogram), float(np.sum(periodogram))
        if q < FEWEST_FREQUENCIES or power == 0.0:
            continue
        share = np.cumsum(periodogram) / power
        statistic = float(np.max(np.abs(share - np.arange(1, q + 1) / q)))
        found.append(
            Whiteness(
                run=name,
                channel=channel,
                rms=float(np.sqrt(np.mean(residuals**2))),
                statistic=statistic,
                p=float(kstwobign.sf(np.sqrt(q - 1) * statistic)),
                effective_samples=min(effective_samples(residuals, width), len(residuals)),
                samples=len(residuals),
            )
        )
    return found


def far_from_white(tests: Iterable[Whiteness]) -> list[Whiteness]:
    """Those of channels in which the model misses more than noise."""
    return [
        one
        for one in tests
        if one.p < DOUBTFUL
        and one.effective_samples < FEW_EFFECTIVE * one.samples
        and one.rms > LEAST_RMS
    ]


def whiteness_findings(tests: tuple[Whiteness, ...], free: Collection[str] = ()) -> list[str]:
    """A sentence where residuals are far from white.

    free : the parameters' names; what the model could still be given is what is not among them
    """
    if not (coloured := far_from_white(tests)):
        return []
    where: dict[str, list[str]] = {}
    for one in coloured:
        where.setdefault(one.run, []).append(one.channel)
    named = "; ".join(f"{', '.join(channels)} of run {run}" for run, channels in where.items())
    effective = sum(one.effective_samples for one in tests)
    kept = [parameter(name).symbol for name in DAMPER_NAMES if name not in free]
    remedy = f" (two-slope dampers, if it has them: free {listed(kept)})" if kept else ""
    samples = sum(one.samples for one in tests)
    return [
        f"The residuals are not noise in {named}: the model misses something there{remedy}, or "
        "noise of the wheels or of a_x comes through the car, and may bias the parameters beyond "
        f"their error bars; the {samples} samples are worth {effective:.0f}."
    ]
