"""One interactive simulation: what the request means, what it may cost, what comes back.

Imported with the first simulation, because it brings numba and scipy.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ..engine.channels import Run, channel
from ..engine.metrics import metrics
from ..engine.vehicle import Vehicle
from ..engine.vehicle_file import vehicle_from_json
from .errors import OverBudget
from .excitation import excitation_of, extent, mode_of, recording_in, recording_of
from .recordings import Recordings
from .schemas import SimulationRequest
from .settings import Limits
from .store import Store


@dataclass(frozen=True)
class Task:
    """A checked simulation, ready to run in the pool."""

    vehicle: Vehicle
    run: Callable[[], Any]


@dataclass(frozen=True)
class Reply:
    """What a simulation found: the run, and the head that goes before it."""

    run: Run
    head: dict[str, Any]


def plan(
    request: SimulationRequest, session: str, store: Store, recordings: Recordings, limits: Limits
) -> Task:
    """The simulation asked for, checked against the work budget; reads what it needs."""
    mode_of(request)
    for name in request.channels or ():
        channel(name)
    vehicle = _vehicle(request, session, store)
    kept = recording_of(request, session, store)
    _check_budget(*extent(request, kept, [vehicle]), limits)

    def run() -> Any:
        recording = None if kept is None else recording_in(request, kept, recordings)
        return excitation_of(request, recording).simulate(vehicle, request.model)

    return Task(vehicle, run)


def reply(request: SimulationRequest, task: Task) -> Reply:
    """Run the simulation and sum it up."""
    began = time.perf_counter()
    found = task.run()
    head = {
        "seq": request.seq,
        "mode": found.mode,
        "duration": found.run.duration,
        "steps": found.steps,
        "fit_percent": dict(found.fit_percent),
        "negative_load_share": dict(found.negative_load_share),
        "metrics": [asdict(metric) for metric in metrics(found.run)],
        "warnings": list(found.warnings),
        "seconds": time.perf_counter() - began,
    }
    return Reply(found.run, head)


def _vehicle(request: SimulationRequest, session: str, store: Store) -> Vehicle:
    data: Mapping[str, Any] = (
        store.session(session).vehicle if request.vehicle is None else request.vehicle
    )
    vehicle = vehicle_from_json(data)
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
