"""Validations: background jobs like identifications, whose document and report come as files."""

import json
from typing import Any

from fastapi.responses import FileResponse, HTMLResponse

from ..access.sessions import SessionId
from ..errors import Conflict
from ..jobs.kinds import as_asked
from ..schemas import ValidationRequest
from ..web.services import Services, Shared
from ..work.identification import KIND as IDENTIFICATION
from ..work.identification import done, fitted_recordings
from ..work.report import SERVED_POLICY, report
from ..work.validation import BYTES_A_RUN, KIND, check_and_fill
from .jobs import View, job_router, submitted

ASKED = ("identification", "runs", "manoeuvres", "braking", "geometry")
"""What a job shows of its request; `runs` are those fitted and held out, with their `role`."""

VIEW = View(
    KIND,
    asked=lambda job: {name: job.spec[name] for name in ASKED},
    result=lambda job: {"result": job.result},
)

router = job_router("validations", VIEW)


@router.post("", status_code=202)
async def submit(sid: SessionId, services: Shared, body: ValidationRequest) -> dict[str, Any]:
    """Queue a validation of an identification; the same `key` again gives the same job."""
    return await submitted(
        services, sid, VIEW, body.key, lambda: as_asked(body), lambda: _spec(services, sid, body)
    )


def _spec(services: Services, sid: str, body: ValidationRequest) -> dict[str, Any]:
    """Everything that the job needs, checked."""
    fitted = services.jobs.get(sid, body.identification, IDENTIFICATION)
    done(fitted)
    store = services.store
    spec = services.in_simulator(
        sid,
        check_and_fill,
        body,
        fitted,
        fitted_recordings(fitted, store),
        [store.measurements.get(sid, one) for one in body.hold_out],
        store.measurements.of_session(sid),
        services.settings.limits,
    )
    store.files.require_room(sid, BYTES_A_RUN * len(spec["runs"]))
    return spec


@router.get("/{jid}/result.json", response_class=FileResponse)
def result(sid: SessionId, jid: str, services: Shared) -> FileResponse:
    """All that the report shows, histories included."""
    return FileResponse(_document(services, sid, jid), media_type="application/json")


@router.get("/{jid}/report.html", response_class=HTMLResponse)
def as_report(sid: SessionId, jid: str, services: Shared) -> HTMLResponse:
    """The report, as the command line writes it, in a sandbox of its own."""
    document = json.loads(_document(services, sid, jid).read_bytes())
    # A sandbox cannot be had together with an opener policy.
    headers = {
        "Content-Security-Policy": SERVED_POLICY,
        "Cross-Origin-Opener-Policy": "unsafe-none",
    }
    return HTMLResponse(report(document), headers=headers)


def _document(services: Services, sid: str, jid: str) -> Any:
    job = services.jobs.get(sid, jid, KIND)
    if job.file is None:
        remedy = "ask for it again" if job.ended else "wait until it is done"
        raise Conflict(f"The validation has no report, its state is {job.state}; {remedy}.")
    return services.store.files.original(job.file)
