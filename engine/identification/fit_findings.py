"""What a fit should tell about its runs, in sentences: wrong channels and those that the model
cannot follow, outliers, other minima, and what the runs do not determine.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..simulation.channel_faults import NOISE_EXPLAINS, ChannelFaults, channel_faults
from ..simulation.comparison import fit_percent
from ..units import after_number, in_percent, listed
from .compared_runs import ComparedRun
from .fit import (
    CombinationEstimate,
    Estimate,
    FittedRun,
    Minimum,
    SensorEstimate,
    Verdict,
)
from .problem import Problem
from .uncertainty import Uncertainty

Array = NDArray[np.float64]
Histories = Mapping[str, Mapping[str, Array]]
"""(samples,) by run and channel."""

POOR_FIT = 50.0
"""Fit percent below which a channel is reported, unless noise alone explains it."""

FEW_OUTLIERS, MANY_OUTLIERS = 0.005, 0.2
"""Shares of a channel beyond the loss's scale: from the first they are more than the noise's own
(0.3 % beyond three), from the second no outliers."""

AS_GOOD = 1.02
"""Times the lowest cost up to which another minimum fits about as well: its residuals' rms is a
hundredth larger."""

UNEXCITED = 0.5
"""A parameter is unexcited when, even with all others known, its 95 % half-width would exceed
this share of its scale."""

TOLD_APART = 0.9
"""Correlation from which an undetermined parameter is said to be confused with another."""


def well_driven(runs: Sequence[ComparedRun]) -> list[ComparedRun]:
    """Runs whose wheels and a_x are not in doubt; in the others every output would look wrong."""
    return [seen for seen in runs if not seen.inputs.faults]


def faults_of_channels(
    runs: Sequence[ComparedRun], model: Histories, fitted: Histories | None = None
) -> dict[tuple[str, str], ChannelFaults]:
    """By run and channel, what is probably wrong; of well driven runs alone.

    model : at the start values, where there is a fitted one
    """
    return {
        (seen.name, channel): found
        for seen in well_driven(runs)
        for channel, found in channel_faults(
            seen.name,
            seen.measured,
            seen.noise,
            model[seen.name],
            None if fitted is None else fitted[seen.name],
        ).items()
    }


def fault_sentences(
    runs: Sequence[ComparedRun], of_channels: Mapping[tuple[str, str], ChannelFaults]
) -> tuple[str, ...]:
    """All because of which the runs determine nothing: of what drives them, and of channels."""
    return (
        *(sentence for seen in runs for sentence in seen.inputs.faults),
        *(sentence for found in of_channels.values() for sentence in found.sentences),
    )


def poor_fit(run: str, channel: str, measured: Array, fitted: Array, noise: float) -> str | None:
    """A channel which the fitted model follows badly, for other reasons than its noise."""
    percent = fit_percent(measured, fitted)
    misfit = float(np.sqrt(np.mean((measured - fitted) ** 2)))
    if percent >= POOR_FIT or misfit <= NOISE_EXPLAINS * noise:
        return None
    return (
        f"The model follows {channel} of run {run} poorly (fit {percent:.0f} %); check the "
        "channel, the car's known data and the start values."
    )


def poor_fits(runs: Sequence[ComparedRun], fitted: Histories) -> list[str]:
    """Sentences on channels followed badly."""
    found = (
        poor_fit(seen.name, channel, measured, fitted[seen.name][channel], seen.noise[channel])
        for seen in runs
        for channel, measured in seen.measured.items()
    )
    return [sentence for sentence in found if sentence]


def hardly_moving(runs: Sequence[ComparedRun]) -> list[str]:
    """Sentences on runs that move little more than their noise."""
    return [
        f"In run {seen.name} {', '.join(seen.measured)} move hardly more than their noise; it says "
        "little of the car, so add a livelier run."
        for seen in runs
        if all(
            float(np.std(values)) < NOISE_EXPLAINS * seen.noise[channel]
            for channel, values in seen.measured.items()
        )
    ]


def outlier_findings(problem: Problem, runs: Sequence[FittedRun]) -> list[str]:
    """Sentences on what a loss counts for less: a few outliers, or most of a channel."""
    loss, found = problem.loss, []
    for run in runs:
        for channel, count in run.discounted.items():
            share = count / run.samples
            if share > MANY_OUTLIERS:
                found.append(
                    f"{in_percent(share)} of {channel} of run {run.name} lie beyond "
                    f"{loss.scale:g} noises of the model, too many for outliers: the {loss.name} "
                    "loss mends no misfit, so check the noise and the car's known data."
                )
            elif share > FEW_OUTLIERS:
                found.append(
                    f"{count} of {run.samples} samples of {channel} of run {run.name} lie beyond "
                    f"{loss.scale:g} noises of the model; the {loss.name} loss counts them for "
                    "less."
                )
    return found


def minima_findings(minima: Sequence[Minimum]) -> list[str]:
    """Where the start values alone would have led, and minima that fit as well as the best."""
    best, *others = minima
    found = []
    led = next(one for one in minima if one.from_start)
    if led is not best:
        found.append(
            f"From the start values alone the fit would have ended at a cost of {led.cost:.5g} in "
            f"place of {best.cost:.5g}."
        )
    for other in others:
        if other.cost < AS_GOOD * best.cost:
            apart = max(best.parameters, key=lambda name: _ratio(best, other, name))
            found.append(
                f"Another minimum fits nearly as well (cost {other.cost:.5g} against "
                f"{best.cost:.5g}): {apart} is {other.parameters[apart]:.4g} there in place of "
                f"{best.parameters[apart]:.4g}; add a run that tells them apart."
            )
    return found


def _ratio(one: Minimum, other: Minimum, name: str) -> float:
    """How far two minima are apart in a parameter, relative."""
    first, second = one.parameters[name], other.parameters[name]
    return abs(first - second) / max(abs(first), abs(second), 1e-9)


def bound_findings(estimates: Sequence[Estimate], verdict: Verdict) -> list[str]:
    """What is at a bound, and whether a wider one would help."""
    return [_at_bound(one, verdict) for one in estimates if one.at_bound]


def undetermined_findings(
    estimates: Sequence[Estimate],
    errors: Uncertainty,
    combinations: Sequence[CombinationEstimate] = (),
) -> list[str]:
    """What the runs do not determine, grouped by what can be done about it.

    errors : of all estimates, in their order
    combinations : those that the verdict tells of; a pair in one of them is not told again
    """
    unexcited, confused, unknown, sensors = [], [], [], []
    for k, one in enumerate(estimates):
        if one.at_bound or one.determined != "no":
            continue
        partner = _partner(errors, k)
        if not _excited(errors, k):
            unexcited.append(one.title)
        elif partner is None:
            (sensors if isinstance(one, SensorEstimate) else unknown).append(one.title)
        elif sorted([k, partner]) not in confused:
            confused.append(sorted([k, partner]))
    found = []
    if unexcited:
        remedy = "fix it" if len(unexcited) == 1 else "fix them"
        found.append(
            f"The runs do not excite {', '.join(unexcited)}; {remedy} or add a run that does."
        )
    for first, second in ((estimates[one], estimates[other]) for one, other in confused):
        if not any({first.name, second.name} <= {*one.of} for one in combinations):
            found.append(
                f"The runs hardly tell {first.title} from {second.title}; fix one of them or add a "
                "run that moves them differently."
            )
    if unknown:
        found.append(
            f"The runs leave {', '.join(unknown)} with a 95 % interval wider than half the value; "
            "fix some of the parameters or measure more."
        )
    if sensors:
        found.append(
            f"The runs leave {', '.join(sensors)} open; fix what is known of the sensors or measure"
            " more."
        )
    return found


def _at_bound(one: Estimate, verdict: Verdict) -> str:
    at_lower = one.value - one.lower < one.upper - one.value
    side, bound = ("lower", one.lower) if at_lower else ("upper", one.upper)
    said = f"{one.title} is at its {side} bound, {bound:.4g}{after_number(one.unit)}"
    if isinstance(one, SensorEstimate):
        return f"{said}; check the sensor, or the car's known data."
    if one.name.endswith("knee_speed") and not at_lower:
        return (
            f"{said}: the runs show no knee, as"
            " if the damper kept its slopes at every speed; fix it or add a rougher run."
        )
    if one.name in verdict.conditions:
        return f"{said}, and holds others back; widen the bound, or fix it if it is known."
    for combination in verdict.combinations:
        others = [name for name in combination.of if name != one.name]
        if one.name in combination.of and others:
            return (
                f"{said}; the runs know it only together with {listed(others)}, as "
                f"{combination.symbol}, so a wider bound would not help: fix one of them at its "
                "known value, or add a run that tells them apart."
            )
    return f"{said}; widen the bound or fix the parameter."


def _excited(errors: Uncertainty, k: int) -> bool:
    """Whether the runs would determine the parameter if all others were known."""
    return bool(errors.quantile * errors.alone[k] < UNEXCITED)


def _partner(errors: Uncertainty, k: int) -> int | None:
    """The parameter with which one is confused; those in an undetermined direction first."""
    strength = np.abs(np.nan_to_num(errors.correlation[k], nan=0.0))
    if np.isinf(errors.std_error[k]):
        strength = np.where(np.isinf(errors.std_error), 1.0, 0.0)
    strength[k] = 0.0
    nearest = int(np.argmax(strength))
    return nearest if strength[nearest] > TOLD_APART else None
