"""What a column's numbers say by themselves: range, size, constancy, gaps, numbers that stand for
"nothing measured", clipped ends.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

USUAL_STAND_INS = (
    64.0,
    999.0,
    9999.0,
    99999.0,
    32767.0,
    32768.0,
    65535.0,
    2147483647.0,
    4294967295.0,
)
"""Magnitudes that loggers write for "nothing measured"; beside them any beyond HUGE."""

HUGE = 1e20

FEWEST_STAND_INS = 3
"""How often a number below HUGE must be repeated to count as one."""

FAR, FAR_OF_USUAL = 5.0, 2.0
"""How many times the range of the rest it must lie away from the rest."""

MOST_STAND_INS = 4
"""Different ones in one column."""

CENTRAL = (0.5, 99.5)
"""Percentiles between which the usual values lie."""

CLIPPED_RUN, CLIPPED_RUNS, TIMES_NEXT = 5, 3, 8.0
"""A column is clipped where it stays at its greatest value for so many samples, at least so often,
and so many times longer than at the value next to it; at the top of a rounded wave it is five."""


class StandIn(NamedTuple):
    """A number that probably stands for "nothing measured", and in how many samples."""

    value: float
    samples: int


@dataclass(frozen=True, slots=True)
class Statistics:
    """Of one column, in the numbers of the file and without stand-ins.

    minimum, maximum : nan where no sample is finite
    peak : 99.5 % of the magnitudes lie below it;  swing : of the distances from the median
    median : of all samples;  level : its magnitude
    step : median difference from sample to sample
    missing : samples that are no finite number
    stand_ins : numbers far outside the rest, stand-ins probably
    clipped : sentences' worth of ends at which the column stays too often: values
    """

    samples: int
    minimum: float
    maximum: float
    peak: float
    swing: float
    median: float
    step: float
    missing: int
    stand_ins: tuple[StandIn, ...] = ()
    clipped: tuple[float, ...] = ()

    @property
    def empty(self) -> bool:
        """Whether no sample is a number."""
        return self.samples == self.missing

    @property
    def level(self) -> float:
        """Magnitude of the median."""
        return abs(self.median)

    @property
    def constant(self) -> bool:
        """Whether the column never changes, or holds nothing."""
        return not self.minimum < self.maximum


def unreadable(samples: int) -> Statistics:
    """Of a column whose numbers cannot be read."""
    nan = math.nan
    return Statistics(samples, nan, nan, nan, nan, nan, nan, samples)


def statistics(values: Array) -> Statistics:
    """What a column's numbers (samples,) say."""
    with np.errstate(over="ignore", invalid="ignore"):
        return _statistics(values)


def _statistics(values: Array) -> Statistics:
    finite = values[np.isfinite(values)]
    found = stand_ins(finite)
    missing = values.size - finite.size
    if found:
        finite = finite[~np.isin(finite, [one.value for one in found])]
    if not finite.size:
        return replace(unreadable(values.size), missing=missing, stand_ins=found)
    median = float(np.median(finite))
    peak, swing = (
        float(np.percentile(np.abs(one), CENTRAL[1])) for one in (finite, finite - median)
    )
    step = float(np.median(np.diff(finite))) if finite.size > 1 else math.nan
    low, high = float(finite.min()), float(finite.max())
    return Statistics(
        *(values.size, low, high, peak, swing, median, step, missing, found),
        clipped=tuple(end for end in (low, high) if low < high and _is_clipped(finite, end)),
    )


def stand_ins(finite: Array) -> tuple[StandIn, ...]:
    """Exact repeated values far outside the rest; `finite` (samples,) holds finite numbers."""
    found: list[StandIn] = []
    rest = finite
    while rest.size and len(found) < MOST_STAND_INS:
        one = next(filter(None, (_stand_in(rest, end) for end in (rest.min(), rest.max()))), None)
        if one is None:
            break
        found.append(one)
        rest = rest[rest != one.value]
    return tuple(found)


def _stand_in(values: Array, end: float) -> StandIn | None:
    """The end of a column, if it stands in for something."""
    rest = values[values != end]
    count = values.size - rest.size
    if not rest.size or count < (1 if abs(end) > HUGE else FEWEST_STAND_INS):
        return None
    far = FAR_OF_USUAL if abs(end) in USUAL_STAND_INS or abs(end) > HUGE else FAR
    low, high = np.percentile(rest, CENTRAL)
    away = min(abs(end - rest.min()), abs(end - rest.max()))
    # A switch has two values as well; what stands in lies outside of something that moves.
    if high <= low or away <= far * max(rest.max() - rest.min(), high - low):
        return None
    return StandIn(float(end), count)


def _is_clipped(values: Array, end: float) -> bool:
    """Whether a column stays at one of its ends again and again; 0 is no end but rest."""
    if end == 0.0:
        return False
    at_end = _runs(values == end)
    long = at_end[at_end >= CLIPPED_RUN]
    if long.size < CLIPPED_RUNS:
        return False
    others = values[values != end]
    beside = others[np.argmin(np.abs(others - end))]
    return bool(np.median(long) >= TIMES_NEXT * np.mean(_runs(values == beside)))


def _runs(holds: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Lengths of the stretches of truth."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], holds.view(np.int8), [0]])))
    return edges[1::2] - edges[::2]
