"""Percentiles of travel and tyre load from histograms: exact to a bin, whatever the time."""

from ..jit import inlined
from .buffer import corner_of

BINS = 2048
QUANTITIES = 4
"""Travel front and rear, load front and rear; both wheels of an axle together."""

TRAVEL_FROM, TRAVEL_TO = -0.5, 0.5
"""Range of the travel over the strut's length at rest."""
LOAD_FROM, LOAD_TO = -2.0, 6.0
"""Range of the load over the static one."""


@inlined
def bin_of(value, begin, end):
    """Where among the bins a value lies; the outer ones take what is beyond, the first also NaN."""
    place = (value - begin) * (BINS / (end - begin))
    return min(place if place > 0.0 else 0.0, BINS - 1.0)


@inlined
def count(buffer, LANES, bins, counts):
    """Count what lies in the bins of rows `bins` on: travel and load of the four wheels.

    counts (QUANTITIES, BINS, LANES) : integers
    """
    for corner in range(4):
        axle = corner // 2
        for j in range(LANES):
            travel = int(buffer[(bins + 2 * corner) * LANES + j])
            load = int(buffer[(bins + 2 * corner + 1) * LANES + j])
            counts[axle, travel, j] += 1
            counts[2 + axle, load, j] += 1


@inlined
def percentile(counts, quantity, lane, share, begin, end):
    """Value below which a share of what was counted lies, even inside each bin."""
    total = 0
    for k in range(BINS):
        total += counts[quantity, k, lane]
    wanted, below = share * total, 0.0
    for k in range(BINS):
        here = counts[quantity, k, lane]
        if here > 0 and below + here >= wanted:
            return begin + (k + (wanted - below) / here) * (end - begin) / BINS
        below += here
    return end


@inlined
def percentiles(buffer, LANES, lane, counts, shares, out):
    """Percentiles of one car; out (QUANTITIES * P,), SI."""
    for axle in range(2):
        car = corner_of(buffer, 4 * LANES, 2 * axle * LANES + lane)
        for p in range(shares.shape[0]):
            travel = percentile(counts, axle, lane, shares[p], TRAVEL_FROM, TRAVEL_TO)
            load = percentile(counts, 2 + axle, lane, shares[p], LOAD_FROM, LOAD_TO)
            out[axle * shares.shape[0] + p] = travel * car.rest_length
            out[(2 + axle) * shares.shape[0] + p] = load * car.static_load
