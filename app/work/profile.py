"""The profile of one parameter of a fit as a background job: what it needs, and what it does."""

from typing import Any

from ...engine.errors import ProblemError
from ...engine.parameters import parameter
from ..errors import Conflict
from ..jobs.worker import Attempt
from ..schemas import ProfileRequest
from ..storage.job_row import Job
from ..storage.store import Store
from .identification import build_problem, fitted_recordings

KIND = "profile"


def check_and_fill(request: ProfileRequest, fitted: Job, store: Store) -> dict[str, Any]:
    """Everything that the job needs, checked: what the fit was asked, from where it ended."""
    if fitted.result is None:
        raise Conflict(
            f"The identification has no fit, its state is {fitted.state}; wait, or fit again."
        )
    ended = {one["name"]: one["value"] for one in fitted.result["parameters"]}
    fitted_recordings(fitted, store)
    name = parameter(request.parameter).name
    if name not in ended:
        raise ProblemError(f"{name} was not free in this fit; free are {', '.join(ended)}.")
    return {
        **{key: value for key, value in fitted.spec.items() if key not in ("asked", "starts")},
        "identification": fitted.id,
        "parameter": name,
        "start": {**fitted.spec["start"], **ended},
        "ended": {key: fitted.result.get(key, []) for key in ("parameters", "sensors", "runs")},
    }


def profile_parameter(payload: Any, attempt: Attempt) -> dict[str, Any]:
    """On the worker: the profile as JSON, reporting after every point."""
    from ...engine.identification.fit_file import profile_to_json
    from ...engine.identification.profile import profile

    found = profile(
        build_problem(payload, payload["runs"]).as_fitted(payload["ended"]),
        payload["parameter"],
        progress=lambda points: attempt.report({"points": points}),
        cancelled=attempt.cancelled,
    )
    return profile_to_json(found)
