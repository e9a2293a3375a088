"""The objective rating of ISO/TS 18571: how alike two time histories are, from 0 to 1.

    R = 0.4 Z + 0.2 E_P + 0.2 E_M + 0.2 E_S

with T the measured and C the simulated history on N equally spaced instants:

* corridor Z: mean over the samples of 1 where |C - T| < 0.05 max|T|, 0 where it is beyond
  0.5 max|T|, and the square of the share of the way in between.
* phase E_P: C is moved against T by up to 0.2 N samples to where their correlation is greatest, by
  the least of equally good shifts and to the left first; 1 - shift / (0.2 N).
* magnitude E_M: both, moved and cut to where they overlap, are warped onto each other (dynamic time
  warping on squared differences within a band of a tenth of their length);
  1 - (sum |C - T| / sum |T|) / 0.5 along the path.
* slope E_S: central differences of both, moved and cut, meant over nine samples (fewer at the
  ends); 1 - (sum |C' - T'| / sum |T'|) / 2.

Each is at least 0. Source: ISO/TS 18571:2014; ties and ends as in the implementation that TU Graz
publishes (objective-rating-metrics 1.3), with which this one agrees to rounding.

The standard is made for crash signals sampled at 10 kHz. What lasts a ride is put on a grid of
GRID, so that the slope is meant over 40 ms in place of 0.8 ms. A ride has many peaks and no single
pulse, for which the standard does not vouch: read the rating beside fit percent and rms error.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .jit import compiled

Array = NDArray[np.float64]

WEIGHTS = {"corridor": 0.4, "phase": 0.2, "magnitude": 0.2, "slope": 0.2}
INNER, OUTER = 0.05, 0.5
"""Half-widths of the corridors over max|T|."""
MOST_SHIFT = 0.2
WARP_BAND = 0.1
MOST_MAGNITUDE_ERROR = 0.5
MOST_SLOPE_ERROR = 2.0
SMOOTHED = 9
"""Samples over which a slope is meant."""

GRID = 0.005
"""Time between the compared instants, s ..."""
MOST_SAMPLES = 8000
"""... as far as there are no more than these: the warping takes their square."""
FEWEST_SAMPLES = 20


@dataclass(frozen=True, slots=True)
class Rating:
    """The four scores, 0 to 1."""

    corridor: float
    phase: float
    magnitude: float
    slope: float

    @property
    def overall(self) -> float:
        """R."""
        return sum(weight * getattr(self, name) for name, weight in WEIGHTS.items())


def rate(time: Array, measured: Array, simulated: Array) -> Rating | None:
    """The rating of a simulated history, or None where there is none.

    time, measured, simulated : (n,)
    There is none for a measurement that is constant, too short or has gaps, and none where the
    simulation has.
    """
    if not (np.all(np.isfinite(measured)) and np.all(np.isfinite(simulated))):
        return None
    span = time[-1] - time[0]
    count = min(round(span / GRID) + 1, MOST_SAMPLES)
    if count < FEWEST_SAMPLES or np.ptp(measured) == 0.0:
        return None
    grid = np.linspace(time[0], time[-1], count)
    t, c = (np.interp(grid, time, values) for values in (measured, simulated))
    if np.ptp(t) == 0.0:
        return None
    return rate_samples(t, c)


def rate_samples(t: Array, c: Array) -> Rating:
    """The rating of equally spaced histories (N,), t not constant."""
    shift = best_shift(t, c)
    if shift > 0:  # c comes late: it is moved to the left
        t_moved, c_moved = t[:-shift], c[shift:]
    elif shift < 0:
        t_moved, c_moved = t[-shift:], c[:shift]
    else:
        t_moved, c_moved = t, c
    return Rating(
        corridor=_corridor(t, c),
        phase=max(0.0, 1.0 - abs(shift) / (MOST_SHIFT * t.size)),
        magnitude=_magnitude(t_moved, c_moved),
        slope=_slope(t_moved, c_moved),
    )


def best_shift(t: Array, c: Array) -> int:
    """By how many samples c comes later than t, where the two correlate best; 0 for a flat c."""
    best, found = _correlation(t, c), 0
    for shift in range(1, int(MOST_SHIFT * t.size) + 1):
        for late, pair in ((shift, (t[:-shift], c[shift:])), (-shift, (t[shift:], c[:-shift]))):
            correlation = _correlation(*pair)
            if correlation > best:
                best, found = correlation, late
    return found


def _correlation(a: Array, b: Array) -> float:
    """Correlation coefficient, -1 where one is flat."""
    a, b = a - a.mean(), b - b.mean()
    size = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / size if size > 0.0 else -1.0


def _corridor(t: Array, c: Array) -> float:
    size = float(np.max(np.abs(t)))
    share = (OUTER - np.abs(c - t) / size) / (OUTER - INNER)
    return float(np.mean(np.clip(share, 0.0, 1.0) ** 2))


def _magnitude(t: Array, c: Array) -> float:
    error, size = warped_error(c, t, math.ceil(WARP_BAND * t.size) - 1)
    return _score(error, size, MOST_MAGNITUDE_ERROR)


def _slope(t: Array, c: Array) -> float:
    t_slope, c_slope = (_mean_of_nine(np.gradient(values)) for values in (t, c))
    error, size = np.sum(np.abs(c_slope - t_slope)), np.sum(np.abs(t_slope))
    return _score(float(error), float(size), MOST_SLOPE_ERROR)


def _score(error: float, size: float, most: float) -> float:
    """1 without an error, 0 from an error of `most` times the size on."""
    if error == 0.0:
        return 1.0
    return max(0.0, 1.0 - error / size / most) if size > 0.0 else 0.0


def _mean_of_nine(values: Array) -> Array:
    """Moving mean; near an end over as many samples as lie symmetrically around one."""
    half = SMOOTHED // 2
    sums = np.concatenate([[0.0], np.cumsum(values)])
    place = np.arange(values.size)
    reach = np.minimum(half, np.minimum(place, place[::-1]))
    return (sums[place + reach + 1] - sums[place - reach]) / (2 * reach + 1)


@compiled
def warped_error(c, t, band):
    """Sums of |c - t| and of |t| along the warping path of least squared difference.

    c, t : (N,);  band : a path stays within |i - j| <= band
    """
    count, width = c.size, 2 * band + 1
    came_from = np.zeros((count, width), dtype=np.int8)
    above, here = np.full(width, np.inf), np.full(width, np.inf)
    for i in range(count):
        for k in range(width):
            here[k] = np.inf
            j = i + k - band
            if j < 0 or j >= count:
                continue
            # In a row of the band, one row up is one place to the right.
            up = above[k + 1] if k + 1 < width else np.inf
            left = here[k - 1] if k > 0 else np.inf
            best, way = up, 1
            if left < best:
                best, way = left, 2
            if above[k] < best:
                best, way = above[k], 3
            if i == 0 and j == 0:
                best, way = 0.0, 0
            here[k] = best + (c[i] - t[j]) ** 2
            came_from[i, k] = way
        above, here = here, above
    error, size = 0.0, 0.0
    i, j = count - 1, count - 1
    while True:
        error += abs(c[i] - t[j])
        size += abs(t[j])
        way = came_from[i, j - i + band]
        if way == 0:
            return error, size
        if way != 2:
            i -= 1
        if way != 1:
            j -= 1
