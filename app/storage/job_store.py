"""Jobs as their sessions keep them: asked for, looked at, asked to stop, ended."""

import json
import secrets
from collections.abc import Collection, Mapping
from typing import Any

from sqlalchemy import Connection, Row, delete, func, insert, select, update

from ..errors import Busy, InvalidRequest, NotFound
from ..limits import Limits
from .database import Database
from .job_row import UNFINISHED, Job, cancel_in, job_of, select_jobs, to_cancel
from .session_row import lock_session, mark_used
from .tables import job_files, job_parts, jobs, results


class JobStore:
    """The jobs of all sessions."""

    def __init__(self, database: Database, limits: Limits):
        self._database = database
        self._limits = limits

    def add(
        self,
        session: str,
        kind: str,
        spec: Mapping[str, Any],
        key: str | None,
        *,
        priority: int = 0,
    ) -> tuple[Job, bool]:
        """Keep a queued job, or find the one kept under the caller's key; whether it is new.

        spec : with `asked`, see `known`
        """
        with self._database.writing() as connection:
            lock_session(connection, session)
            if (known := _known(connection, session, key, spec["asked"])) is not None:
                return known, False
            mine = jobs.c.session == session
            known_so_far = select(func.count(), func.max(jobs.c.created), self._database.now)
            total, newest, now = connection.execute(known_so_far.where(mine)).one()
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
                    # Also where the clock has gone back, what comes later is later.
                    created=max(now, (newest or 0.0) + 1e-3),
                    priority=priority,
                )
            )
            mark_used(connection, session)
            return job_of(connection.execute(select_jobs(jobs.c.id == job)).one()), True

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
                select_jobs(jobs.c.session == session, jobs.c.id == job)
            ).one_or_none()
            body, file = (
                connection.execute(select(column).where(table.c.job == job)).scalar_one_or_none()
                for table, column in ((results, results.c.body), (job_files, job_files.c.sha256))
            )
        if row is None or kind not in (None, row.kind):
            raise NotFound(f"There is no {kind or 'job'} with that id in this session.")
        return job_of(row, body, file)

    def of_session(self, session: str, kind: str) -> list[Job]:
        """All jobs of a session and kind, oldest first, without results."""
        with self._database.reading() as connection:
            query = select_jobs(jobs.c.session == session, jobs.c.kind == kind).order_by(
                jobs.c.created
            )
            return [job_of(row) for row in connection.execute(query)]

    def standing(self, some: Collection[str]) -> dict[str, Job]:
        """Those of some jobs that there are, by id, without results; of whichever session, which
        the caller has to look at.
        """
        with self._database.reading() as connection:
            rows = connection.execute(select_jobs(jobs.c.id.in_(some)))
            return {row.id: job_of(row) for row in rows}

    def unfinished(self, session: str | None = None) -> list[Job]:
        """Jobs that are queued or running, oldest first."""
        with self._database.reading() as connection:
            return self.unfinished_in(connection, session)

    def unfinished_in(self, connection: Connection, session: str | None = None) -> list[Job]:
        """The same within a transaction."""
        conditions: list[Any] = [jobs.c.state.in_(UNFINISHED)]
        if session is not None:
            conditions.append(jobs.c.session == session)
        query = select_jobs(*conditions).order_by(jobs.c.created)
        return [job_of(row) for row in connection.execute(query)]

    def ask_to_cancel(self, session: str, job: str) -> Job:
        """Have a job's runner stop it; one without parts that nobody runs, or that has not started,
        is cancelled at once.
        """
        with self._database.writing() as connection:
            mine = (jobs.c.session == session) & (jobs.c.id == job)
            connection.execute(
                update(jobs).where(mine, jobs.c.state.in_(UNFINISHED)).values(cancel_asked=True)
            )
            idle = (jobs.c.state == "queued") | jobs.c.runner.is_(None)
            unbegun = select(jobs.c.id).where(mine, to_cancel(), jobs.c.state.in_(UNFINISHED), idle)
            cancel_in(connection, self._database, connection.execute(unbegun).scalars().all())
        return self.get(session, job)

    def hold_in(self, connection: Connection, job: str) -> Row[Any] | None:
        """Hold a job's row to the end of a transaction, before its files; whose it is, as `runner`.
        None where it has ended or is gone.
        """
        row = select(jobs.c.runner).where(jobs.c.id == job, jobs.c.state.in_(UNFINISHED))
        return connection.execute(row.with_for_update()).one_or_none()

    def finish_in(
        self,
        connection: Connection,
        job: str,
        state: str,
        *,
        result: Mapping[str, Any] | None = None,
        error: Mapping[str, str] | None = None,
        progress: Mapping[str, Any] | None = None,
        file: str | None = None,
    ) -> None:
        """Give a job that is held its final state; its result comes with it, its parts go.

        file : SHA-256 of what it made, which is kept already
        """
        values: dict[str, Any] = {"state": state, "finished": self._database.now}
        if error is not None:
            values["error"] = json.dumps(dict(error))
        if progress is not None:
            values["progress"] = json.dumps(dict(progress))
        connection.execute(update(jobs).where(jobs.c.id == job).values(**values))
        if result is not None:
            connection.execute(insert(results).values(job=job, body=json.dumps(dict(result))))
        if file is not None:
            connection.execute(insert(job_files).values(job=job, sha256=file))
        connection.execute(delete(job_parts).where(job_parts.c.job == job))

    def delete(self, session: str, job: str) -> None:
        """Remove a job and its result."""
        with self._database.writing() as connection:
            connection.execute(delete(jobs).where(jobs.c.session == session, jobs.c.id == job))


def _known(connection: Connection, session: str, key: str | None, asked: str) -> Job | None:
    if key is None:
        return None
    row = connection.execute(
        select_jobs(jobs.c.session == session, jobs.c.key == key)
    ).one_or_none()
    if row is None:
        return None
    kept = job_of(row)
    if kept.spec["asked"] != asked:
        raise InvalidRequest(
            f"The key is that of another request, which {kept.kind} {kept.id} answers; give each a"
            " key of its own.",
            field="key",
        )
    return kept
