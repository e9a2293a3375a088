"""One interactive simulation: what the request means, what it may cost, what comes back.

This happens in a simulator, and brings numba and scipy.
"""

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from ...engine.channels import channel
from ...engine.remembered import Remembered
from ...engine.run import Run
from ...engine.simulation.excitation import Excitation
from ...engine.simulation.metrics import Metric, metrics
from ...engine.vehicle import Vehicle
from ...engine.vehicle_file import vehicle_from_json
from .. import frames
from ..errors import InvalidRequest, OverBudget
from ..limits import Limits
from ..recordings.lent import LentRecordings
from ..schemas import SimulationRequest
from ..simulators.simulator import Host
from ..storage.measurement import Measurement
from .excitation import excitation_of, extent, recording_in

if TYPE_CHECKING:
    from ...engine.identification.bands import Bands

USUAL_STEP = 0.0025
"""What a simulated second is charged by, s."""


CHARGE = "charge"
"""What it asks its host: to take so many simulated seconds from the session's budget."""


@dataclass(frozen=True)
class Task:
    """A checked simulation."""

    vehicle: Vehicle
    run: Callable[[], Any]
    bands: "Callable[[], Bands] | None"
    seconds: float
    """Simulated ones of all cars, at the usual step."""


@dataclass(frozen=True)
class Found:
    """What a simulation found: the run, and the head that goes before it."""

    run: Run
    head: dict[str, Any]
    bands: "Bands | None"


def simulated(
    host: Host,
    request: SimulationRequest,
    form: frames.Form,
    vehicle: Mapping[str, Any],
    kept: Measurement | None,
    fit: Mapping[str, Any] | None,
    limits: Limits,
) -> tuple[bytes | Run, Vehicle | None]:
    """In a simulator: the histories in the form that was asked for, of CSV the run to be written;
    and the car for the session's scene, where the request shows it there.

    vehicle : the request's or the session's;  kept : the recording that moves it, if one does
    fit : whose errors make the bands, if any are asked for
    """
    task = plan(request, vehicle, kept, fit, host.recordings, limits)
    if fit is not None and form == "csv":
        raise InvalidRequest("Bands come as JSON or frames; ask for one of them.", field="bands")
    host.ask(CHARGE, task.seconds)
    found = run(request, task)
    shown = task.vehicle if request.scene else None
    if form == "csv":
        return found.run, shown
    taken, *ends = (
        frames.take(one, request.channels, request.max_samples, request.decimate)
        for one in (found.run, *((found.bands.lower, found.bands.upper) if found.bands else ()))
    )
    return frames.written(found.head, taken.within(*ends) if ends else taken, form), shown


def plan(
    request: SimulationRequest,
    data: Mapping[str, Any],
    kept: Measurement | None,
    fit: Mapping[str, Any] | None,
    recordings: LentRecordings,
    limits: Limits,
) -> Task:
    """The simulation asked for, checked against the work budget; arguments as of `simulated`."""
    for name in request.channels or ():
        channel(name)
    vehicle = _vehicle(data, request.values)
    duration, steps = extent(request, kept, [vehicle])
    _check_budget(duration, steps, limits)

    def driven() -> Excitation:
        recording = None if kept is None else recording_in(request, kept, recordings)
        return excitation_of(request, recording)

    def drive() -> Any:
        return driven().simulate(vehicle, request.model)

    seconds = max(duration, steps * USUAL_STEP)
    if request.bands is None or fit is None:
        return Task(vehicle, drive, None, seconds)
    # Not loaded with the rest: sliders move long before a fit is there.
    from ...engine.identification.bands import bands
    from ...engine.identification.kept_fit import fit_from_json

    asked, known = request.bands, fit_from_json(fit)
    cars = asked.cars if asked.method == "sampled" else 2 * len(known.free)
    if steps * (cars + 1) > limits.banded_steps:
        raise OverBudget(
            f"Bands by {cars} cars take {math.ceil(steps * (cars + 1))} steps, at most "
            f"{limits.banded_steps} are taken; shorten it, or draw fewer cars."
        )
    how: dict[str, Any] = {"cars": asked.cars, "seed": asked.seed, "model": request.model}
    return Task(
        vehicle,
        drive,
        lambda: bands(known, vehicle, driven(), method=asked.method, **how),
        seconds * (cars + 1),
    )


def run(request: SimulationRequest, task: Task) -> Found:
    """Run the simulation and sum it up."""
    began = time.perf_counter()
    found = task.run()
    within = None if task.bands is None else task.bands()
    head = {
        "seq": request.seq,
        "mode": found.mode,
        "duration": found.run.duration,
        "steps": found.steps,
        "fit_percent": dict(found.fit_percent),
        "negative_load_share": dict(found.negative_load_share),
        "metrics": [_metric(metric, within) for metric in metrics(found.run)],
        "warnings": [*found.warnings, *(within.warnings if within else ())],
        "seconds": time.perf_counter() - began,
    }
    return Found(found.run, head, within)


_METRIC = tuple(field.name for field in fields(Metric))


def _metric(metric: Metric, within: "Bands | None") -> dict[str, Any]:
    """A figure, with its interval where there are bands; null for an end that is open."""
    told = {name: getattr(metric, name) for name in _METRIC}
    interval = within.figures.get(metric.name) if within else None
    return told if interval is None else {**told, "interval": list(interval)}


_VEHICLES: Remembered[str, Vehicle] = Remembered(1_000_000)
"""Checked vehicles by their JSON, up to so many characters of it."""


def _vehicle(data: Mapping[str, Any], values: Mapping[str, float]) -> Vehicle:
    # A slider sends the same car again and again with other values.
    known = json.dumps(data)
    vehicle = _VEHICLES.made(known, lambda: vehicle_from_json(data), lambda _: len(known))
    return vehicle.with_values(values) if values else vehicle


def _check_budget(duration: float, steps: float, limits: Limits) -> None:
    if duration > limits.simulated_seconds:
        raise OverBudget(
            f"{duration:.0f} s are asked for, an interactive simulation takes at most "
            f"{limits.simulated_seconds:g} s; shorten it."
        )
    if steps > limits.simulated_steps:
        raise OverBudget(
            f"{math.ceil(steps)} steps are asked for, an interactive simulation takes at most "
            f"{limits.simulated_steps}; shorten it or take a longer step."
        )
