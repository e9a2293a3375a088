"""Figures of many cars without their histories: what the kernels tally becomes metrics.

Names and meanings are those of `metrics.py`. Two differ in their making. The weighting of
ISO 2631-1 is integrated beside the car, where `metrics.py` weighs the spectrum of the samples. The
times over which squat and dive are means are those of one car, the first of a sweep, and
percentiles are read from histograms of 2048 bins.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..frames import AXLES
from ..iso2631 import RUNNING_TIME
from ..kernels.histogram import QUANTITIES
from ..kernels.tally import TALLY_ROWS, BodyTally, PointTally, WheelTally
from ..kernels.watch import Watch
from ..run import Run
from ..weighting_filter import weighting_filter
from .metrics import PERCENTILES, percentile_name, pushes

Array = NDArray[np.float64]

_SAME_STEP = 1e-9
"""Relative difference of steps that share a filter."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """What is tallied during a manoeuvre or a recording, and how its figures are called.

    point : name of the chassis point, such as "seat.driver"
    time (S,) : of the samples, s, uniform
    pushed, braked : whether the first car ever accelerates and brakes
    """

    point: str
    time: Array
    pushed: bool
    braked: bool
    watch: Watch

    @property
    def columns(self) -> int:
        """Numbers that the kernels keep of a car."""
        return TALLY_ROWS + QUANTITIES * len(PERCENTILES)


def reduction(
    run: Run, steps: Array, point: str, position: tuple[float, float, float]
) -> Reduction:
    """What to tally of cars that drive like the one of a run.

    run : of the first car, with a_x at the times of the samples
    steps (n,) : of the integration, s
    position : of the point, from the CG in B, m
    """
    time = run.time
    weights = np.zeros((time.size, 3))
    weights[:, 0] = 1.0
    weights[[0, -1], 0] = 0.5
    during = pushes(run)
    for column, name in enumerate(("squat", "dive"), start=1):
        if name in during:
            weights[:, column] = during[name]
    totals = weights.sum(axis=0)
    weights /= np.where(totals > 0.0, totals, 1.0)
    lengths, kinds = _lengths(steps)
    vertical, horizontal = weighting_filter("Wk"), weighting_filter("Wd")
    watch = Watch(
        point=np.asarray(position, dtype=np.float64),
        weights=weights,
        window=max(round(RUNNING_TIME * (time.size - 1) / (time[-1] - time[0])), 1),
        kinds=kinds,
        vertical=np.stack([vertical.step(h) for h in lengths]),
        horizontal=np.stack([horizontal.step(h) for h in lengths]),
        vertical_output=vertical.C,
        horizontal_output=horizontal.C,
        shares=np.asarray(PERCENTILES) / 100.0,
    )
    return Reduction(point, time, "squat" in during, "dive" in during, watch)


def _lengths(steps: Array) -> tuple[Array, NDArray[np.int64]]:
    """The different lengths of steps and which of them each step has."""
    rounded = np.round(steps / steps.max() / _SAME_STEP).astype(np.int64)
    _, first, kinds = np.unique(rounded, return_index=True, return_inverse=True)
    return steps[first], kinds.astype(np.int64)


def figures(tallies: Array, reduced: Reduction) -> dict[str, Array]:
    """Figures (C,) by the names of `metrics.py`, SI, from tallies (C, columns)."""
    found = _comfort(_fields(tallies, 0, PointTally), reduced)
    first = len(PointTally._fields)
    found |= _body(_fields(tallies, first, BodyTally), reduced)
    first += len(BodyTally._fields)
    wheels = [
        _fields(tallies, first + corner * len(WheelTally._fields), WheelTally)
        for corner in range(4)
    ]
    percentiles = tallies[:, TALLY_ROWS:].reshape(len(tallies), QUANTITIES, len(PERCENTILES))
    for axle, name in enumerate(AXLES):
        pair = wheels[2 * axle], wheels[2 * axle + 1]
        found |= _travel(name, pair, percentiles[:, axle])
    for axle, name in enumerate(AXLES):
        pair = wheels[2 * axle], wheels[2 * axle + 1]
        found |= _load(name, pair, percentiles[:, 2 + axle], reduced.time.size)
    return found


def _fields(tallies: Array, first: int, record: type) -> dict[str, Array]:
    return {name: tallies[:, first + k] for k, name in enumerate(record._fields)}


def _deviation(mean: Array, mean_square: Array) -> Array:
    """Mean square about the mean."""
    return np.maximum(mean_square - mean**2, 0.0)


def _comfort(tally: dict[str, Array], reduced: Reduction) -> dict[str, Array]:
    point, samples = reduced.point, reduced.time.size
    duration = reduced.time[-1] - reduced.time[0]
    found = {
        f"{point}.a_{axis}.weighted_rms": np.sqrt(tally[f"{axis}_square"] / samples)
        for axis in "xyz"
    }
    found[f"{point}.a_z.vdv"] = (duration * tally["z_fourth"]) ** 0.25
    worst = np.maximum(tally["z_worst"], 0.0)
    found[f"{point}.a_z.mtvv"] = np.sqrt(worst / reduced.watch.window)
    return found


def _body(tally: dict[str, Array], reduced: Reduction) -> dict[str, Array]:
    found = {
        f"chassis.{name}.rms": np.sqrt(_deviation(tally[name], tally[f"{name}_square"]))
        for name in ("z", "pitch", "roll")
    }
    found["chassis.pitch.nose_up"] = np.maximum(-tally["pitch_least"], 0.0)
    found["chassis.pitch.nose_down"] = np.maximum(tally["pitch_most"], 0.0)
    if reduced.pushed:
        found["chassis.pitch.squat"] = -tally["pushed_pitch"]
    if reduced.braked:
        found["chassis.pitch.dive"] = tally["braked_pitch"]
    return found


def _travel(
    axle: str, pair: tuple[dict[str, Array], dict[str, Array]], percentiles: Array
) -> dict[str, Array]:
    left, right = pair
    name = f"suspension.{axle}.travel"
    found = {
        f"{name}.rms": _pooled_rms(pair, "travel"),
        f"{name}.jounce": np.maximum(np.maximum(left["travel_most"], right["travel_most"]), 0.0),
        f"{name}.rebound": np.maximum(
            -np.minimum(left["travel_least"], right["travel_least"]), 0.0
        ),
    }
    return found | _percentiles(name, percentiles)


def _load(
    axle: str,
    pair: tuple[dict[str, Array], dict[str, Array]],
    percentiles: Array,
    samples: int,
) -> dict[str, Array]:
    left, right = pair
    name = f"tyre.{axle}.load"
    variation = _pooled_rms(pair, "load")
    mean = 0.5 * (left["load"] + right["load"])
    found = {
        f"{name}.rms": variation,
        f"{name}.coefficient": np.where(mean > 0.0, variation / mean, np.nan),
        f"{name}.lifted": (left["lifted"] + right["lifted"]) / (2.0 * samples),
        f"{name}.least": np.minimum(left["load_least"], right["load_least"]),
        f"{name}.most": np.maximum(left["load_most"], right["load_most"]),
    }
    return found | _percentiles(name, percentiles)


def _pooled_rms(pair: tuple[dict[str, Array], dict[str, Array]], name: str) -> Array:
    """Root of the mean over both wheels of their mean squares about their means."""
    squares = [_deviation(wheel[name], wheel[f"{name}_square"]) for wheel in pair]
    return np.sqrt(0.5 * (squares[0] + squares[1]))


def _percentiles(name: str, values: Array) -> dict[str, Array]:
    return {percentile_name(name, p): values[:, k] for k, p in enumerate(PERCENTILES)}
