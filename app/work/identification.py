"""Identification as a background job: what goes to the worker, and what the worker does.

The worker gets everything by value (vehicle, recordings, options), so it needs neither the
database nor the data directory and may be another machine.
"""

import json
from collections.abc import Iterable, Mapping
from typing import Any

from ...engine.parameters import ALL_NAMES, PARAMETER_NAMES, parameter
from ...engine.run import Run
from ..errors import Conflict, OverBudget
from ..jobs.kinds import Kind, digest
from ..jobs.worker import Attempt, Task
from ..limits import Limits
from ..recordings.recordings import Recordings, as_stated
from ..recordings.runs import Runs, with_braking
from ..schemas import IdentificationRequest
from ..simulators.simulator import Host
from ..storage.job_row import Job
from ..storage.measurement import Measurement
from ..storage.store import Store

KIND = "identification"

SEARCH = "search-"
"""What the names of kept searches begin with."""

UNTOLD = {
    name: IdentificationRequest.model_fields[name].get_default()
    for name in ("starts", "seed", "loss", "loss_scale", "priors", "sensors", "fit_noise")
}
"""What holds of a job kept from before these could be told."""


def of_recordings(task: Task, store: Store, recordings: Recordings) -> Kind:
    """A job kind whose specs are an identification's, bound to where its recordings are kept."""

    def payload(job: Job) -> dict[str, Any]:
        kept = [as_stated(store, job.session, run) for run in job.spec["runs"]]
        return {**UNTOLD, **job.spec, "runs": marked_runs(job.spec, kept, recordings)}

    return Kind(task=task, payload=payload)


def as_asked(request: IdentificationRequest) -> str:
    """What stands for a request: the same whenever it is sent, however it calls the parameters."""
    form = request.model_dump(mode="json", exclude={"key"})
    # Left out where nothing is told, as by requests from before they could be.
    for later in ("sensors", "fit_noise"):
        if not form[later]:
            del form[later]
    for role in ("free", "fixed"):
        if form[role] is not None:
            form[role] = sorted(parameter(name).name for name in form[role])
    for given in ("bounds", "start", "priors"):
        form[given] = sorted([parameter(name).name, value] for name, value in form[given].items())
    return digest(form)


def filled_in(
    host: Host, spec: Mapping[str, Any], kept: list[Measurement], limits: Limits
) -> dict[str, Any]:
    """In a simulator: the spec, checked, with what holds where nothing is told, so that it means
    the same for ever.
    """
    step, starts, fit_noise = spec["settings"]["step"], spec["starts"], spec["fit_noise"]
    check_budget(kept, step, limits, starts=starts, fit_noise=fit_noise)
    problem = build_problem(spec, marked_runs(spec, kept, host.recordings))
    free = [one.name for one in problem.free]
    started = {*free, *(parameter(name).name for name in spec["start"])}
    return {
        **spec,
        "free": free,
        "fixed": [name for name in PARAMETER_NAMES if name not in free],
        "bounds": {one.name: [one.lower, one.upper] for one in problem.free},
        "start": {name: problem.vehicle.value(name) for name in ALL_NAMES if name in started},
        "priors": {one.name: [one.mean, one.deviation] for one in problem.priors},
    }


def fitted_recordings(fitted: Job, store: Store) -> list[Measurement]:
    """The recordings of a fit as it saw them; Deleted where one is no more."""
    role = "to which this car was fitted"
    return [as_stated(store, fitted.session, run, role, "fit anew") for run in fitted.spec["runs"]]


def marked_runs(
    spec: Mapping[str, Any], kept: Iterable[Measurement], recordings: Runs
) -> list[Run]:
    """The recordings, with their braking where the request marks it."""
    return [with_braking(recordings.run(one), spec["braking"].get(one.id)) for one in kept]


def build_problem(spec: Mapping[str, Any], runs: list[Run]) -> Any:
    """The engine's problem; raises what a person can mend."""
    from ...engine.identification.loss import Loss
    from ...engine.identification.problem import Problem
    from ...engine.identification.residuals import check_start
    from ...engine.simulation.rims_settings import RimsSettings
    from ...engine.vehicle_file import vehicle_from_json

    problem = Problem.build(
        vehicle_from_json(spec["vehicle"]),
        runs,
        free=spec["free"],
        fixed=spec["fixed"],
        bounds={name: (lower, upper) for name, (lower, upper) in spec["bounds"].items()},
        start=spec["start"],
        noise=spec["noise"],
        traction=spec["traction"],
        settings=RimsSettings(**spec["settings"]),
        loss=Loss(spec["loss"], spec["loss_scale"]),
        priors={name: (mean, deviation) for name, (mean, deviation) in spec["priors"].items()},
        sensors=spec["sensors"],
        fit_noise=spec["fit_noise"],
    )
    check_start(problem)
    return problem


def identify_runs(payload: Any, attempt: Attempt) -> dict[str, Any]:
    """On the worker: fit, reporting after every evaluation; the fit as JSON. Of many starts each
    search that ends is kept.
    """
    from ...engine.identification.ended_search import EndedSearch
    from ...engine.identification.fit import Stage
    from ...engine.identification.fit_file import fit_to_json
    from ...engine.identification.identify import identify
    from .time_left import SearchClock

    problem = build_problem(payload, payload["runs"])
    costs: list[float] = []
    clock = SearchClock(noise_follows=problem.sensors.finds_noise)

    def progress(now: Any) -> None:
        if now.stage != Stage.SCREENING:
            costs.append(now.cost)
        attempt.report(
            {
                "cost": now.cost,
                "cost_history": list(costs),
                "simulations": now.simulations,
                "evaluations": now.evaluations,
                "parameters": dict(now.parameters),
                "fit_percent": {run: dict(of) for run, of in now.fit_percent.items()},
                "stage": now.stage.value,
                "search": now.search,
                "searches": now.searches,
                "seconds_left": clock.left(now),
            }
        )

    def keep(number: int, search: EndedSearch) -> None:
        if payload["starts"] > 1:
            attempt.keep(f"{SEARCH}{number}", json.dumps(search.to_json()).encode())

    ended = {
        int(name.removeprefix(SEARCH)): EndedSearch.from_json(json.loads(data))
        for name, data in attempt.kept.items()
    }
    fit = identify(
        problem,
        progress=progress,
        cancelled=attempt.cancelled,
        starts=payload["starts"],
        seed=payload["seed"],
        ended=ended,
        keep=keep,
    )
    return fit_to_json(fit)


def done(fitted: Job) -> Any:
    """The fit of an identification as JSON; Conflict where it has none."""
    if fitted.result is None:
        raise Conflict(
            f"The identification has no fit, its state is {fitted.state}; wait, or fit again."
        )
    return fitted.result


def check_budget(
    measurements: list[Measurement],
    step: float,
    limits: Limits,
    *,
    starts: int = 1,
    fit_noise: bool = False,
) -> None:
    """Refuse recordings that together take longer than an identification may.

    step : of the integration, s
    """
    from ...engine.identification.multistart import fits_of
    from ...engine.identification.noise_rounds import NOISE_ROUNDS

    total = sum(
        max(kept.summary["samples"], kept.summary["duration"] / step) for kept in measurements
    )
    fits = fits_of(starts) + (NOISE_ROUNDS if fit_noise else 0)
    if total * fits > limits.identified_samples:
        work = f"{total:.0f} samples or steps together"
        if fits > 1.0:
            work += f", and as much work as {fits:.0f} fits is asked of them"
        fewer = "".join(
            f" {remedy},"
            for remedy, asked in (("fewer starts", starts > 1), ("noise that is stated", fit_noise))
            if asked
        )
        raise OverBudget(
            f"The runs have {work}, an identification takes at most "
            f"{limits.identified_samples} in all; choose{fewer} fewer or shorter runs, or a longer "
            "step."
        )
