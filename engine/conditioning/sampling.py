"""Steps that mend the samples themselves: cut, fill, despike, resample."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from ..channels import channel
from ..errors import ConditioningError
from ..filters import is_uniform, low_pass
from ..plausibility import FEWEST_SAMPLES
from ..run import Run
from ..spikes import spike_samples, spikes
from ..vehicle import Range, Vehicle
from .done import Array, Done, history, recorded

ANTIALIAS_ORDER = 8
"""Order in each pass of the low-pass before samples are taken out."""

ANTIALIAS_SHARE = 0.4
"""Its cutoff as a share of the new rate. At 0.6 of it, which folds to 0.4, 1/657 is left."""

GAP_STEPS = 1.5
"""Usual steps from which on two samples have a gap between them."""


MOST_NUMBERS = 2e7
"""Of all channels of a run together, 160 MB."""


@dataclass(frozen=True, slots=True)
class Cut:
    """Keep the samples from `begin` to `end`, s; None for the record's own."""

    kind: ClassVar[str] = "cut"
    begin: float | None = None
    end: float | None = None

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run between two times."""
        begin = run.time[0] if self.begin is None else self.begin
        end = run.time[-1] if self.end is None else self.end
        kept = (run.time >= begin) & (run.time <= end)
        if np.count_nonzero(kept) < FEWEST_SAMPLES:
            raise ConditioningError(
                f"fewer than {FEWEST_SAMPLES} samples lie between {begin:g} and {end:g} s; the "
                f"record goes from {run.time[0]:g} to {run.time[-1]:g} s."
            )
        sentence = f"Kept {np.count_nonzero(kept)} of {kept.size} samples."
        return Done(_at(run, kept), run.time[kept], sentences=(sentence,))


@dataclass(frozen=True, slots=True)
class Fill:
    """Bridge gaps (not a number, or missing samples) by a monotone cubic through what is there.

    channels : none named for all
    longest : of the gaps that are bridged, s
    """

    kind: ClassVar[str] = "fill"
    channels: tuple[str, ...] = ()
    longest: Annotated[float, Range("s", 1e-4, 10.0)] = 0.1

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run without gaps in the channels."""
        time = self._whole(run)
        names = self.channels or tuple(run.columns)
        found, filled, longest = {}, {}, 0.0
        for name in run.columns:
            values = recorded(run, name)
            known = np.isfinite(values)
            if name in names and (not known.all() or len(time) > len(run.time)):
                longest = max(longest, self._longest_gap(run.time, known, name))
                found[name] = PchipInterpolator(run.time[known], values[known])(time)
                filled[name] = float(len(time) - np.count_nonzero(known))
            elif len(time) > len(run.time):
                found[name] = np.full(len(time), np.nan)
                found[name][np.searchsorted(time, run.time)] = values
        for name in names:
            recorded(run, name)
        if len(time) == len(run.time):
            found = {name: values for name, values in found.items() if name in filled}
        numbers = {"longest_gap_s": longest, **{f"filled.{n}": k for n, k in filled.items()}}
        told = ", ".join(f"{count:.0f} in {name}" for name, count in filled.items())
        return Done(
            found,
            time if len(time) > len(run.time) else None,
            numbers=numbers,
            sentences=(f"Filled samples: {told or 'none'}; the longest gap has {longest:.3g} s.",),
        )

    def _whole(self, run: Run) -> Array:
        """The times with those put in that are missing."""
        time = run.time
        steps = np.diff(time)
        usual = float(np.median(steps))
        gaps = np.flatnonzero(steps > GAP_STEPS * usual)
        self._refuse_longer(time, gaps, gaps + 1, "the record")
        _require_fewer(run, len(time) + float(np.sum(steps[gaps] / usual)), "cut the record")
        parts = [np.linspace(time[k], time[k + 1], round(steps[k] / usual) + 1)[1:-1] for k in gaps]
        return np.sort(np.concatenate([time, *parts]))

    def _longest_gap(self, time: Array, known: np.ndarray, name: str) -> float:
        """Of a channel, s; a gap at an end or a longer one is refused."""
        there = np.flatnonzero(known)
        if there.size < FEWEST_SAMPLES or there[0] > 0 or there[-1] < known.size - 1:
            raise ConditioningError(
                f"{name} has no values at {'its end' if known[0] else 'its start'}, which nothing "
                "bridges; cut the record there, or leave the channel out."
            )
        wide = np.flatnonzero(np.diff(there) > 1)
        self._refuse_longer(time, there[wide], there[wide + 1], name)
        spans = time[there[1:]] - time[there[:-1]]
        return float(spans.max(initial=0.0))

    def _refuse_longer(self, time: Array, first: np.ndarray, last: np.ndarray, where: str) -> None:
        spans = time[last] - time[first]
        if spans.size and (widest := int(np.argmax(spans))) >= 0 and spans[widest] > self.longest:
            begin, end = time[first[widest]], time[last[widest]]
            raise ConditioningError(
                f"{where} has no values between {begin:.4g} and {end:.4g} s, longer than "
                f"{self.longest:g} s; cut the record there, or allow a longer gap."
            )


@dataclass(frozen=True, slots=True)
class Despike:
    """Put a straight line in place of samples that tower over their neighbours.

    channels : none named for all
    """

    kind: ClassVar[str] = "despike"
    channels: tuple[str, ...] = ()

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run without spikes in the channels."""
        found, numbers, settled = {}, {}, []
        for name in self.channels or tuple(run.columns):
            values = recorded(run, name)
            off = spike_samples(channel(name), values)
            if off.size:
                kept = np.setdiff1d(np.arange(values.size), off)
                found[name] = np.interp(run.time, run.time[kept], values[kept])
                numbers[f"spikes.{name}"] = float(off.size)
                settled += spikes(channel(name), run.time, values)
        told = ", ".join(f"{numbers[f'spikes.{name}']:.0f} in {name}" for name in found)
        return Done(
            found,
            numbers=numbers,
            sentences=(f"Spikes taken out: {told or 'none'}.",),
            settled=tuple(settled),
        )


@dataclass(frozen=True, slots=True)
class Resample:
    """Carry every channel to evenly spaced times by a cubic spline.

    Where the new rate is lower, what the new samples cannot hold is taken off before by a
    zero-phase low-pass at ANTIALIAS_SHARE of it.
    """

    kind: ClassVar[str] = "resample"
    rate_hz: Annotated[float, Range("Hz", 1.0, 1e5)]

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run at the rate."""
        steps = np.diff(run.time)
        widest, usual = int(np.argmax(steps)), float(np.median(steps))
        if steps[widest] > 10.0 * usual:
            raise ConditioningError(
                f"the record has no samples between {run.time[widest]:.4g} and "
                f"{run.time[widest + 1]:.4g} s; fill or cut it before."
            )
        count = math.floor(run.duration * self.rate_hz + 1e-6) + 1
        _require_fewer(run, count, "lower rate_hz")
        if count < FEWEST_SAMPLES:
            raise ConditioningError(
                f"{count} samples would be left, at least {FEWEST_SAMPLES} are needed; raise "
                "rate_hz."
            )
        time = run.time[0] + np.arange(count) / self.rate_hz
        before = (len(run.time) - 1) / run.duration
        cutoff = ANTIALIAS_SHARE * self.rate_hz
        down = cutoff < 0.45 * before and self.rate_hz < 0.999 * before
        found = {}
        for name in run.columns:
            values = history(run, name)
            if down:
                values = low_pass(run.time, values, cutoff, order=ANTIALIAS_ORDER)
            found[name] = CubicSpline(run.time, values)(np.minimum(time, run.time[-1]))
        passed = math.sqrt(2.0 * cutoff / before) if down else 1.0
        filtered = f", low-passed at {cutoff:.3g} Hz" if down else ""
        spacing = "even" if is_uniform(run.time) else "uneven"
        return Done(
            found,
            time,
            numbers={"rate_before_hz": before, "rate_hz": self.rate_hz},
            band_hz=(None, cutoff if down else 0.5 * before),
            sentences=(f"From {before:.4g} Hz, {spacing}, to {self.rate_hz:g} Hz{filtered}.",),
            noise={name: passed * value for name, value in run.noise.items()},
        )


def _require_fewer(run: Run, samples: float, remedy: str) -> None:
    """Refuse more numbers than memory should hold."""
    numbers = samples * (1 + len(run.columns))
    if numbers > MOST_NUMBERS:
        raise ConditioningError(
            f"{samples:.3g} samples of {len(run.columns)} channels would be made, more than "
            f"{MOST_NUMBERS:.0e} numbers; {remedy}."
        )


def _at(run: Run, kept: np.ndarray) -> dict[str, Array]:
    return {name: run[name][kept] for name in run.columns}
