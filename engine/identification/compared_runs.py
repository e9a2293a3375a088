"""Runs as an identification compares them: named apart, checked, prepared, with their noise."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..channels import LARGEST_NOISE, OUTPUT_CHANNELS, SMALLEST_NOISE, conditioned_first
from ..errors import ProblemError
from ..filters import low_pass, too_coarse
from ..run import Run
from ..run_notes import DEFAULT_NOISE
from ..simulation.rims import RimsInputs, filtered_outputs, prepare
from ..simulation.rims_settings import RimsSettings
from ..vehicle import Vehicle
from .cars import another_car
from .noise_source import NoiseSource
from .sensing import corrected, where_driven
from .sensor_model import SensorModel

Array = NDArray[np.float64]

MOVES = 1.2
"""A channel moves when its standard deviation is more than this many times that of its noise."""

FAST = 5.0
"""Frequency, Hz, above which a channel shows its noise."""

SENSORS_BEST = 0.02
"""Share of the default noise below which no sensor's own noise is taken to lie."""


@dataclass(frozen=True, slots=True)
class ComparedRun:
    """One run as the fit compares it.

    measured : channel -> (samples,) as read, through the output filter
    noise : channel -> standard deviation of what is read, SI
    noise_source : channel -> where that is from
    warnings : sentences about the run
    plant : which virtual car drove, as `Run.plant`
    """

    name: str
    inputs: RimsInputs
    measured: Mapping[str, Array]
    noise: Mapping[str, float]
    noise_source: Mapping[str, NoiseSource]
    warnings: tuple[str, ...] = ()
    plant: str = ""


def compared_runs(
    vehicle: Vehicle,
    runs: Sequence[Run],
    noise: Mapping[str, float],
    outputs: Sequence[str] | Mapping[str, Sequence[str]] | None,
    settings: RimsSettings,
    sensors: SensorModel,
) -> tuple[ComparedRun, ...]:
    """The runs, checked and prepared; arguments as of `Problem.build`.

    Raises ProblemError, MeasurementError or VehicleError.
    """
    if not runs:
        raise ProblemError("No run is given; give at least one recording.")
    names = distinct_names(runs)
    if isinstance(outputs, Mapping):
        strangers = [name for name in outputs if name not in names]
        if strangers:
            raise ProblemError(
                f'Channels are chosen for a run "{strangers[0]}", but the runs are '
                f"{', '.join(names)}."
            )
    for channel, deviation in noise.items():
        if channel not in OUTPUT_CHANNELS:
            raise ProblemError(
                f"A noise is stated for {channel}; the compared channels are "
                f"{', '.join(OUTPUT_CHANNELS)}."
            )
        if not SMALLEST_NOISE <= deviation <= LARGEST_NOISE:
            raise ProblemError(
                f"The noise of {channel} is {deviation:g}; it must lie between {SMALLEST_NOISE:g} "
                f"and {LARGEST_NOISE:g}."
            )
    if twice := [channel for channel in sensors.noise() if channel in noise]:
        raise ProblemError(
            f"The noise of {twice[0]} is stated twice, by itself and as sensor.{twice[0]}.noise; "
            "leave out one of them."
        )
    readings = sensors.readings()
    defaults = {
        channel: deviation * abs(sensors.reading(channel).gain)
        for channel, deviation in DEFAULT_NOISE.items()
    }
    typed = {**noise, **sensors.noise()}
    found = []
    for name, run in zip(names, runs, strict=True):
        chosen = outputs.get(name) if isinstance(outputs, Mapping) else outputs
        measured = filtered_outputs(where_driven(run, readings), settings.output_band)
        if not measured:
            raise ProblemError(
                f"Run {name} has none of {', '.join(OUTPUT_CHANNELS)}; at least one is needed"
                f"{conditioned_first(run.columns)}."
            )
        compared = {
            channel: measured[channel] for channel in _chosen_channels(name, measured, chosen)
        }
        for channel, values in compared.items():
            if not np.all(np.isfinite(values)):
                raise ProblemError(
                    f"Run {name} has gaps (not a number) in {channel}; leave the channel out."
                )
        told = defaults | dict(run.noise) | typed
        inputs = prepare(corrected(run, readings), vehicle, settings, unzeroed=sensors.unzeroed)
        found.append(
            ComparedRun(
                name,
                inputs,
                compared,
                {channel: float(told[channel]) for channel in compared},
                {channel: _source(channel, run, typed) for channel in compared},
                (*another_car(run, vehicle), *inputs.warnings),
                run.plant,
            )
        )
    return tuple(found)


def _source(channel: str, run: Run, typed: Mapping[str, float]) -> NoiseSource:
    if channel in typed:
        return "typed"
    return "stated" if channel in run.noise else "default"


def require_motion(runs: Sequence[Run], compared: Sequence[ComparedRun]) -> None:
    """Raise ProblemError where no channel moves beyond its noise."""
    if not any(
        _moves(run, channel, seen.noise[channel], seen.noise_source[channel] != "default")
        for run, seen in zip(runs, compared, strict=True)
        for channel in seen.measured
    ):
        raise ProblemError(_at_rest(compared))


def _moves(run: Run, channel: str, noise: float, stated: bool) -> bool:
    """Whether a channel moves more than its noise: as stated, else as the record shows it.

    A body hardly moves above FAST; what is there is noise, taken to be as dense below.
    """
    step = float(np.mean(np.diff(run.time)))
    values = run[channel]
    if not stated and not too_coarse(step, FAST):
        fast = float(np.std(values - low_pass(run.time, values, FAST)))
        seen = fast / math.sqrt(1.0 - 2.0 * step * FAST)
        noise = min(max(seen, SENSORS_BEST * noise), noise)
    return float(np.std(values)) > MOVES * noise


def _at_rest(runs: Sequence[ComparedRun]) -> str:
    names = [seen.name for seen in runs]
    which = f"run {names[0]}" if len(names) == 1 else f"runs {', '.join(names)}"
    channels = dict.fromkeys(name for seen in runs for name in seen.measured)
    return (
        f"Nothing can be learnt from {which}: {', '.join(channels)} "
        f"{'stays within its' if len(channels) == 1 else 'stay within their'} noise; give a run "
        "in which the car moves, or correct the noise if it is stated too large."
    )


def distinct_names(runs: Sequence[Run]) -> list[str]:
    """The runs' names, numbered where two runs share one; the same data twice is refused."""
    names: list[str] = []
    for k, run in enumerate(runs):
        for earlier in runs[:k]:
            if same_data(run, earlier):
                raise ProblemError(
                    f"Run {run.name} is the same recording as {earlier.name}; list it once."
                )
        alike = sum(run.name == earlier.name for earlier in runs[:k])
        names.append(f"{run.name} ({alike + 1})" if alike else run.name)
    return names


def same_data(one: Run, other: Run) -> bool:
    """Whether two runs hold the same channels with the same values."""
    return (
        len(one.time) == len(other.time)
        and set(one.channels) == set(other.channels)
        and all(np.array_equal(one[name], other[name]) for name in one.channels)
    )


def _chosen_channels(
    run_name: str, measured: Mapping[str, Array], chosen: Sequence[str] | None
) -> list[str]:
    if chosen is None:
        return list(measured)
    if not chosen:
        raise ProblemError(f"No channel is chosen for run {run_name}; choose at least one.")
    for channel in chosen:
        if channel not in OUTPUT_CHANNELS:
            raise ProblemError(
                f"{channel} cannot be compared; choose from {', '.join(OUTPUT_CHANNELS)}."
            )
        if channel not in measured:
            raise ProblemError(f"Run {run_name} has no {channel}; it has {', '.join(measured)}.")
    return [channel for channel in OUTPUT_CHANNELS if channel in chosen]
