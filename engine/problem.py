"""What an identification is asked: runs, a car, free parameters, sensors and their noise.

`Problem.build` checks everything a caller can mend before any simulation, and prepares the inputs
of the rims mode once for all of them.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from .car_rows import car_rows
from .channels import OUTPUT_CHANNELS, Run
from .equilibrium import static_loads
from .errors import ProblemError, VehicleError
from .filters import low_pass, too_coarse
from .loss import Loss
from .parameters import ALL_NAMES, PARAMETER_NAMES, damper_starts, default_bounds, parameter
from .priors import Prior, checked_prior
from .rims import RimsInputs, filtered_outputs, prepare
from .rims_settings import RimsSettings
from .run_notes import DEFAULT_NOISE
from .sensing import Reading, corrected, where_driven
from .sensor_model import SensorModel, SensorVariable, sensor_model
from .simulation import Traction
from .units import after_number
from .variables import FreeParameter, Variable
from .vehicle import Vehicle

Array = NDArray[np.float64]
Given = TypeVar("Given")

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
    noise_source : channel -> where that is from: "stated", "default" or "fitted"
    """

    name: str
    inputs: RimsInputs
    measured: Mapping[str, Array]
    noise: Mapping[str, float]
    noise_source: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Problem:
    """A checked identification problem; `vehicle` carries the start values.

    free : parameters to be found;  fitted : what is to be found of the sensors beside them
    """

    vehicle: Vehicle
    runs: tuple[ComparedRun, ...]
    free: tuple[FreeParameter, ...]
    traction: Traction
    settings: RimsSettings
    loss: Loss = Loss()
    priors: tuple[Prior, ...] = ()
    sensors: SensorModel = field(default_factory=SensorModel)
    fitted: tuple[SensorVariable, ...] = ()

    @classmethod
    def build(
        cls,
        vehicle: Vehicle,
        runs: Sequence[Run],
        free: Iterable[str] | None = None,
        fixed: Iterable[str] | None = None,
        *,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        start: Mapping[str, float] | None = None,
        noise: Mapping[str, float] | None = None,
        outputs: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
        traction: Traction = "exact",
        settings: RimsSettings | None = None,
        loss: Loss | None = None,
        priors: Mapping[str, tuple[float, float]] | None = None,
        sensors: Mapping[str, Mapping[str, Any]] | None = None,
        fit_noise: bool = False,
    ) -> "Problem":
        """A problem from its parts, or one sentence on what is wrong with them.

        free : names or symbols of the parameters to find; the twelve of PARAMETERS without
        fixed : those to leave at the vehicle's (or the start's) value
        bounds, start : by parameter name; default_bounds and the vehicle's values without, those of
            damper_starts where its damper is linear
        noise : standard deviation by channel, over what the runs state, over DEFAULT_NOISE
        outputs : channels to compare, for all runs or by run name; all that a run has without
        loss : how much a residual counts; the linear one without
        priors : (mean, standard deviation) of free parameters by name, SI
        sensors : by channel and quantity a number or "fit" (`sensor_model`); ideal ones without
        fit_noise : whether the noise is found where `sensors` fixes none

        Raises ProblemError, ParameterError, MeasurementError or VehicleError.
        """
        settings = settings or RimsSettings()
        if traction not in get_args(Traction):
            raise ProblemError(f'traction is "{traction}"; it can be "exact" or "paper".')
        names = _free_names(free, fixed)
        start = damper_starts(vehicle, names) | _by_name(start or {}, "start value")
        try:
            vehicle = vehicle.with_values(start)
            static_loads(vehicle)
        except VehicleError as error:
            raise ProblemError(f"A start value cannot be used: {error}") from error
        limits = _by_name(bounds or {}, "pair of bounds")
        if held := [name for name in limits if name not in names]:
            raise ProblemError(
                f"Bounds are given for {held[0]}, which is not free; free it or leave them out."
            )
        parameters = tuple(_free_parameter(vehicle, name, limits.get(name)) for name in names)
        model = sensor_model(
            sensors or {}, fit_noise=fit_noise, biased=settings.output_highpass_hz is None
        )
        compared = _compared_runs(vehicle, runs, noise or {}, outputs, settings, model)
        fitted = model.variables([(seen.name, seen.measured) for seen in compared])
        samples = sum(len(measured) for seen in compared for measured in seen.measured.values())
        if samples <= (unknown := len(parameters) + len(fitted)):
            raise ProblemError(
                f"{samples} samples cannot determine {unknown} parameters; free fewer "
                "or measure longer."
            )
        if not any(
            _moves(run, channel, seen.noise[channel], seen.noise_source[channel] == "stated")
            for run, seen in zip(runs, compared, strict=True)
            for channel in seen.measured
        ):
            raise ProblemError(_at_rest(compared))
        known = tuple(
            checked_prior(name, prior, parameters)
            for name, prior in _by_name(priors or {}, "prior").items()
        )
        return cls(
            vehicle,
            compared,
            parameters,
            traction,
            settings,
            loss or Loss(),
            known,
            model,
            fitted,
        )

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All that is to be found, in the order of x: the free parameters, then the sensors'."""
        return (*self.free, *self.fitted)

    def of_car(self, x: Array) -> Array:
        """The part of x that is the car's."""
        return x[: len(self.free)]

    def as_fitted(self, fit: Mapping[str, Any]) -> "Problem":
        """The same problem from where a fit of it ended, given as JSON, and with its noise."""
        values = {one["name"]: one["value"] for one in fit["parameters"]}
        of_sensors = {(one["name"], one["run"]): one["value"] for one in fit.get("sensors", ())}
        noise = {
            (run["name"], channel): run["noise"][channel]
            for run in fit["runs"]
            for channel, source in run.get("noise_source", {}).items()
            if source == "fitted"
        }
        return replace(
            self.with_noise(noise),
            vehicle=self.vehicle.with_values(values),
            free=tuple(replace(one, start=values[one.name]) for one in self.free),
            fitted=tuple(
                replace(one, start=of_sensors.get((one.name, one.run), one.start))
                for one in self.fitted
            ),
        )

    def values(self, x: Array) -> Array:
        """The free parameters at the optimiser's variables x."""
        of_car = self.of_car(x).tolist()
        return np.array([one.value(v) for one, v in zip(self.free, of_car, strict=True)])

    def reading(self, x: Array, channel: str, run: str) -> Reading:
        """The sensor of a run's channel at the optimiser's variables x."""
        of_sensors = x[len(self.free) :].tolist()
        found = {
            one.quantity: one.value(v)
            for one, v in zip(self.fitted, of_sensors, strict=True)
            if one.channel == channel and one.run in (None, run)
        }
        return self.sensors.reading(channel, found)

    def with_noise(self, found: Mapping[tuple[str, str], float]) -> "Problem":
        """The same problem with other noise of some channels, found by run and channel."""
        runs = [
            replace(
                seen,
                noise={name: found.get((seen.name, name), was) for name, was in seen.noise.items()},
                noise_source={
                    name: "fitted" if (seen.name, name) in found else was
                    for name, was in seen.noise_source.items()
                },
            )
            for seen in self.runs
        ]
        return replace(self, runs=tuple(runs))

    def vehicle_at(self, x: Array) -> Vehicle:
        """The car at the optimiser's variables x."""
        names = (one.name for one in self.free)
        return self.vehicle.with_values(dict(zip(names, self.values(x).tolist(), strict=True)))

    def cars_at(self, trials: Sequence[Array]) -> Array:
        """Rows (C, CAR_ROWS) of the cars at many of the optimiser's variables; one is not a number
        throughout where bounds admit a geometry that no car can have.
        """
        names = [one.name for one in self.free]
        return car_rows(self.vehicle, names, np.array([self.values(x) for x in trials]))


def _by_name(given: Mapping[str, Given], what: str) -> dict[str, Given]:
    """Values by the parameters' names, which may be given by symbol."""
    named: dict[str, Given] = {}
    for key, value in given.items():
        name = parameter(key).name
        if name in named:
            raise ProblemError(f"{name} has more than one {what}; give one, by name or by symbol.")
        named[name] = value
    return named


def _free_names(free: Iterable[str] | None, fixed: Iterable[str] | None) -> list[str]:
    held = _listed(fixed or (), "fixed")
    wanted = list(PARAMETER_NAMES) if free is None else _listed(free, "free")
    both = [name for name in held if free is not None and name in wanted]
    if both:
        raise ProblemError(f"{both[0]} is listed both as free and as fixed; leave one of the two.")
    names = [name for name in ALL_NAMES if name in wanted and name not in held]
    if not names:
        raise ProblemError(
            "No parameter is free; free at least one, e.g. front.suspension.stiffness."
        )
    return names


def _listed(names: Iterable[str], role: str) -> list[str]:
    known = [parameter(name).name for name in names]
    doubled = [name for k, name in enumerate(known) if name in known[:k]]
    if doubled:
        raise ProblemError(f"{doubled[0]} is listed twice as {role}; list it once.")
    return known


def _free_parameter(
    vehicle: Vehicle, name: str, limits: tuple[float, float] | None
) -> FreeParameter:
    start = vehicle.value(name)
    unit = after_number(parameter(name).unit)
    if limits is not None:
        lower, upper = (float(limit) for limit in limits)
    else:
        lower, upper = default_bounds(name, start)
    if not (math.isfinite(lower) and math.isfinite(upper)):
        raise ProblemError(f"The bounds of {name}, {lower} to {upper}, must be finite numbers.")
    if lower >= upper:
        raise ProblemError(
            f"The bounds of {name}, {lower:g} to {upper:g}{unit}, are crossed or leave no room; "
            "give the lower one first, or fix the parameter."
        )
    if not lower <= start <= upper:
        raise ProblemError(
            f"{name} starts at {start:g}{unit}, outside its bounds {lower:g} to {upper:g}{unit}; "
            "move the start or the bounds."
        )
    if name.endswith("pivot.distance") and lower < 0.0 < upper:
        raise ProblemError(
            f"The bounds of {name}, {lower:g} to {upper:g}{unit}, span zero, where the pivot "
            "would be at the wheel; keep both on the side of the start value."
        )
    try:
        for limit in (lower, upper):
            vehicle.with_values({name: limit})
    except VehicleError as error:
        raise ProblemError(f"A bound of {name} cannot be used: {error}") from error
    return FreeParameter(name, start, lower, upper)


def _compared_runs(
    vehicle: Vehicle,
    runs: Sequence[Run],
    noise: Mapping[str, float],
    outputs: Sequence[str] | Mapping[str, Sequence[str]] | None,
    settings: RimsSettings,
    sensors: SensorModel,
) -> tuple[ComparedRun, ...]:
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
        if not 0.0 < deviation < math.inf:
            raise ProblemError(f"The noise of {channel} is {deviation}; it must be positive.")
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
    found = []
    for name, run in zip(names, runs, strict=True):
        chosen = outputs.get(name) if isinstance(outputs, Mapping) else outputs
        measured = filtered_outputs(where_driven(run, readings), settings.output_band)
        if not measured:
            raise ProblemError(
                f"Run {name} has none of {', '.join(OUTPUT_CHANNELS)}; at least one is needed."
            )
        compared = {
            channel: measured[channel] for channel in _chosen_channels(name, measured, chosen)
        }
        for channel, values in compared.items():
            if not np.all(np.isfinite(values)):
                raise ProblemError(
                    f"Run {name} has gaps (not a number) in {channel}; leave the channel out."
                )
        stated = {**run.noise, **noise, **sensors.noise()}
        found.append(
            ComparedRun(
                name,
                prepare(corrected(run, readings), vehicle, settings),
                compared,
                {channel: float((defaults | stated)[channel]) for channel in compared},
                {channel: "stated" if channel in stated else "default" for channel in compared},
            )
        )
    return tuple(found)


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
