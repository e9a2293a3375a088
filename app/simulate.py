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
from ..engine.simulation import (
    FREE_STEP,
    SAMPLE_STEP,
    Model,
    simulate_posts,
    simulate_rims,
    simulate_road,
)
from ..engine.vehicle import Vehicle
from ..engine.vehicle_file import vehicle_from_json
from .errors import InvalidRequest, NotFound, OverBudget
from .recordings import Recordings
from .schemas import RimsRequest, SimulationRequest
from .settings import Limits
from .store import Measurement, Store

DEFAULT_MANOEUVRE = "2"

MEANS_NOTHING = {
    "manoeuvre": {},
    "rims": {
        "road": "the recording has its road in it; leave it out",
        "lift_off": "tyres play no part; leave it out",
        "step": "give it as rims.settings.step",
        "sample_step": "the result has the recording's own times; leave it out",
    },
    "posts": {"road": "a rig has none; leave it out"},
}
"""By mode, what of a request would change nothing, and the remedy."""


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
    _refuse_what_means_nothing(request, asked[0] if asked else "manoeuvre")
    for name in request.channels or ():
        channel(name)
    vehicle = _vehicle(request, session, store)
    if request.rims is not None:
        kept = store.measurement(session, request.rims.measurement)
        return _follow(request.rims, request.model, vehicle, kept, recordings, limits)
    if request.posts is not None:
        kept = store.measurement(session, request.posts.measurement)
        return _shake(request, vehicle, kept, recordings, limits)
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
                "A rig test has no road; leave out road or choose another manoeuvre.", field="road"
            )
        manoeuvre = replace(manoeuvre, road=road_spec_from_json(request.road))
    how = _how(request, manoeuvre.duration, limits)
    simulate = simulate_road if manoeuvre.kind == "road" else simulate_posts
    return Task(vehicle, lambda: simulate(vehicle, manoeuvre, **how))


def _follow(
    rims: RimsRequest,
    model: Model,
    vehicle: Vehicle,
    kept: Measurement,
    recordings: Recordings,
    limits: Limits,
) -> Task:
    """A measurement's wheel centres."""
    settings = rims.settings.settings()
    duration = kept.summary["duration"]
    _check_budget(duration, max(kept.summary["samples"], duration / settings.step), limits)
    return Task(
        vehicle,
        lambda: simulate_rims(
            vehicle,
            recordings.motion(kept, settings, rims.braking),
            traction=rims.traction,
            model=model,
        ),
    )


def _shake(
    request: SimulationRequest,
    vehicle: Vehicle,
    kept: Measurement,
    recordings: Recordings,
    limits: Limits,
) -> Task:
    """A measurement's posts."""
    how = _how(request, kept.summary["duration"], limits)
    return Task(vehicle, lambda: simulate_posts(vehicle, recordings.run(kept), **how))


def _how(request: SimulationRequest, duration: float, limits: Limits) -> dict[str, Any]:
    """What road and posts modes have in common, checked against the work budget."""
    step = FREE_STEP if request.step is None else request.step
    sample_step = SAMPLE_STEP if request.sample_step is None else request.sample_step
    _check_budget(duration, duration / min(step, sample_step), limits)
    return {
        "model": request.model,
        "lift_off": request.lift_off,
        "step": step,
        "sample_step": sample_step,
    }


def _refuse_what_means_nothing(request: SimulationRequest, mode: str) -> None:
    for name, remedy in MEANS_NOTHING[mode].items():
        if getattr(request, name) not in (None, False):
            raise InvalidRequest(
                f"The field {name} means nothing with {mode}: {remedy}.", field=name
            )


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
