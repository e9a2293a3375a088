"""Jobs as kept in the database: queued, running, done, failed or cancelled.

`attempts` counts starts that ended in a lost worker, `restarts` counts starts that ended because
the service itself stopped: a job must not fail for our restarts.
"""

import json
import secrets
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Row, delete, func, insert, select, update

from .database import Database
from .errors import Busy, InvalidRequest, NotFound
from .settings import Limits
from .tables import job_files, jobs, results, sessions

UNFINISHED = ("queued", "running")


@dataclass(frozen=True)
class Job:
    """One background job; `spec` is everything needed to run it again, `file` the SHA-256 of what
    it made.
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


class JobStore:
    """The jobs of all sessions."""

    def __init__(self, database: Database, limits: Limits):
        self._database = database
        self._limits = limits

    def add(
        self, session: str, kind: str, spec: Mapping[str, Any], key: str | None
    ) -> tuple[Job, bool]:
        """Keep a queued job, or find the one kept under the caller's key; whether it is new.

        spec : with `asked`, see `known`
        """
        with self._database.writing() as connection:
            if (known := _known(connection, session, key, spec["asked"])) is not None:
                return known, False
            mine = jobs.c.session == session
            total = connection.execute(select(func.count()).where(mine)).scalar_one()
            unfinished = connection.execute(
                select(func.count()).where(mine, jobs.c.state.in_(UNFINISHED))
            ).scalar_one()
            if unfinished >= self._limits.unfinished_jobs:
                raise Busy(
                    f"The session already has {unfinished} jobs under way; wait for one to end or "
                    "cancel one.",
                    retry_after=10,
                )
            if total >= self._limits.session_jobs:
                raise Busy(f"The session already keeps {total} jobs; delete some.")
            job = secrets.token_hex(8)
            connection.execute(
                insert(jobs).values(
                    id=job,
                    session=session,
                    kind=kind,
                    key=key,
                    state="queued",
                    spec=json.dumps(dict(spec)),
                    created=time.time(),
                )
            )
            connection.execute(update(sessions).where(sessions.c.id == session).values(used=True))
            return _job(connection.execute(_select(jobs.c.id == job)).one()), True

    def known(self, session: str, key: str | None, asked: str) -> Job | None:
        """The job kept under the caller's key, if there is one.

        asked : stands for the request; InvalidRequest where the key is that of another one
        """
        with self._database.reading() as connection:
            return _known(connection, session, key, asked)

    def get(self, session: str, job: str, kind: str | None = None) -> Job:
        """One job of a session, of one kind if it is told, with its result."""
        with self._database.reading() as connection:
            row = connection.execute(
                _select(jobs.c.session == session, jobs.c.id == job)
            ).one_or_none()
            body, file = (
                connection.execute(select(column).where(table.c.job == job)).scalar_one_or_none()
                for table, column in ((results, results.c.body), (job_files, job_files.c.sha256))
            )
        if row is None or kind not in (None, row.kind):
            raise NotFound(f"There is no {kind or 'job'} with that id in this session.")
        return _job(row, body, file)

    def of_session(self, session: str, kind: str) -> list[Job]:
        """All jobs of a session and kind, oldest first, without results."""
        with self._database.reading() as connection:
            query = _select(jobs.c.session == session, jobs.c.kind == kind).order_by(jobs.c.created)
            return [_job(row) for row in connection.execute(query)]

    def unfinished(self, session: str | None = None) -> list[Job]:
        """Jobs that are queued or running, oldest first."""
        conditions: list[Any] = [jobs.c.state.in_(UNFINISHED)]
        if session is not None:
            conditions.append(jobs.c.session == session)
        with self._database.reading() as connection:
            query = _select(*conditions).order_by(jobs.c.created)
            return [_job(row) for row in connection.execute(query)]

    def requeue_all(self) -> None:
        """Take back what ran when the service stopped."""
        with self._database.writing() as connection:
            connection.execute(
                update(jobs)
                .where(jobs.c.state == "running")
                .values(state="queued", started=None, restarts=jobs.c.restarts + 1)
            )

    def start(self, job: str) -> bool:
        """Mark a queued job as running; False if it is not queued any more."""
        return self._move(job, ("queued",), state="running", started=time.time())

    def requeue(self, job: str) -> bool:
        """Take a job back whose worker was lost; False if it has ended meanwhile."""
        return self._move(
            job, UNFINISHED, state="queued", started=None, attempts=jobs.c.attempts + 1
        )

    def finish(
        self,
        job: str,
        state: str,
        *,
        result: Mapping[str, Any] | None = None,
        error: Mapping[str, str] | None = None,
        progress: Mapping[str, Any] | None = None,
        file: str | None = None,
    ) -> bool:
        """Give a job its final state, with its result in the same commit; False if it had one.

        file : SHA-256 of what it made, which is kept already
        """
        values: dict[str, Any] = {"state": state, "finished": time.time()}
        if error is not None:
            values["error"] = json.dumps(dict(error))
        if progress is not None:
            values["progress"] = json.dumps(dict(progress))
        with self._database.writing() as connection:
            ended = connection.execute(
                update(jobs).where(jobs.c.id == job, jobs.c.state.in_(UNFINISHED)).values(**values)
            )
            if ended.rowcount and result is not None:
                connection.execute(insert(results).values(job=job, body=json.dumps(dict(result))))
            if ended.rowcount and file is not None:
                connection.execute(insert(job_files).values(job=job, sha256=file))
        return bool(ended.rowcount)

    def save_progress(self, job: str, progress: Mapping[str, Any]) -> None:
        """Keep how far a running job has come."""
        self._move(job, UNFINISHED, progress=json.dumps(dict(progress)))

    def delete(self, session: str, job: str) -> None:
        """Remove a job and its result."""
        with self._database.writing() as connection:
            connection.execute(delete(jobs).where(jobs.c.session == session, jobs.c.id == job))

    def _move(self, job: str, states: tuple[str, ...], **values: Any) -> bool:
        with self._database.writing() as connection:
            moved = connection.execute(
                update(jobs).where(jobs.c.id == job, jobs.c.state.in_(states)).values(**values)
            )
        return bool(moved.rowcount)


def _select(*conditions: Any) -> Any:
    return select(jobs).where(*conditions)


def _known(connection: Connection, session: str, key: str | None, asked: str) -> Job | None:
    if key is None:
        return None
    row = connection.execute(_select(jobs.c.session == session, jobs.c.key == key)).one_or_none()
    if row is None:
        return None
    kept = _job(row)
    if kept.spec["asked"] != asked:
        raise InvalidRequest(
            f"The key is that of another request, which {kept.kind} {kept.id} answers; give each a"
            " key of its own.",
            field="key",
        )
    return kept


def _job(row: Row[Any], result: str | None = None, file: str | None = None) -> Job:
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
        result=json.loads(result) if result else None,
        file=file,
    )
