"""Zero-phase low-pass and high-pass of a recorded channel, for any sampling.

A Butterworth low-pass in second-order sections runs forwards and backwards over the record
(`scipy.signal.sosfiltfilt`), so the phase is zero and the amplitude at frequency f is

    |H(f)|^2 = 1 / (1 + (f / f_c)^(2 n)),        n = ORDER,

one half at the cutoff f_c. The ends are extended by odd reflection over three periods of the
cutoff. A record that is not uniform is first carried by a cubic spline to a uniform grid of as many
samples, filtered there, and carried back.

ORDER is a compromise between two errors of a low acceleration record whose content reaches wheel
hop (12 Hz) under a 20 Hz cutoff: a low order takes off amplitude at hop, a high one rings longer
at jumps. docs/identification.md has the figures.

The high-pass is what the low-pass takes away, |H|^2 = (f / f_c)^(2 n) / (1 + (f / f_c)^(2 n)). It
takes off any straight line, and what drifts as time to a power up to 2 n - 1.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, freqz_sos, sosfiltfilt

Array = NDArray[np.float64]
Band = tuple[float | None, float | None]
"""Lowest and highest frequency, Hz."""

ORDER = 3
"""Order of the Butterworth filter in each of the two passes."""

PAD_PERIODS = 3.0
"""Length of the reflected ends, in periods of the cutoff."""

UNIFORM_TOLERANCE = 0.01
"""A record counts as uniform when no step differs from the mean by more than this share."""


FREQUENCIES = 2**14
"""Around the unit circle, at which a filter's gain is averaged."""


def is_uniform(time: Array) -> bool:
    """Whether the samples are equally spaced, up to the rounding of a text file."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    return bool(np.all(np.abs(np.diff(time) - step) <= UNIFORM_TOLERANCE * step))


def too_coarse(step: float, cutoff: float) -> bool:
    """Whether a cutoff (Hz) lies above 0.9 of the Nyquist frequency of a sample step (s)."""
    return cutoff >= 0.45 / step


def low_pass(time: Array, values: Array, cutoff: float, *, order: int = ORDER) -> Array:
    """The record `values` (samples,) or (samples, channels) without its content above `cutoff`, Hz.

    time : (samples,) strictly increasing, s; the mean step must not be `too_coarse` for the cutoff
    order : n, of each of the two passes
    """
    if is_uniform(time):
        return _low_pass_uniform(time, values, cutoff, order)
    grid = np.linspace(time[0], time[-1], len(time))
    filtered = _low_pass_uniform(grid, CubicSpline(time, values)(grid), cutoff, order)
    return CubicSpline(grid, filtered)(time)


def smoothed(time: Array, values: Array, cutoff: float | None) -> Array:
    """`low_pass`, or the record as it is without a cutoff or where the sampling is too coarse."""
    if cutoff is None or too_coarse(float(time[-1] - time[0]) / (len(time) - 1), cutoff):
        return values
    return low_pass(time, values, cutoff)


def high_pass(time: Array, values: Array, cutoff: float) -> Array:
    """The record without its content below `cutoff`, Hz; arguments as of `low_pass`."""
    return values - low_pass(time, values, cutoff)


def slow_part(time: Array, values: Array, cutoff: float) -> Array:
    """`low_pass` of a record (samples,) whose last sample is mostly noise.

    A straight line is fitted and passes as it is; the rest is continued by even reflection, which,
    other than the odd one, does not turn about what one sample happens to read.
    """
    line = np.polyval(np.polyfit(time - time[0], values, 1), time - time[0])
    periods = (time[-1] - time[0]) * cutoff
    pad = min(len(time) - 1, math.ceil(PAD_PERIODS * (len(time) - 1) / periods))
    rest = values - line
    after = 2.0 * time[-1] - time[-2 : -pad - 2 : -1]
    before = 2.0 * time[0] - time[pad:0:-1]
    longer = np.concatenate([before, time, after])
    mirrored = np.concatenate([rest[pad:0:-1], rest, rest[-2 : -pad - 2 : -1]])
    return line + low_pass(longer, mirrored, cutoff)[pad : pad + len(time)]


def resolved(time: Array, cutoff: float) -> bool:
    """Whether a record is long enough to tell what lies below `cutoff`, Hz, from what does not."""
    return (time[-1] - time[0]) * cutoff >= PAD_PERIODS


def in_band(time: Array, values: Array, band: Band) -> Array:
    """The record between two frequencies, Hz, either of which may be None for no end."""
    low, high = band
    values = smoothed(time, values, high)
    return values if low is None else high_pass(time, values, low)


def noise_gain(time: Array, band: Band) -> float:
    """Rms of white noise behind `in_band` over that before it, but for the ends of the record."""
    low, high = band
    rate = float((len(time) - 1) / (time[-1] - time[0]))
    gain = np.ones(FREQUENCIES)
    if high is not None and not too_coarse(1.0 / rate, high):
        gain = _low_pass_gain(high, rate)
    if low is not None:
        gain = gain * (1.0 - _low_pass_gain(low, rate))
    return float(np.sqrt(np.mean(gain**2)))


def _low_pass_gain(cutoff: float, rate: float) -> Array:
    """Amplitude behind both passes, around the unit circle."""
    _, response = freqz_sos(_sections(cutoff, rate, ORDER), FREQUENCIES, whole=True)
    return np.abs(response) ** 2


def _low_pass_uniform(time: Array, values: Array, cutoff: float, order: int) -> Array:
    rate = (len(time) - 1) / (time[-1] - time[0])
    sections = _sections(cutoff, float(rate), order)
    pad = min(len(time) - 1, math.ceil(PAD_PERIODS * rate / cutoff))
    return sosfiltfilt(sections, values, axis=0, padtype="odd", padlen=pad)


@lru_cache(maxsize=64)
def _sections(cutoff: float, rate: float, order: int) -> Array:
    """The filter for a cutoff and a sampling rate, Hz; its design takes as long as its use."""
    return np.asarray(butter(order, cutoff, fs=rate, output="sos"))
