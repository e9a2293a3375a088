"""Figures that judge a ride: comfort, body motion, working space and road holding.

Every row comes from channels of a run, measured or simulated; a row whose channels are missing is
left out. Root mean squares are over time, about the mean unless said otherwise, so that an offset
of a recording does not count.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ..filters import is_uniform, smoothed
from ..frames import AXLES, CORNERS, AxleName, axle_of
from ..iso2631 import Weighting, running_rms, vibration_dose, weighted
from ..run import Run

Array = NDArray[np.float64]

SLOW = 1.0
"""Whether the car accelerates or brakes is read from its a_x below this frequency, Hz."""

LEAST_PUSH = 0.5
"""Least acceleration or deceleration (m/s2) that is called one: above coasting down."""

COMFORT = (
    (0.315, "not uncomfortable"),
    (0.5, "a little uncomfortable"),
    (0.8, "fairly uncomfortable"),
    (1.25, "uncomfortable"),
    (2.0, "very uncomfortable"),
    (np.inf, "extremely uncomfortable"),
)
"""Upper ends (m/s2) of the bands of ISO 2631-1, annex C; they overlap there and are cut here at
the beginning of the next worse band."""

PERCENTILES = (1, 99)
"""Of travel and tyre load, in %: what all but the worst hundredth of the time needs."""

AXLE_WORDS: dict[AxleName, str] = {"front": "Front", "rear": "Rear"}


@dataclass(frozen=True, slots=True)
class Metric:
    """One figure; `value` is in `unit` (SI), shown as value * display_factor in `display_unit`.

    counted : whether samples are counted, so that it stays as it is under the smallest changes
    """

    name: str
    label: str
    value: float
    unit: str
    display_unit: str
    display_factor: float
    meaning: str
    counted: bool = False


def metrics(run: Run) -> list[Metric]:
    """Every figure that the channels of a run give, in a fixed order."""
    return [*_comfort(run), *_body(run), *_travel(run), *_tyre_load(run)]


def rms(time: Array, values: Array) -> float:
    """Root of the mean square over time about the mean over time, for any sampling.

    values : (n,) or (channels, n), each about its own mean, their mean squares then averaged
    """
    shares = _shares_of_time(time)
    deviation = values - (values @ shares)[..., np.newaxis]
    return float(np.sqrt(np.mean(deviation**2 @ shares)))


def _shares_of_time(time: Array) -> Array:
    """Weights (n,) by which samples give their mean over time, by the trapezoidal rule."""
    steps = np.diff(time)
    shares = np.zeros(time.size)
    shares[:-1] = steps
    shares[1:] += steps
    return shares / (2.0 * (time[-1] - time[0]))


def comfort_word(acceleration: float) -> str:
    """What ISO 2631-1 calls a frequency-weighted rms acceleration (m/s2)."""
    return next(word for upper, word in COMFORT if acceleration < upper)


def _comfort(run: Run) -> Iterator[Metric]:
    """Weighted accelerations at every seat or point that has them."""
    for name in run.columns:
        point, _, axis = name.rpartition(".a_")
        if not name.startswith(("seat.", "point.")):
            continue
        weighting: Weighting = "Wk" if axis == "z" else "Wd"
        history, step = _weighted_channel(run, name, weighting)
        where = point.split(".", 1)[1].replace("_", " ")
        where = f"{where} {'seat' if point.startswith('seat.') else 'point'}, along {axis}"
        value = float(np.sqrt(np.mean(history**2)))
        yield Metric(
            f"{name}.weighted_rms",
            f"Weighted acceleration, {where}",
            value,
            *("m/s^2", "m/s²", 1.0),
            f"rms of the acceleration weighted by {weighting} (ISO 2631-1): {comfort_word(value)}",
        )
        if axis != "z":
            continue
        yield Metric(
            f"{name}.vdv",
            f"Vibration dose, {where}",
            vibration_dose(history, step),
            *("m/s^1.75", "m/s^1.75", 1.0),
            "fourth-power dose of the weighted acceleration over the run: shocks count more",
        )
        yield Metric(
            f"{name}.mtvv",
            f"Worst second, {where}",
            float(running_rms(history, step).max()),
            *("m/s^2", "m/s²", 1.0),
            "greatest rms of the weighted acceleration over any one second (MTVV)",
        )


def _weighted_channel(run: Run, name: str, weighting: Weighting) -> tuple[Array, float]:
    """A weighted acceleration on a uniform grid, and the grid's step."""
    time, values = run.time, run[name]
    step = float(time[-1] - time[0]) / (time.size - 1)
    if not is_uniform(time):
        values = CubicSpline(time, values)(time[0] + step * np.arange(time.size))
    return weighted(values, step, weighting), step


def _body(run: Run) -> Iterator[Metric]:
    """Bounce, pitch and roll of the sprung mass; squat and dive."""
    degrees = ("rad", "°", float(np.degrees(1.0)))
    for name, label, units in (
        ("chassis.z", "Bounce", ("m", "mm", 1e3)),
        ("chassis.pitch", "Pitch", degrees),
        ("chassis.roll", "Roll", degrees),
    ):
        if name in run:
            value = rms(run.time, run[name])
            yield Metric(f"{name}.rms", f"{label}, rms", value, *units, "about its mean")
    if "chassis.pitch" in run:
        yield from _pitch_peaks(run, degrees)
        yield from _squat(run, degrees)


def _pitch_peaks(run: Run, degrees: tuple[str, str, float]) -> Iterator[Metric]:
    """Greatest pitch from rest either way."""
    for name, label, sign in (("nose_up", "Nose up", -1.0), ("nose_down", "Nose down", 1.0)):
        peak = max(float(np.max(sign * run["chassis.pitch"])), 0.0)
        yield Metric(
            f"chassis.pitch.{name}", f"{label}, peak", peak, *degrees, "greatest pitch from rest"
        )


def pushes(run: Run) -> dict[str, NDArray[np.bool_]]:
    """Which samples lie in the time in which the car squats and dives, as far as it does.

    It accelerates or brakes then at over half its most.
    """
    if "chassis.a_x" not in run:
        return {}
    slow = smoothed(run.time, run["chassis.a_x"], SLOW)
    both = {"squat": slow, "dive": -slow}
    return {
        name: push > 0.5 * np.max(push) for name, push in both.items() if np.max(push) >= LEAST_PUSH
    }


def _squat(run: Run, degrees: tuple[str, str, float]) -> Iterator[Metric]:
    """Mean pitch while the car accelerates or brakes, in which the road's share averages out."""
    during = pushes(run)
    for name, label, sign, doing in (
        ("squat", "Squat", 1.0, "accelerates"),
        ("dive", "Dive", -1.0, "brakes"),
    ):
        if name not in during:
            continue
        mean = float(np.mean(-sign * run["chassis.pitch"][during[name]]))
        side = "up" if name == "squat" else "down"
        meaning = f"mean pitch nose {side} while the car {doing} at over half its most"
        yield Metric(f"chassis.pitch.{name}", f"{label}, mean", mean, *degrees, meaning)


def _travel(run: Run) -> Iterator[Metric]:
    """Working space of both wheels of an axle."""
    for axle, travels in _axles(run, "suspension.{}.travel".format):
        label, units = f"{AXLE_WORDS[axle]} suspension travel", ("m", "mm", 1e3)
        yield Metric(
            f"suspension.{axle}.travel.rms",
            f"{label}, rms",
            rms(run.time, travels),
            *units,
            "both wheels together, about their means",
        )
        yield Metric(
            f"suspension.{axle}.travel.jounce",
            f"{label}, peak jounce",
            max(float(np.max(travels)), 0.0),
            *units,
            "greatest compression from rest",
        )
        yield Metric(
            f"suspension.{axle}.travel.rebound",
            f"{label}, peak rebound",
            max(float(-np.min(travels)), 0.0),
            *units,
            "greatest extension from rest",
        )
        yield from _percentiles(f"suspension.{axle}.travel", label, travels, units)


def _tyre_load(run: Run) -> Iterator[Metric]:
    """Variation of the tyre load, which costs grip."""
    for axle, loads in _axles(run, "tyre.{}.load".format):
        label = f"{AXLE_WORDS[axle]} tyre load"
        variation, mean = rms(run.time, loads), float(np.mean(loads))
        yield Metric(
            f"tyre.{axle}.load.rms",
            f"{label} variation, rms",
            variation,
            *("N", "N", 1.0),
            "both wheels together, about their means",
        )
        if mean > 0.0:
            yield Metric(
                f"tyre.{axle}.load.coefficient",
                f"{label} coefficient",
                variation / mean,
                *("1", "%", 100.0),
                "variation over mean load: the less, the better the grip",
            )
        yield Metric(
            f"tyre.{axle}.load.lifted",
            f"{label} at or below zero",
            float(np.mean(loads <= 0.0)),
            *("1", "%", 100.0),
            "share of the samples in which a tyre carries nothing",
            counted=True,
        )
        for name, value in (("least", np.min(loads)), ("most", np.max(loads))):
            yield Metric(
                f"tyre.{axle}.load.{name}",
                f"{label}, {name}",
                float(value),
                *("N", "N", 1.0),
                "of both wheels at any time",
            )
        yield from _percentiles(f"tyre.{axle}.load", label, loads, ("N", "N", 1.0))


def percentile_name(channel: str, percentile: int) -> str:
    """Name of a percentile's row."""
    return f"{channel}.p{percentile:02d}"


def _percentiles(
    channel: str, label: str, pair: Array, units: tuple[str, str, float]
) -> Iterator[Metric]:
    """What both wheels together stay above and below for all but a hundredth of the time."""
    for percentile, value in zip(PERCENTILES, np.percentile(pair, PERCENTILES), strict=True):
        below = f"both wheels together are below it {percentile} % of the time"
        name = percentile_name(channel, percentile)
        yield Metric(name, f"{label}, {percentile} % below", float(value), *units, below)


def _axles(run: Run, channel_of: Callable[[str], str]) -> Iterator[tuple[AxleName, Array]]:
    """Channels (2, n) of both wheels of each axle that has both."""
    for axle in AXLES:
        names = [channel_of(corner) for corner in CORNERS if axle_of(corner) == axle]
        if all(name in run for name in names):
            yield axle, np.stack([run[name] for name in names])
