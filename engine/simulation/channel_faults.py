"""A recorded channel that is probably wrong by the model: its sign, its unit, a dead sensor.

A measured channel is compared with what its sensor reads of the model. A fit to a record of the
wrong sign bends the car until the two look alike, so that the model before it is as telling.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..spikes import despiked
from ..units import listed

Array = NDArray[np.float64]
Histories = Mapping[str, Array]
"""(samples,) by channel."""

OPPOSITE = -0.5
"""Correlation with the model below which a channel counts as turned over."""

EXCHANGED = {
    "chassis.pitch": ", unless it is the front and rear wheels whose columns are exchanged",
    "chassis.roll": ", unless it is the left and right wheels whose columns are exchanged",
}
"""What turns a channel over as its own sign does."""

ALIKE = 5.0
"""Factor between measured and model amplitude up to which their signs are compared."""

STANDING = {"chassis.z": 0.1, "chassis.pitch": 0.06, "chassis.roll": 0.06}
"""Standard deviation (m, rad) beyond which a model has fallen over and is no witness."""

LEAST_MOTION = 1e-4
"""Share of it below which a model does not move: 10 um, or 0.3 thousandths of a degree."""

NOISE_EXPLAINS = 2.0
"""Residuals up to this many times the stated noise are noise."""

DEGREES = 180.0 / math.pi

UNIT_RATIOS = {
    "chassis.z": ((1e3, 3.0, "mm", "m"), (1e-3, 3.0, "m", "mm")),
    "chassis.pitch": ((DEGREES, 2.5, "deg", "rad"), (1 / DEGREES, 2.5, "rad", "deg")),
    "chassis.roll": ((DEGREES, 2.5, "deg", "rad"), (1 / DEGREES, 2.5, "rad", "deg")),
}
"""By channel: the ratio of measured to model amplitude that a mistaken unit makes, the factor
around it that counts, the unit of the numbers and the unit the header claims."""


@dataclass(frozen=True, slots=True)
class Fault:
    """What is probably wrong with a channel; `factor` of its readings, where that would mend it."""

    sentence: str
    factor: float | None = None


@dataclass(frozen=True, slots=True)
class ChannelFaults:
    """All that is probably wrong with a run's channel; `beside` tells what else it may be."""

    found: tuple[Fault, ...]
    beside: list[str] = field(default_factory=list)

    @property
    def sentences(self) -> list[str]:
        """Them all, for a person."""
        return [*(one.sentence for one in self.found), *self.beside]


def correlation(measured: Array, model: Array) -> float:
    """Correlation of the two histories about their means; 0 when one of them never moves."""
    one, other = measured - np.mean(measured), model - np.mean(model)
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(one @ other) / size if size > 0.0 else 0.0


def _amplitude_ratio(channel: str, measured: Array, model: Array) -> float:
    """Measured over model amplitude; 0 for a model that never moves or has fallen over."""
    of_measured, of_model = (float(np.std(despiked(one))) for one in (measured, model))
    moves = LEAST_MOTION * STANDING[channel] < of_model < STANDING[channel]
    return of_measured / of_model if moves else 0.0


def wrong_sign(
    run: str, channel: str, measured: Array, model: Array, fitted: Array | None = None
) -> Fault | None:
    """A channel that runs against the model, at the start values or after the fit if there is one.

    A model that moves much more or less than the channel is no witness.
    """
    witnesses = [(model, "")]
    if fitted is not None:
        witnesses = [(model, " at the start values"), (fitted, " after the fit")]
    for model, when in witnesses:
        opposed = correlation(measured, model)
        if opposed < OPPOSITE and 1.0 / ALIKE < _amplitude_ratio(channel, measured, model) < ALIKE:
            return Fault(
                f"{channel} of run {run} runs against the model (correlation {opposed:.2f}{when});"
                f" its sign is probably wrong: multiply it by -1{EXCHANGED.get(channel, '')}.",
                -1.0,
            )
    return None


def wrong_unit(run: str, channel: str, measured: Array, model: Array) -> Fault | None:
    """A channel whose amplitude is a unit's factor away from the model's."""
    ratio = _amplitude_ratio(channel, measured, model)
    for expected, spread, numbers, header in UNIT_RATIOS[channel]:
        if expected / spread < ratio < expected * spread:
            return Fault(
                f"{channel} of run {run} moves {ratio:.3g} times as much as the model; its numbers "
                f"may be in {numbers} under a header that says {header}: correct the header.",
                expected,
            )
    return None


def dead_sensor(
    run: str, channel: str, measured: Array, model: Array, noise: float
) -> Fault | None:
    """A channel that never moves although the model does, beyond its noise."""
    if np.ptp(measured) > 0.0 or float(np.std(model)) <= NOISE_EXPLAINS * noise:
        return None
    return Fault(
        f"{channel} of run {run} never moves while the model does; its sensor was probably dead: "
        "leave the channel out."
    )


def channel_faults(
    run: str,
    measured: Histories,
    noise: Mapping[str, float],
    model: Histories,
    fitted: Histories | None = None,
) -> dict[str, ChannelFaults]:
    """What is probably wrong with a run's channels.

    noise : standard deviation, SI
    model : at the start values, where there is a fitted one
    """
    found: dict[str, ChannelFaults] = {}
    opposed = []
    for channel, values in measured.items():
        before, after = model[channel], None if fitted is None else fitted[channel]
        sign = wrong_sign(run, channel, values, before, after)
        unit = wrong_unit(run, channel, values, before)
        dead = dead_sensor(run, channel, values, before, noise[channel])
        opposed += [channel] if sign else []
        if sign or unit or dead:
            found[channel] = ChannelFaults(tuple(one for one in (sign, unit, dead) if one))
    if len(opposed) > 1:
        found[opposed[-1]].beside.append(
            f"Since {listed(opposed)} of run {run} run against the model together, it may "
            "rather be the wheel.*.z whose sign is wrong."
        )
    return found
