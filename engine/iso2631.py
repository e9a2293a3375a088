"""Frequency weightings of whole-body vibration and the figures that rest on them, ISO 2631-1.

    H = Hh Hl Ht Hs,    s = 2 pi i f,  w_k = 2 pi f_k
    Hh = 1/(1 + w1/(Q1 s) + (w1/s)^2)                           high pass, f1 = 0.4 Hz
    Hl = 1/(1 + s/(Q2 w2) + (s/w2)^2)                           low pass, f2 = 100 Hz
    Ht = (1 + s/w3)/(1 + s/(Q4 w4) + (s/w4)^2)                  from acceleration to velocity
    Hs = (1 + s/(Q5 w5) + (s/w5)^2)/(1 + s/(Q6 w6) + (s/w6)^2) (w5/w6)^2      upward step

with Q1 = Q2 = 1/sqrt 2. The weighting is applied to the spectrum of a whole record, so it is the
formula's at every sampling rate: no bilinear transform bends it near the Nyquist frequency, which
for 5 ms samples is f2 itself. The record counts as zero before its beginning and zeros are
appended so that the filter's end does not wrap around into the beginning.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import next_fast_len
from scipy.integrate import trapezoid
from scipy.signal import lfilter

Array = NDArray[np.float64]
Weighting = Literal["Wk", "Wd", "We", "Wc"]

FIRST, LAST = 0.4, 100.0
"""f1 and f2, Hz."""

ROOT_HALF = 0.5**0.5
"""Q1 and Q2."""

SETTLING = 20.0
"""Zeros appended to a record, s; the high pass decays by 1/e in 0.6 s."""

RUNNING_TIME = 1.0
"""Integration time of the running rms, s."""


@dataclass(frozen=True, slots=True)
class Shape:
    """Corner frequencies (Hz) and quality factors of Ht and of Hs, where there is one."""

    f3: float
    f4: float
    q4: float
    step: tuple[float, float, float, float] | None = None


SHAPES: dict[Weighting, Shape] = {
    "Wk": Shape(12.5, 12.5, 0.63, step=(2.37, 0.91, 3.35, 0.91)),
    "Wd": Shape(2.0, 2.0, 0.63),
    "We": Shape(1.0, 1.0, 0.63),
    "Wc": Shape(8.0, 8.0, 0.63),
}
"""Wk: vertical at seat and feet. Wd: horizontal at the seat. We: rotation. Wc: seat back."""


def response(weighting: Weighting, frequency: ArrayLike) -> NDArray[np.complex128]:
    """H at some frequencies (Hz); 0 at 0 Hz."""
    shape = SHAPES[weighting]
    f = np.asarray(frequency, dtype=float)
    s = 1j * np.where(f == 0.0, 1.0, f)
    high = 1.0 / (1.0 + FIRST / (ROOT_HALF * s) + (FIRST / s) ** 2)
    low = 1.0 / _resonance(s, LAST, ROOT_HALF)
    transition = (1.0 + s / shape.f3) / _resonance(s, shape.f4, shape.q4)
    step = 1.0
    if shape.step is not None:
        f5, q5, f6, q6 = shape.step
        step = _resonance(s, f5, q5) / _resonance(s, f6, q6) * (f5 / f6) ** 2
    return np.where(f == 0.0, 0.0, high * low * transition * step)


def _resonance(s: NDArray, corner: float, quality: float) -> NDArray:
    """1 + s/(Q w) + (s/w)^2, with s and w both in Hz."""
    return 1.0 + s / (quality * corner) + (s / corner) ** 2


def weighted(acceleration: Array, step: float, weighting: Weighting) -> Array:
    """The weighted history of an acceleration (n,) sampled every `step` seconds."""
    count = acceleration.size
    size = int(next_fast_len(count + math.ceil(SETTLING / step), real=True) or 0)
    spectrum = np.fft.rfft(acceleration, size)
    return np.fft.irfft(spectrum * _spectrum_response(weighting, size, step), size)[:count]


@lru_cache(maxsize=8)
def _spectrum_response(weighting: Weighting, size: int, step: float) -> NDArray[np.complex128]:
    """H at the frequencies of a spectrum, which takes as long to find as to use."""
    return response(weighting, np.fft.rfftfreq(size, step))


def vibration_dose(history: Array, step: float) -> float:
    """VDV of a weighted acceleration, m/s^1.75: (integral of a^4 dt)^(1/4)."""
    # A power of four is two squares; as a power numpy takes ten times as long over it.
    return float(trapezoid(np.square(np.square(history)), dx=step) ** 0.25)


def running_rms(
    history: Array, step: float, average: Literal["linear", "exponential"] = "linear"
) -> Array:
    """Root of the mean square over the last RUNNING_TIME; zero before the record begins."""
    if average == "exponential":
        keep = np.exp(-step / RUNNING_TIME)
        return np.sqrt(lfilter([1.0 - keep], [1.0, -keep], history**2))
    window = max(round(RUNNING_TIME / step), 1)
    total = np.concatenate([np.zeros(window), np.cumsum(history**2)])
    return np.sqrt(np.maximum(total[window:] - total[:-window], 0.0) / window)
