"""Random roads after ISO 8608, left and right track with a stated coherence.

The one-sided power spectral density of the elevation is Gd(n) = Gd(n0) (n/n0)^-w over the spatial
frequency n, with n0 = 0.1 cycle/m and w = 2 for the classes.

**Class "C" means the GEOMETRIC MEAN of class C** (Gd(n0) = 256e-6 m3), not its upper limit, which
is twice the power; several published generators use the upper limits. `class_factor` scales the
power: 1 is the geometric mean, 0.5 the lower and 2 the upper limit of a class.

Synthesis. On a period P, the spectrum is a sum over n_k = k/P of waves with independent Gaussian
amplitudes. The variance of wave k is the integral of Gd over the part of the bin n_k +- 1/(2P) that
lies in the band, so the expected mean square is exactly the integral over the band:

    E[z^2] = Gd(n0) n0^2 (1/n1 - 1/n2)    for w = 2

With amplitude coherence g(n) between the tracks, the mean of both and half their difference are
independent,

    mean_k = sqrt((1 + g)/2) U_k,   half_k = sqrt((1 - g)/2) V_k,   left, right = mean +- half

so both tracks have the same spectrum and E[left conj(right)] = g E|left|^2. A seed fixes U and V,
and the realisation starts at X = 0 whatever the car, so roads of one seed are the same road, longer
or shorter, as long as one period holds them.

Sources: ISO 8608; Dodds and Robson (1973), Kamash and Robson (1978) for isotropic coherence.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma, kv

from ..curves import smooth_step
from ..errors import RoadError
from .road import Road

Coherence = Literal["exponential", "isotropic", "none", "full"]

REFERENCE_FREQUENCY = 0.1
"""n0, cycle/m."""

CLASSES = dict(zip("ABCDEFGH", (16e-6 * 4.0**k for k in range(8)), strict=True))
"""Gd(n0) of each class by geometric mean, m3."""

SPACING = 0.05
"""Grid of a random road, m: seven points to the shortest wave of the band, in which the spline is
within 0.2 % of the amplitude."""

BLEND_LENGTH = 2.0
"""A section's roughness grows in over this distance, m."""

SHORTEST_PERIOD = 2048.0
"""Least period of the synthesis, m: 22 waves of the longest wave in the band."""

LONGEST_ROAD = 20_000.0
"""m."""


@dataclass(frozen=True, slots=True)
class Roughness:
    """What a random road is made of, apart from its classes.

    band : lowest and highest spatial frequency, cycle/m
    waviness : exponent w
    class_factor : power relative to the class's geometric mean
    coherence : law of the coherence between left and right
    decay : a of the exponential law g = exp(-a n), m
    track : distance b between the tracks for the isotropic law, m
    """

    band: tuple[float, float] = (0.011, 2.83)
    waviness: float = 2.0
    class_factor: float = 1.0
    coherence: Coherence = "exponential"
    decay: float = 1.44
    track: float = 1.5


def iso_road(
    sections: Sequence[tuple[str, float]],
    length: float,
    seed: int,
    roughness: Roughness = Roughness(),
) -> Road:
    """A road of class sections, flat before the first one.

    sections : (class letter, X where it begins), X increasing; each grows in over BLEND_LENGTH.
        The first begins at the next grid point, so the road is exactly 0 up to its X.
    length : X of the road's end, m
    seed : same seed, same road
    Raises RoadError for unknown classes, sections out of order or an absurd length.
    """
    check_sections(sections, length)
    left, right = unit_profiles(_period(length), seed, roughness)
    first = int(np.ceil(sections[0][1] / SPACING - 1e-9))
    last = max(int(np.ceil(length / SPACING)), first + 1)
    grid = np.arange(first, last + 1)
    on_grid = [(sections[0][0], SPACING * first), *sections[1:]]
    gain = amplitude(SPACING * grid, on_grid, roughness.class_factor)
    name = "ISO 8608 " + ", ".join(letter for letter, _ in sections)
    return Road(
        start=SPACING * first,
        spacing=SPACING,
        left=gain * left[grid % left.size],
        right=gain * right[grid % right.size],
        name=name,
    )


def check_sections(sections: Sequence[tuple[str, float]], length: float) -> None:
    """Raise RoadError unless the classes exist, their X increases and the length is sensible."""
    if not sections:
        raise RoadError("A random road needs at least one section; give it a class from A to H.")
    for letter, _ in sections:
        if letter not in CLASSES:
            raise RoadError(f'Road class "{letter}" is unknown; use one of {", ".join(CLASSES)}.')
    begins = [begin for _, begin in sections]
    if any(b <= a for a, b in zip(begins, begins[1:], strict=False)):
        raise RoadError("The sections of a road must begin at increasing X; put them in order.")
    if not length <= LONGEST_ROAD:
        raise RoadError(f"A random road may be {LONGEST_ROAD:g} m long at most; shorten it.")


def amplitude(x: NDArray, sections: Sequence[tuple[str, float]], class_factor: float) -> NDArray:
    """Factor on a road of unit Gd(n0) along X: each section's root of Gd(n0), blended in."""
    gain = np.zeros_like(x)
    for letter, begin in sections:
        share = smooth_step((x - begin) / BLEND_LENGTH)
        gain += share * (np.sqrt(class_factor * CLASSES[letter]) - gain)
    return gain


def mean_square(gd_n0: float, band: tuple[float, float], waviness: float = 2.0) -> float:
    """Integral of Gd over a band, m2: the expected mean square of the elevation."""
    return float(gd_n0 * REFERENCE_FREQUENCY**waviness * _power_integral(*band, waviness))


def coherence(n: NDArray, roughness: Roughness) -> NDArray:
    """Amplitude coherence g(n) between left and right; scipy.signal.coherence returns g^2."""
    match roughness.coherence:
        case "exponential":
            return np.exp(-roughness.decay * n)
        case "isotropic":
            return _isotropic(2.0 * np.pi * roughness.track * n, roughness.waviness / 2.0)
        case "none":
            return np.zeros_like(n)
        case "full":
            return np.ones_like(n)


def _isotropic(q: NDArray, order: float) -> NDArray:
    """g = 2/Gamma(w/2) (q/2)^(w/2) K_(w/2)(q), q = 2 pi b n, order = w/2; g(0) = 1."""
    q = np.maximum(q, 1e-12)
    return 2.0 / gamma(order) * (q / 2.0) ** order * kv(order, q)


def _power_integral(lower, upper, waviness: float):
    """Integral of n^-w from lower to upper."""
    if waviness == 1.0:
        return np.log(upper / lower)
    power = 1.0 - waviness
    return (upper**power - lower**power) / power


def _period(length: float) -> float:
    """Least doubling of SHORTEST_PERIOD that holds the road, m."""
    period = SHORTEST_PERIOD
    while period < length:
        period *= 2.0
    return period


@lru_cache(maxsize=4)
def unit_profiles(period: float, seed: int, roughness: Roughness) -> tuple[NDArray, NDArray]:
    """Left and right profile of unit Gd(n0) on one period of the grid, read-only."""
    size = round(period / SPACING)
    lower_edge, upper_edge = roughness.band
    k = np.arange(int(lower_edge * period), min(int(upper_edge * period) + 2, size // 2))
    lower = np.clip((k - 0.5) / period, lower_edge, upper_edge)
    upper = np.clip((k + 0.5) / period, lower_edge, upper_edge)
    variance = REFERENCE_FREQUENCY**roughness.waviness * _power_integral(
        lower, upper, roughness.waviness
    )
    draw = np.random.default_rng(seed).normal(size=(k.size, 4))
    mean, half = (draw[:, 0] + 1j * draw[:, 1]), (draw[:, 2] + 1j * draw[:, 3])
    g = coherence(k / period, roughness)
    mean = np.sqrt((1.0 + g) / 2.0) * mean
    half = np.sqrt((1.0 - g) / 2.0) * half
    profiles = []
    for wave in (mean + half, mean - half):
        spectrum = np.zeros(size // 2 + 1, dtype=complex)
        spectrum[k] = np.sqrt(variance) * wave * (size / 2.0)
        profile = np.fft.irfft(spectrum, size)
        profile.flags.writeable = False
        profiles.append(profile)
    return profiles[0], profiles[1]
