"""One interactive simulation: what the request means, what it may cost, what comes back.

Imported with the first simulation, because it brings numba and scipy.
"""

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

from ..engine.channels import channel
from ..engine.identification.bands import Bands, bands
from ..engine.identification.kept_fit import fit_from_json
from ..engine.remembered import Remembered
from ..engine.run import Run
from ..engine.simulation.excitation import Excitation
from ..engine.simulation.metrics import Metric, metrics
from ..engine.vehicle import Vehicle
from ..engine.vehicle_file import vehicle_from_json
from .errors import OverBudget
from .excitation import excitation_of, extent, mode_of, recording_in, recording_of
from .identification_job import done
from .job_store import Job
from .limits import Limits
from .recordings import Recordings
from .schemas import SimulationRequest
from .store import Store

USUAL_STEP = 0.0025
"""What a simulated second is charged by, s."""


@dataclass(frozen=True)
class Task:
    """A checked simulation, ready to run in the pool."""

    vehicle: Vehicle
    run: Callable[[], Any]
    bands: Callable[[], Bands] | None
    seconds: float
    """Simulated ones of all cars, at the usual step."""


@dataclass(frozen=True)
class Reply:
    """What a simulation found: the run, and the head that goes before it."""

    run: Run
    head: dict[str, Any]
    bands: Bands | None


def plan(
    request: SimulationRequest,
    session: str,
    fitted: Job | None,
    store: Store,
    recordings: Recordings,
    limits: Limits,
) -> Task:
    """The simulation asked for, checked against the work budget; reads what it needs.

    fitted : the identification whose errors make the bands, if any are asked for
    """
    mode_of(request)
    for name in request.channels or ():
        channel(name)
    vehicle = _vehicle(request, session, store)
    kept = recording_of(request, session, store)
    duration, steps = extent(request, kept, [vehicle])
    _check_budget(duration, steps, limits)

    def driven() -> Excitation:
        recording = None if kept is None else recording_in(request, kept, recordings)
        return excitation_of(request, recording)

    def run() -> Any:
        return driven().simulate(vehicle, request.model)

    seconds = max(duration, steps * USUAL_STEP)
    if request.bands is None or fitted is None:
        return Task(vehicle, run, None, seconds)
    asked, fit = request.bands, fit_from_json(done(fitted))
    cars = asked.cars if asked.method == "sampled" else 2 * len(fit.free)
    if steps * (cars + 1) > limits.banded_steps:
        raise OverBudget(
            f"Bands by {cars} cars take {math.ceil(steps * (cars + 1))} steps, at most "
            f"{limits.banded_steps} are taken; shorten it, or draw fewer cars."
        )
    how: dict[str, Any] = {"cars": asked.cars, "seed": asked.seed, "model": request.model}
    return Task(
        vehicle,
        run,
        lambda: bands(fit, vehicle, driven(), method=asked.method, **how),
        seconds * (cars + 1),
    )


def reply(request: SimulationRequest, task: Task) -> Reply:
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
    return Reply(found.run, head, within)


_METRIC = tuple(field.name for field in fields(Metric))


def _metric(metric: Metric, within: Bands | None) -> dict[str, Any]:
    """A figure, with its interval where there are bands; null for an end that is open."""
    told = {name: getattr(metric, name) for name in _METRIC}
    interval = within.figures.get(metric.name) if within else None
    return told if interval is None else {**told, "interval": list(interval)}


_VEHICLES: Remembered[str, Vehicle] = Remembered(256)
"""Checked vehicles by their JSON."""


def _vehicle(request: SimulationRequest, session: str, store: Store) -> Vehicle:
    data: Mapping[str, Any] = (
        store.sessions.get(session).vehicle if request.vehicle is None else request.vehicle
    )
    # A slider sends the same car again and again with other values.
    vehicle = _VEHICLES.made(json.dumps(data), lambda: vehicle_from_json(data), lambda _: 1)
    return vehicle.with_values(request.values) if request.values else vehicle


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
