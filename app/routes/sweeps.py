"""Sweeps: background jobs like identifications, whose rows come as a file."""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Literal

from fastapi.responses import FileResponse, Response, StreamingResponse

from ..access.sessions import SessionId
from ..errors import Conflict
from ..schemas import SweepRequest
from ..web.services import Services, Shared
from ..work.excitation_mode import mode_of, recording_of
from ..work.sweep import KIND, as_asked, check_and_fill
from .jobs import View, job_router, submitted

ASKED = (
    *("design", "manoeuvre", "rims", "posts", "road", "duration"),
    *("lift_off", "step", "sample_step", "runs"),
)
"""Fields of a request that its job shows, with what held untold filled in; `runs` has id and name
of the recording that moves the cars."""

MEDIA_TYPES = {
    "parquet": "application/vnd.apache.parquet",
    "arrow": "application/vnd.apache.arrow.file",
    "csv": "text/csv; charset=utf-8",
}

PIECE = 1 << 16
"""Bytes of a file that are sent at a time."""

VIEW = View(
    KIND,
    asked=lambda job: {name: job.spec[name] for name in ASKED},
    result=lambda job: {"vehicle": job.spec["vehicle"], "result": job.result},
)

router = job_router("sweeps", VIEW)


@router.post("", status_code=202)
async def submit(sid: SessionId, services: Shared, body: SweepRequest) -> dict[str, Any]:
    """Queue a sweep; the same `key` again gives the same job."""
    return await submitted(
        services, sid, VIEW, body.key, lambda: as_asked(body), lambda: _spec(services, sid, body)
    )


def _spec(services: Services, sid: str, body: SweepRequest) -> dict[str, Any]:
    """Everything that the job needs, checked."""
    mode_of(body)
    store = services.store
    vehicle = store.sessions.get(sid).vehicle if body.vehicle is None else body.vehicle
    kept = recording_of(body, sid, store)
    limits = services.settings.limits
    spec = services.in_simulator(sid, check_and_fill, body, vehicle, kept, limits)
    store.files.require_room(sid, spec.pop("most_bytes"))
    return spec


@router.get("/{jid}/cars.{form}", response_class=Response)
def cars(
    sid: SessionId,
    jid: str,
    form: Literal["parquet", "arrow", "csv"],
    services: Shared,
) -> Response:
    """The rows of a sweep that is done."""
    job = services.jobs.get(sid, jid, KIND)
    if job.file is None:
        remedy = "ask for it again" if job.ended else "wait until it is done"
        raise Conflict(f"The sweep has no rows, its state is {job.state}; {remedy}.")
    kept = services.store.files.original(job.file)
    if form == "parquet":
        return FileResponse(kept, filename="cars.parquet", media_type=MEDIA_TYPES[form])
    return StreamingResponse(
        _converted(kept, form),
        media_type=MEDIA_TYPES[form],
        headers={"Content-Disposition": f'attachment; filename="cars.{form}"'},
    )


def _converted(kept: Path, form: Literal["arrow", "csv"]) -> Iterator[bytes]:
    """A kept file in another form, by way of the disk: CSV may be large."""
    from ...engine.sweeps.sweep_file import read_blocks, write_blocks

    with TemporaryFile() as stream:
        with kept.open("rb") as file:
            write_blocks(stream, form, *read_blocks(file))
        stream.seek(0)
        while piece := stream.read(PIECE):
            yield piece
