"""Validation as a background job: what goes to the worker, what the worker does, what comes back.

The worker gets everything by value and gives the whole document back as a file, so it needs neither
the database nor the data directory and may be another machine.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from ...engine.vehicle_file import vehicle_from_json
from ..errors import InvalidRequest
from ..jobs.kinds import Kind
from ..jobs.worker import Attempt, WithFile
from ..limits import Limits
from ..recordings.measurement_view import data_keys
from ..recordings.recordings import Recordings, as_stated
from ..schemas import ValidationRequest
from ..simulators.simulator import Host
from ..storage.job_row import Job
from ..storage.measurement import Measurement, stated
from ..storage.store import Store
from .identification import check_budget, done, marked_runs

KIND = "validation"

BYTES_A_RUN = 5_200_000
"""What a run takes in the document, at most: 4001 instants of 52 histories."""


def validation(store: Store, recordings: Recordings) -> Kind:
    """The job kind, bound to where its recordings are kept."""

    def payload(job: Job) -> dict[str, Any]:
        kept = [as_stated(store, job.session, run) for run in job.spec["runs"]]
        return {**job.spec, "recordings": marked_runs(job.spec, kept, recordings)}

    return Kind(task=validate_runs, payload=payload)


def check_and_fill(
    host: Host,
    request: ValidationRequest,
    fitted: Job,
    of_fit: Sequence[Measurement],
    held: Sequence[Measurement],
    of_session: Sequence[Measurement],
    limits: Limits,
) -> dict[str, Any]:
    """In a simulator: everything that the job needs, checked.

    of_fit, held, of_session : the recordings that were fitted, that are held out, and all
    """
    from ...engine.validation.cases import check_cases
    from ...engine.validation.geometry import geometry_from_json

    fit = done(fitted)
    runs = [{**one, "role": "fit"} for one in fitted.spec["runs"]]
    runs += [{**stated(one), "role": "hold-out"} for one in held]
    for field in ("manoeuvres", "braking"):
        if strangers := set(getattr(request, field)) - {one["id"] for one in runs}:
            raise InvalidRequest(
                f"{field} names {min(strangers)}, which is neither fitted nor held out; leave it"
                " out or add the run.",
                field=field,
            )
    kept = [*of_fit, *held]
    spec = {
        "identification": fitted.id,
        "fit": fit,
        "runs": runs,
        "braking": {**fitted.spec["braking"], **request.model_dump(mode="json")["braking"]},
        "manoeuvres": _driven(request, kept),
        "geometry": request.geometry,
    }
    if request.geometry is not None:
        geometry_from_json(request.geometry)
    check_budget(kept, fit["settings"]["step"], limits)
    check_cases(_cases(spec, marked_runs(spec, kept, host.recordings)))
    data = data_keys(of_session)
    seen = {data[one.id] for one in kept}
    left_out = [
        one.name
        for one in of_session
        if data[one.id] not in seen and one.summary["usable_for_identification"]
    ]
    recorded = [{"name": one.name, "sha256": one.sha256} for one in kept]
    return {**spec, "recorded": recorded, "left_out": left_out}


def _driven(request: ValidationRequest, kept: Sequence[Measurement]) -> dict[str, Any]:
    """Manoeuvres by measurement: those kept with them, unless the request tells others or none."""
    from ...engine.manoeuvre import manoeuvre_from_json, manoeuvre_to_json
    from .excitation import known_manoeuvre

    driven = {one.id: one.manoeuvre for one in kept}
    for one, asked in request.manoeuvres.items():
        if asked is None:
            driven[one] = None
        else:
            known = isinstance(asked, str)
            found = known_manoeuvre(asked) if known else manoeuvre_from_json(asked)
            driven[one] = manoeuvre_to_json(found)
    return {one: manoeuvre for one, manoeuvre in driven.items() if manoeuvre is not None}


def _cases(spec: Mapping[str, Any], runs: list[Any]) -> list[Any]:
    """The engine's cases."""
    from ...engine.manoeuvre import manoeuvre_from_json
    from ...engine.validation.cases import Case

    driven = {one: manoeuvre_from_json(data) for one, data in spec["manoeuvres"].items()}
    return [
        Case(run, one["role"], driven.get(one["id"]))
        for one, run in zip(spec["runs"], runs, strict=True)
    ]


def validate_runs(payload: Any, attempt: Attempt) -> WithFile:
    """On the worker: predict every run, reporting how far it is; the document as a file."""
    from ...engine.identification.kept_fit import fit_from_json
    from ...engine.simulation.rims_settings import RimsSettings
    from ...engine.validation.cases import as_it_moved
    from ...engine.validation.geometry import geometry_from_json
    from ...engine.validation.validate import validate
    from ...engine.validation.validation_file import validation_to_json
    from .report import made

    fit, geometry = payload["fit"], payload["geometry"]
    fitted = [run["name"] for run in fit["runs"]]
    moved = [
        as_it_moved(run, fit, fitted[place] if one["role"] == "fit" else None)
        for place, (one, run) in enumerate(zip(payload["runs"], payload["recordings"], strict=True))
    ]
    found = validate(
        vehicle_from_json(fit["vehicle"]),
        _cases(payload, moved),
        traction=fit["traction"],
        settings=RimsSettings(**fit["settings"]),
        fit=fit_from_json(fit),
        progress=lambda done, of: attempt.report({"predictions": done, "of": of}),
        cancelled=attempt.cancelled,
    )
    document = validation_to_json(
        found,
        fit,
        None if geometry is None else geometry_from_json(geometry),
        made(payload["recorded"], payload.get("left_out", ())),
    )
    summary = [
        {
            **{name: run[name] for name in ("name", "role", "findings", "squat")},
            "predictions": [
                {name: value for name, value in one.items() if name != "values"}
                for one in run["predictions"]
            ],
        }
        for run in document["runs"]
    ]
    return WithFile({"runs": summary}, json.dumps(document, allow_nan=False).encode())
