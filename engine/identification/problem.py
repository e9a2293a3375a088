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

from ..channels import OUTPUT_CHANNELS
from ..equilibrium import static_loads
from ..errors import ProblemError, VehicleError
from ..parameters import ALL_NAMES, PARAMETER_NAMES, damper_starts, default_bounds, parameter
from ..run import Run
from ..simulation.car_rows import car_rows
from ..simulation.rims_settings import RimsSettings
from ..simulation.simulate import Traction
from ..units import after_number
from ..vehicle import Vehicle
from .compared_runs import ComparedRun, compared_runs, require_motion
from .loss import Loss
from .priors import Prior, checked_prior
from .sensing import Reading
from .sensor_model import SensorModel, SensorVariable, sensor_model
from .variables import FreeParameter, Variable

Array = NDArray[np.float64]
Given = TypeVar("Given")


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
        biased = [name for name in OUTPUT_CHANNELS if name in model.unzeroed]
        if biased and settings.initial_state == "measured":
            raise ProblemError(
                f"The bias of {biased[0]} is to be fitted, but the measured initial_state would "
                "begin with it; begin in equilibrium, or state the bias."
            )
        compared = compared_runs(vehicle, runs, noise or {}, outputs, settings, model)
        fitted = model.variables([(seen.name, seen.measured) for seen in compared])
        samples = sum(len(measured) for seen in compared for measured in seen.measured.values())
        if samples <= (unknown := len(parameters) + len(fitted)):
            raise ProblemError(
                f"{samples} samples cannot determine {unknown} parameters; free fewer "
                "or measure longer."
            )
        require_motion(runs, compared)
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
