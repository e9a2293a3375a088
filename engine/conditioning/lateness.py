"""Whether the car's acceleration comes late, by what the accelerometer and the pitch gyro tell.

Pitch by gravity takes a_X for known. One that comes tau late tilts it, to first order, by

    (1)  e(t) = LP(a_X(t - tau) - a_X(t)) / g

which no residual of a fit shows. The gyro's own angle p, of which a line alone is unknown, levels
the accelerometer without a_X,

    (2)  a = f_x cos p + f_z / cos r sin p

so that above the crossover, where nothing is left of a line, a_X is a but for the delay.
"""

import math
from typing import Literal, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from ..filters import is_uniform, low_pass, resolved, slow_part, too_coarse
from ..frames import GRAVITY
from ..run import Run
from .calibration import QUIET, speeds
from .delay import FEWEST_FREQUENCIES, MOST_OF_RECORD, Lag, find_lag, moves
from .done import Array, history, history_or

HIGHEST = 2.0
"""Up to which frequency the two are compared, Hz; a speed knows little of its slope beyond."""

LONGEST = 1.0
"""Delay up to which one is looked for, s."""

SURE = 4.0
"""Standard errors beyond which a delay is none of chance."""

STEADY = 0.1
"""Share of the greatest acceleration up to which a car keeps its speed."""


class Lateness(NamedTuple):
    """An acceleration that comes late, and what it does to the pitch.

    channel : what comes late, from which the acceleration is made
    lag : by how much
    change : of the pitch, rad, that is none
    begin, end : s, between which it changes by it
    doing : what the car does there
    """

    channel: str
    lag: Lag
    change: float
    begin: float
    end: float
    doing: Literal["stands", "keeps its speed", "drives"]

    @property
    def seen(self) -> str:
        """What is found, for a person."""
        late = "late" if self.lag.seconds > 0.0 else "early"
        return (
            f"chassis.pitch changes by {math.degrees(self.change):.2g} deg while the car "
            f"{self.doing} from {self.begin:.1f} to {self.end:.1f} s: {self.channel} seems "
            f"{abs(self.lag.seconds):.3f} ± {self.lag.standard_error:.1g} s {late} against "
            "chassis.body_a_x and the gyro"
        )

    @property
    def warning(self) -> str:
        """The same with the remedy."""
        before = "the speed step" if self.channel == "chassis.v_x" else "this step"
        return (
            f"{self.seen}; put a delay step of {self.channel} by {self.lag.seconds:.3f} s before "
            f"{before}."
        )


def find_lateness(run: Run, crossover: float) -> Lateness | None:
    """How late `chassis.a_x` is against the accelerometer; None where nothing tells it clearly.

    crossover : below which gravity holds the pitch, Hz

    It is told where it is none of chance and makes more than half (in square) of what gravity and
    gyro disagree by.
    """
    if not {"chassis.a_x", "chassis.body_a_x", "chassis.pitch_rate"} <= {*run.columns}:
        return None
    time, longest = run.time, min(LONGEST, MOST_OF_RECORD * run.duration)
    if (
        not is_uniform(time)
        or not resolved(time, crossover)
        or too_coarse(run.sample_step, HIGHEST)
        or (HIGHEST - crossover) * run.duration < FEWEST_FREQUENCIES
    ):
        return None
    a_x, band = history(run, "chassis.a_x"), (crossover, HIGHEST)
    level = _level(run, a_x)
    if not (moves(time, a_x, band) and moves(time, level, band)):
        return None
    lag = find_lag(time, a_x, level, 0, band, longest)
    if not SURE * lag.standard_error < abs(lag.seconds) <= longest:
        return None
    in_time = CubicSpline(time, a_x)(np.clip(time + lag.seconds, time[0], time[-1]))
    before, after = (
        np.std(slow_part(time, _without_line(time, one - level), crossover))
        for one in (a_x, in_time)
    )
    if 2.0 * after**2 >= before**2:
        return None
    tilt = slow_part(time, (a_x - in_time) / GRAVITY, crossover)
    return _told(run, lag, tilt, low_pass(time, level, HIGHEST))


def _level(run: Run, a_x: Array) -> Array:
    """(2), the line in the gyro's angle by gravity."""
    along = history(run, "chassis.body_a_x")
    up = history_or(run, "chassis.body_a_z", GRAVITY) / np.cos(history_or(run, "chassis.roll", 0.0))
    turned = CubicSpline(run.time, history(run, "chassis.pitch_rate")).antiderivative()(run.time)
    by_gravity = (a_x - along) / GRAVITY
    pitch = by_gravity + _without_line(run.time, turned - by_gravity)
    return along * np.cos(pitch) + up * np.sin(pitch)


def _without_line(time: Array, values: Array) -> Array:
    since = time - time[0]
    return values - np.polyval(np.polyfit(since, values, 1), since)


def _told(run: Run, lag: Lag, tilt: Array, level: Array) -> Lateness:
    """What shows it best: the stretch of steady speed in which the pitch changes most, if any."""
    steady = np.abs(level) <= STEADY * np.max(np.abs(level))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], steady, [False]]).astype(int)))
    stretches = [slice(*ends) for ends in edges.reshape(-1, 2)] or [slice(0, steady.size)]
    shown = max(stretches, key=lambda one: np.ptp(tilt[one]))
    lowest, highest = (shown.start + place(tilt[shown]) for place in (np.argmin, np.argmax))
    begin, end = sorted((int(lowest), int(highest)))
    # A late speed reaches 0 within the stretch.
    told = [np.median(np.abs(run[name][begin : end + 1])) for name in speeds(run)]
    stands = bool(told) and max(told) <= QUIET["speed"]
    return Lateness(
        _late_channel(run),
        lag,
        float(np.ptp(tilt[shown])),
        float(run.time[begin]),
        float(run.time[end]),
        "stands" if stands else "keeps its speed" if steady.any() else "drives",
    )


def _late_channel(run: Run) -> str:
    """What `chassis.a_x` is made of: the recorded speed, or itself."""
    made = [record.step for record in run.conditioning if "chassis.a_x" in record.channels]
    last = [step for step in made if step["kind"] in ("speed", "gravity")][-1:]
    return "chassis.v_x" if last and last[0].get("source") == "v_x" else "chassis.a_x"
