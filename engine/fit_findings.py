"""What a fit should tell about its runs: wrong signs and units, channels the model cannot follow.

All functions compare one measured channel with the model and return a sentence that names run and
channel, or None. The model at the start values is as telling as the fitted one: a fit to a record
of the wrong sign bends the car until the two look alike.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .fit import ParameterEstimate
from .problem import Observation
from .simulation import fit_percent
from .uncertainty import Uncertainty

Array = NDArray[np.float64]
Histories = Mapping[str, Mapping[str, Array]]
"""(samples,) by run and channel."""

OPPOSITE = -0.5
"""Correlation with the model below which a channel counts as turned over."""

POOR_FIT = 50.0
"""Fit percent below which a channel is reported, unless noise alone explains it."""

NOISE_EXPLAINS = 2.0
"""Residuals up to this many times the stated noise are noise."""

UNIT_RATIOS = {
    "chassis.z": ((1e3, 3.0, "mm", "m"), (1e-3, 3.0, "m", "mm")),
    "chassis.pitch": ((57.3, 2.5, "deg", "rad"), (1 / 57.3, 2.5, "rad", "deg")),
    "chassis.roll": ((57.3, 2.5, "deg", "rad"), (1 / 57.3, 2.5, "rad", "deg")),
}
"""By channel: the ratio of measured to model amplitude that a mistaken unit makes, the factor
around it that counts, the unit of the numbers and the unit the header claims."""

UNEXCITED = 0.5
"""A parameter is unexcited when, even with all others known, its 95 % half-width would exceed
this share of its scale."""

TOLD_APART = 0.9
"""Correlation from which an undetermined parameter is said to be confused with another."""


def correlation(measured: Array, model: Array) -> float:
    """Correlation of the two histories about their means; 0 when one of them never moves."""
    one, other = measured - np.mean(measured), model - np.mean(model)
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(one @ other) / size if size > 0.0 else 0.0


def wrong_sign(run: str, channel: str, measured: Array, start: Array, fitted: Array) -> str | None:
    """A channel that runs against the model, before the fit or after it."""
    at_start, after = correlation(measured, start), correlation(measured, fitted)
    if min(at_start, after) > OPPOSITE:
        return None
    when = "at the start values" if at_start <= after else "after the fit"
    return (
        f"{channel} of run {run} runs against the model (correlation {min(at_start, after):.2f} "
        f"{when}); its sign is probably wrong: multiply it by -1."
    )


def wrong_unit(run: str, channel: str, measured: Array, start: Array) -> str | None:
    """A channel whose amplitude is a unit's factor away from the model's at the start values."""
    amplitude = float(np.std(start))
    ratio = float(np.std(measured)) / amplitude if amplitude > 0.0 else 0.0
    for expected, spread, numbers, header in UNIT_RATIOS[channel]:
        if expected / spread < ratio < expected * spread:
            return (
                f"{channel} of run {run} moves {ratio:.3g} times as much as the model; its numbers "
                f"may be in {numbers} under a header that says {header}: correct the header."
            )
    return None


def poor_fit(run: str, channel: str, measured: Array, fitted: Array, noise: float) -> str | None:
    """A channel which the fitted model follows badly, for other reasons than its noise."""
    if np.ptp(measured) == 0.0:
        return f"{channel} of run {run} never moves; leave it out if its sensor was dead."
    percent = fit_percent(measured, fitted)
    misfit = float(np.sqrt(np.mean((measured - fitted) ** 2)))
    if percent >= POOR_FIT or misfit <= NOISE_EXPLAINS * noise:
        return None
    return (
        f"The model follows {channel} of run {run} poorly (fit {percent:.0f} %); check the "
        "channel, the car's known data and the start values."
    )


def channel_findings(
    observations: Sequence[Observation], start: Histories, fitted: Histories
) -> list[str]:
    """Findings about every compared channel; a wrong sign or unit explains a poor fit."""
    found: list[str] = []
    for seen in observations:
        opposite = []
        for channel, measured in seen.measured.items():
            before, after = start[seen.name][channel], fitted[seen.name][channel]
            sign = wrong_sign(seen.name, channel, measured, before, after)
            unit = wrong_unit(seen.name, channel, measured, before)
            opposite += [channel] if sign else []
            explained = [sentence for sentence in (sign, unit) if sentence]
            poor = poor_fit(seen.name, channel, measured, after, seen.noise[channel])
            found += explained or ([poor] if poor else [])
        if len(opposite) > 1 and len(opposite) == len(seen.measured):
            found.append(
                f"All compared channels of run {seen.name} run against the model; perhaps it is "
                "the wheel.*.z that have the wrong sign."
            )
    return found


def parameter_findings(estimates: Sequence[ParameterEstimate], errors: Uncertainty) -> list[str]:
    """Findings about parameters at a bound or not determined by the runs."""
    found = []
    for k, one in enumerate(estimates):
        if one.at_bound:
            side, bound = (
                ("lower", one.lower)
                if one.value - one.lower < one.upper - one.value
                else ("upper", one.upper)
            )
            found.append(
                f"{one.name} is at its {side} bound, {bound:.4g} {one.unit}; widen the bound or "
                "fix the parameter."
            )
        elif one.determined == "no":
            found.append(_undetermined(estimates, errors, k))
    return found


def _undetermined(estimates: Sequence[ParameterEstimate], errors: Uncertainty, k: int) -> str:
    one = estimates[k]
    scale = max(abs(one.value), abs(one.start))
    if not errors.alone[k] < UNEXCITED * scale:
        return f"The runs do not excite {one.name}; fix it or add a run that does."
    partners = np.abs(np.nan_to_num(errors.correlation[k], nan=1.0))
    partners[k] = 0.0
    nearest = int(np.argmax(partners))
    if partners[nearest] > TOLD_APART:
        return (
            f"The runs hardly tell {one.name} from {estimates[nearest].name}; fix one of them or "
            "add a run that moves them differently."
        )
    return (
        f"The runs do not determine {one.name}: its 95 % interval is wider than half its value; "
        "fix it or measure more."
    )
