"""Advice on what to drive next: what the request means, what it may cost, what comes back.

This happens in a simulator, and brings numba and scipy.
"""

from collections.abc import Mapping
from typing import Any

from ...engine.channels import INPUT_CHANNELS, OUTPUT_CHANNELS
from ...engine.identification.advice_file import advisory_to_json
from ...engine.identification.advisor import advise, advise_unmeasured, require_sound
from ...engine.identification.candidates import catalogue
from ...engine.manoeuvre import Manoeuvre, manoeuvre_from_json
from ...engine.vehicle_file import vehicle_from_json
from ..errors import InvalidRequest, OverBudget
from ..limits import Limits
from ..schemas import AdviceRequest
from ..simulators.simulator import Host
from ..storage.job_row import Job
from ..storage.measurement import Measurement
from .excitation import known_manoeuvre
from .identification import UNTOLD, build_problem, done, marked_runs


def advised(
    host: Host,
    request: AdviceRequest,
    vehicle: Mapping[str, Any],
    fitted: Job | None,
    kept: list[Measurement],
    limits: Limits,
) -> dict[str, Any]:
    """The advice as JSON.

    vehicle : the request's or the session's
    fitted : the identification whose runs are known, if the request names one;  kept : these runs
    """
    candidates = _candidates(request)
    total = sum(one.duration for one in candidates.values())
    if total > limits.advised_seconds:
        raise OverBudget(
            f"The candidates last {total:.0f} s together, advice looks at no more than "
            f"{limits.advised_seconds:g} s; name fewer or shorter ones."
        )
    if fitted is None:
        found = advise_unmeasured(
            vehicle_from_json(vehicle),
            candidates,
            planned=request.planned,
            noise=_checked(request.noise),
        )
        return advisory_to_json(found)
    if request.vehicle is not None or request.noise:
        told = "vehicle" if request.vehicle is not None else "noise"
        raise InvalidRequest(
            f"The field {told} means nothing with identification, which has its own; leave it out.",
            field=told,
        )
    fit = done(fitted)
    require_sound(fit)
    spec = {**UNTOLD, **fitted.spec, "vehicle": fit["vehicle"], "start": {}}
    problem = build_problem(spec, marked_runs(spec, kept, host.recordings)).as_fitted(fit)
    return advisory_to_json(advise(problem, candidates, planned=request.planned))


def _candidates(request: AdviceRequest) -> dict[str, Manoeuvre]:
    """Manoeuvres by key: those that are named or given, or the usual ones, and the planned."""
    usual, asked = catalogue(), request.candidates
    if asked is None:
        asked = list(usual)
    given: Mapping[str, Any] = asked if isinstance(asked, Mapping) else {key: key for key in asked}
    given = {**given, **{key: key for key in request.planned if key not in given}}
    return {key: _manoeuvre(one, usual) for key, one in given.items()}


def _manoeuvre(asked: Any, usual: Mapping[str, Manoeuvre]) -> Manoeuvre:
    if not isinstance(asked, str):
        return manoeuvre_from_json(asked)
    return usual[asked] if asked in usual else known_manoeuvre(asked)


def _checked(noise: Mapping[str, float]) -> Mapping[str, float]:
    """Standard deviations of channels that have a part in it."""
    known = (*OUTPUT_CHANNELS, *INPUT_CHANNELS)
    if strangers := [name for name in noise if name not in known]:
        raise InvalidRequest(
            f"A noise is stated for {strangers[0]}; it counts for {', '.join(known)}.",
            field="noise",
        )
    return noise
