"""One interactive simulation: what the request means, what it may cost, what comes back.

Imported with the first simulation, because it brings numba and scipy.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from ..engine.channels import Run, channel
from ..engine.manoeuvre import Manoeuvre, manoeuvre_from_json, reference_manoeuvres
from ..engine.metrics import metrics
from ..engine.road_specs import road_spec_from_json
from ..engine.simulation import simulate_posts, simulate_rims, simulate_road
from ..engine.vehicle import Vehicle
from ..engine.vehicle_file import vehicle_from_json
from .errors import InvalidRequest, NotFound, OverBudget
from .recordings import Recordings, with_braking
from .schemas import SimulationRequest
from .settings import Limits
from .store import Measurement, Store

DEFAULT_MANOEUVRE = "2"


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


def known_manoeuvre(key: str) -> Manoeuvre:
    """One of the manoeuvres that come with the package."""
    try:
        return reference_manoeuvres()[key]
    except KeyError:
        known = ", ".join(reference_manoeuvres())
        raise NotFound(f"There is no manoeuvre by that key; there are {known}.") from None


def plan(
    request: SimulationRequest, session: str, store: Store, recordings: Recordings, limits: Limits
) -> Task:
    """The simulation asked for, checked against the work budget; reads what it needs."""
    asked = [name for name in ("manoeuvre", "rims", "posts") if getattr(request, name) is not None]
    if len(asked) > 1:
        raise InvalidRequest(f"The request has {' and '.join(asked)}; leave one of them.")
    for name in request.channels or ():
        channel(name)
    vehicle = _vehicle(request, session, store)
    if request.rims is not None or request.posts is not None:
        return _follow(request, vehicle, session, store, recordings, limits)
    return _drive(request, vehicle, limits)


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


def _drive(request: SimulationRequest, vehicle: Vehicle, limits: Limits) -> Task:
    """A manoeuvre, on its own road or the request's."""
    asked = DEFAULT_MANOEUVRE if request.manoeuvre is None else request.manoeuvre
    manoeuvre = known_manoeuvre(asked) if isinstance(asked, str) else manoeuvre_from_json(asked)
    if request.road is not None:
        if manoeuvre.kind != "road":
            raise InvalidRequest(
                "A rig test has no road; leave out road or choose another manoeuvre."
            )
        manoeuvre = replace(manoeuvre, road=road_spec_from_json(request.road))
    _check_budget(manoeuvre.duration, min(request.step, request.sample_step), limits)
    simulate = simulate_road if manoeuvre.kind == "road" else simulate_posts
    return Task(
        vehicle,
        lambda: simulate(
            vehicle,
            manoeuvre,
            model=request.model,
            lift_off=request.lift_off,
            step=request.step,
            sample_step=request.sample_step,
        ),
    )


def _follow(
    request: SimulationRequest,
    vehicle: Vehicle,
    session: str,
    store: Store,
    recordings: Recordings,
    limits: Limits,
) -> Task:
    """A measurement: its wheel centres or its posts."""
    if request.road is not None:
        raise InvalidRequest("A recording has its road in it; leave out road.")
    if rims := request.rims:
        kept = store.measurement(session, rims.measurement)
        _check_recording(kept, limits)
        return Task(
            vehicle,
            lambda: simulate_rims(
                vehicle,
                with_braking(recordings.run(kept), rims.braking),
                traction=rims.traction,
                settings=rims.settings.settings(),
                model=request.model,
            ),
        )
    assert request.posts is not None
    kept = store.measurement(session, request.posts.measurement)
    _check_recording(kept, limits)
    return Task(
        vehicle,
        lambda: simulate_posts(
            vehicle,
            recordings.run(kept),
            model=request.model,
            lift_off=request.lift_off,
            step=request.step,
            sample_step=request.sample_step,
        ),
    )


def _check_recording(kept: Measurement, limits: Limits) -> None:
    finest = kept.summary["duration"] / max(kept.summary["samples"], 1)
    _check_budget(kept.summary["duration"], min(finest, 0.002), limits)


def _check_budget(duration: float, step: float, limits: Limits) -> None:
    if duration > limits.simulated_seconds:
        raise OverBudget(
            f"{duration:.0f} s are asked for, an interactive simulation takes at most "
            f"{limits.simulated_seconds:g} s; shorten it."
        )
    if (steps := math.ceil(duration / step)) > limits.simulated_steps:
        raise OverBudget(
            f"{steps} steps are asked for, an interactive simulation takes at most "
            f"{limits.simulated_steps}; shorten it or take a longer step."
        )
