"""The spectrum of a road profile as ISO 8608 shows it, to be held against its classes' bounds.

Power spectral density over the spatial frequency by Welch's method (Hann windows of at most
LONGEST_WINDOW, half overlap, trend removed), meant over the standard's bands: octaves up to a
centre of 0.0312 cycle/m, third octaves up to 0.25 cycle/m, twelfths beyond.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from .road import LEFT, RIGHT, Road

Array = NDArray[np.float64]

LONGEST_WINDOW = 51.2
"""Length of a window, m, where the section is that long."""

SHORTEST_SECTION = 10.0
"""m; a shorter section has no spectrum worth showing."""

SPACING = 0.05
"""Distance between the samples of a profile, m."""

BANDS = ((0.0312, 1), (0.25, 3), (math.inf, 12))
"""Up to which centre, cycle/m, an octave is cut into how many bands."""

HIGHEST = 2.83
"""Upper end of the reference band, cycle/m."""


@dataclass(frozen=True, slots=True)
class RoadSpectrum:
    """Of the road between two X.

    begin, end : X, m
    frequency : (k,) centres of the bands, cycle/m;  left, right : (k,) density, m3
    """

    begin: float
    end: float
    frequency: Array
    left: Array
    right: Array


def road_spectra(road: Road, edges: Iterable[float]) -> tuple[RoadSpectrum, ...]:
    """Spectra of the sections of a road between increasing X; none of flat or short ones."""
    ends = list(edges)
    found = (_spectrum(road, a, b) for a, b in zip(ends, ends[1:], strict=False))
    return tuple(one for one in found if one is not None)


def _spectrum(road: Road, begin: float, end: float) -> RoadSpectrum | None:
    if end - begin < SHORTEST_SECTION:
        return None
    x = np.arange(begin, end, SPACING)
    sides = [road.height(side, x) for side in (LEFT, RIGHT)]
    if all(np.ptp(side) == 0.0 for side in sides):
        return None
    window = min(x.size, round(LONGEST_WINDOW / SPACING))
    frequency, power = welch(np.stack(sides), 1.0 / SPACING, nperseg=window, detrend="linear")
    power = np.asarray(power)
    lines = [
        (centre, *power[:, inside].mean(axis=1))
        for centre, lower, upper in _bands(float(frequency[1]))
        if (inside := (frequency >= lower) & (frequency < upper) & (frequency > 0.0)).any()
    ]
    centres, left, right = np.array(lines).T
    return RoadSpectrum(begin, end, centres, left, right)


def _bands(lowest: float) -> list[tuple[float, float, float]]:
    """(centre, lower, upper) of the bands from the lowest frequency on, cycle/m."""
    bands, upper = [], lowest / math.sqrt(2.0)
    while upper < HIGHEST:
        share = next(parts for centre, parts in BANDS if upper <= centre)
        lower, upper = upper, upper * 2.0 ** (1.0 / share)
        bands.append((math.sqrt(lower * upper), lower, upper))
    return bands
