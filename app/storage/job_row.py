"""A job as it stands in its row, and what is said of rows in queries."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Connection, Row, Select, delete, exists, select, update

from .database import Database
from .tables import job_parts, jobs

UNFINISHED = ("queued", "running")


@dataclass(frozen=True)
class Job:
    """One background job.

    spec : everything needed to run it again
    runner : the service process that runs it
    priority : a job with a higher one is claimed before others
    file : SHA-256 of what it made
    """

    id: str
    session: str
    kind: str
    state: str
    spec: dict[str, Any]
    progress: dict[str, Any]
    error: dict[str, str] | None
    created: float
    started: float | None
    finished: float | None
    attempts: int
    restarts: int
    runner: str | None
    cancel_asked: bool
    priority: int
    result: dict[str, Any] | None = None
    file: str | None = None

    @property
    def ended(self) -> bool:
        """Whether the state is final."""
        return self.state not in UNFINISHED

    @property
    def measurements(self) -> list[str]:
        """Ids of the measurements it reads."""
        return [run["id"] for run in self.spec.get("runs", [])]


def select_jobs(*conditions: ColumnElement[bool]) -> Select[Any]:
    """Query for rows, each for `job_of`."""
    return select(jobs).where(*conditions)


def job_of(row: Row[Any], result: str | None = None, file: str | None = None) -> Job:
    """The job of a row, with its result and the SHA-256 of its file where they are told."""
    return Job(
        id=row.id,
        session=row.session,
        kind=row.kind,
        state=row.state,
        spec=json.loads(row.spec),
        progress=json.loads(row.progress),
        error=json.loads(row.error) if row.error else None,
        created=row.created,
        started=row.started,
        finished=row.finished,
        attempts=row.attempts,
        restarts=row.restarts,
        runner=row.runner,
        cancel_asked=row.cancel_asked,
        priority=row.priority,
        result=json.loads(result) if result else None,
        file=file,
    )


def to_cancel() -> ColumnElement[bool]:
    """Whether a job was asked to stop of which no runner has anything to keep."""
    return jobs.c.cancel_asked & ~exists().where(job_parts.c.job == jobs.c.id)


def cancel_in(connection: Connection, database: Database, chosen: Sequence[str]) -> None:
    """Cancel unfinished jobs within a transaction."""
    values = {"state": "cancelled", "finished": database.now}
    connection.execute(update(jobs).where(jobs.c.id.in_(chosen)).values(**values))
    connection.execute(delete(job_parts).where(job_parts.c.job.in_(chosen)))
