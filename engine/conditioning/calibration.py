"""Steps that correct a sensor: its gain and bias, what it reads at rest."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..channels import CHANNELS, channel
from ..errors import ConditioningError
from ..frames import CORNERS, GRAVITY
from ..run import Run
from ..vehicle import Range, Vehicle
from .done import Array, Done, history

REST_VALUES = {
    "chassis.body_a_z": GRAVITY,
    **{f"wheel.{corner}.a_z": GRAVITY for corner in CORNERS},
}
"""What channels read at rest that do not read 0 there, SI."""

QUIET = {
    "displacement": 2e-3,
    "angle": math.radians(0.1),
    "acceleration": 0.3,
    "angular rate": math.radians(1.0),
    "speed": 0.1,
}
"""Standard deviation up to which a channel of a quantity is quiet, SI; of a speed, the greatest
value at which a car stands."""

TIMES_NOISE = 2.0
"""A channel is also quiet where it moves by no more than so many times its stated noise."""

WINDOW = 0.3
"""Shortest standstill that is found, s."""

LEVEL, CHANGE = 0.5, 0.1
"""Where no speed is recorded: greatest mean of an acceleration along the car over WINDOW, that of a
car on a slope of 5 %, and greatest change of it from one to the next, m/s2."""

NEVER_AT_REST = ("road.", "post.", "chassis.x", "chassis.v_x", ".speed")
"""Parts of the names of channels whose rest value is theirs to keep."""


def has_rest_value(name: str) -> bool:
    """Whether a channel counts from rest."""
    return channel(name).quantity in QUIET and not any(part in name for part in NEVER_AT_REST)


def speeds(run: Run) -> tuple[str, ...]:
    """The channels of a run that tell whether the car stands."""
    wheels = (f"wheel.{corner}.speed" for corner in CORNERS)
    return tuple(name for name in ("chassis.v_x", *wheels) if name in run.columns)


def standstill(run: Run) -> tuple[float, float] | None:
    """The longest time, s, in which the car stands: every speed is near 0, every channel quiet.

    Where no speed is recorded it is assumed to stand where every channel is quiet and the
    acceleration along the car is small and steady; a smooth drive at constant speed is alike.
    """
    window = max(3, round(WINDOW / run.sample_step))
    if window > len(run.time) or not np.isfinite(run.time).all():
        return None
    still = np.ones(len(run.time), dtype=bool)
    for name in speeds(run):
        still &= np.abs(run[name]) <= QUIET["speed"]
    for name in run.columns:
        if not has_rest_value(name) or not np.all(np.isfinite(run[name])):
            continue
        limit = max(QUIET[channel(name).quantity], TIMES_NOISE * run.noise.get(name, 0.0))
        still &= _scatter(run[name], window) <= limit
        if name in ("chassis.a_x", "chassis.body_a_x") and not speeds(run):
            mean = uniform_filter1d(run[name], window, mode="nearest")
            change = np.abs(mean[window:] - mean[:-window])
            still &= np.abs(mean) <= LEVEL
            still[window:] &= change <= CHANGE
            still[:-window] &= change <= CHANGE
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    begins, ends = edges[::2], edges[1::2] - 1
    if not begins.size:
        return None
    longest = int(np.argmax(run.time[ends] - run.time[begins]))
    begin, end = float(run.time[begins[longest]]), float(run.time[ends[longest]])
    return (begin, end) if end - begin >= WINDOW else None


def _scatter(values: Array, window: int) -> Array:
    """Standard deviation around each sample."""
    centred = values - np.mean(values)
    mean = uniform_filter1d(centred, window, mode="nearest")
    square = uniform_filter1d(centred**2, window, mode="nearest")
    return np.sqrt(np.maximum(square - mean**2, 0.0))


@dataclass(frozen=True, slots=True)
class Scale:
    """Undo a sensor's gain and bias: x = (reading - bias) / gain.

    gain : reading over truth, negative for a sensor mounted the other way round
    bias : in the channel's SI unit
    """

    kind: ClassVar[str] = "scale"
    channel: str
    gain: Annotated[float, Range("1", -1e6, 1e6, apart=1e-6)] = 1.0
    bias: Annotated[float, Range("1", -1e9, 1e9)] = 0.0

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run with the channel corrected."""
        values = history(run, self.channel)
        noise = {
            name: run.noise[name] / abs(self.gain) for name in run.noise.keys() & {self.channel}
        }
        unit = channel(self.channel).unit
        return Done(
            {self.channel: (values - self.bias) / self.gain},
            sentences=(f"{self.channel}: (reading - {self.bias:g} {unit}) / {self.gain:g}.",),
            noise=noise,
        )


@dataclass(frozen=True, slots=True)
class Rest:
    """Subtract what channels read at rest, so that they count from there.

    channels : none named for all that count from rest
    interval : (begin, end) at standstill, s; None for the longest that is found

    With white noise of standard deviation s, the mean of n samples is off by s / sqrt(n).
    """

    kind: ClassVar[str] = "rest"
    channels: tuple[str, ...] = ()
    interval: tuple[float, float] | None = None

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run with its channels at their rest values at standstill."""
        begin, end = self._interval(run)
        inside = (run.time >= begin) & (run.time <= end)
        if np.count_nonzero(inside) < 3:
            raise ConditioningError(
                f"fewer than 3 samples lie in the interval {begin:g} to {end:g} s; the record goes "
                f"from {run.time[0]:g} to {run.time[-1]:g} s."
            )
        found, numbers = {}, {"begin_s": begin, "end_s": end}
        told = []
        for name in self._names(run):
            values = history(run, name)
            offset = float(np.mean(values[inside])) - REST_VALUES.get(name, 0.0)
            error = float(np.std(values[inside]) / math.sqrt(np.count_nonzero(inside)))
            found[name] = values - offset
            numbers[f"offset.{name}"], numbers[f"standard_error.{name}"] = offset, error
            info = channel(name)
            told.append(f"{name} {info.display_factor * offset:.3g} {info.display_unit}")
        sentences = [f"At rest from {begin:.3f} to {end:.3f} s; took off {', '.join(told)}."]
        if self.interval is None and not speeds(run):
            sentences.append("That the car stands there is assumed: no speed is recorded.")
        return Done(found, numbers=numbers, sentences=tuple(sentences))

    def _interval(self, run: Run) -> tuple[float, float]:
        if self.interval is not None:
            return self.interval
        found = standstill(run)
        if found is None:
            raise ConditioningError(
                f"the car nowhere stands still for {WINDOW} s (every speed at 0, every channel "
                "quiet); give the interval in which it does, or leave this step out."
            )
        return found

    def _names(self, run: Run) -> tuple[str, ...]:
        if not self.channels:
            return tuple(name for name in run.columns if has_rest_value(name))
        for name in self.channels:
            if name in CHANNELS and not has_rest_value(name):
                raise ConditioningError(f"{name} does not count from rest; leave it out.")
        return self.channels
