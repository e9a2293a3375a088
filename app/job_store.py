"""Jobs as kept in the database: queued, running, done, failed or cancelled.

An unfinished job is run by its runner, one service process, which renews its lease by a heartbeat;
once the lease has run out another one may claim it. A job may thus be run twice, and the first end
is the end.

`attempts` counts starts that ended in a lost worker. `restarts` counts those that ended because the
runner was lost: it crashed, or its lease ran out. What one hands over as it stops in good order
counts as neither: a job must not fail for our restarts.
"""

import json
import secrets
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Row,
    ScalarSelect,
    Select,
    case,
    delete,
    exists,
    func,
    insert,
    or_,
    select,
    update,
)

from .database import Database
from .errors import Busy, InvalidRequest, NotFound
from .limits import Limits
from .session_row import lock_session, mark_used
from .tables import job_files, job_parts, jobs, results

UNFINISHED = ("queued", "running")
LEASE = 10.0
"""How long a job stays its runner's after the last heartbeat, s."""


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


@dataclass(frozen=True)
class Beat:
    """The ids of a runner's unfinished jobs, and of those among them that are to stop."""

    jobs: frozenset[str]
    cancel_asked: frozenset[str]


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
        with self._database.reading() as connection:
            return self.unfinished_in(connection, session)

    def unfinished_in(self, connection: Connection, session: str | None = None) -> list[Job]:
        """The same within a transaction."""
        conditions: list[Any] = [jobs.c.state.in_(UNFINISHED)]
        if session is not None:
            conditions.append(jobs.c.session == session)
        query = _select(*conditions).order_by(jobs.c.created)
        return [_job(row) for row in connection.execute(query)]

    def claim(
        self,
        runner: str,
        most: int,
        *,
        least_priority: int = 0,
        kinds: Collection[str] | None = None,
        known: Collection[str] | None = None,
        other_than: Collection[str] = (),
    ) -> list[Job]:
        """Make unfinished jobs that nobody runs the runner's, `most` at once, those of the highest
        priority first, then those of the session of which the fewest are run, then the oldest.

        kinds : that the runner knows; all without
        known : all jobs that the runner runs; another one that is its own comes again, for the
            answer to its claim was lost
        other_than : sessions of which none is claimed

        Whichever of them was asked to stop is cancelled instead, unless there are parts of it, of
        which its runner may make a result.
        """
        now = self._database.now
        # Also where a clock went back, the lease has run out.
        lapsed = func.abs(jobs.c.heartbeat_at - now) > LEASE
        free = jobs.c.state.in_(UNFINISHED) & or_(
            jobs.c.runner.is_(None),
            (jobs.c.runner != runner) & lapsed,
            *([] if known is None else [(jobs.c.runner == runner) & jobs.c.id.not_in(known)]),
        )
        free &= (jobs.c.priority >= least_priority) & jobs.c.session.not_in(other_than)
        if kinds is not None:
            free &= jobs.c.kind.in_(kinds)
        with self._database.reading() as connection:
            # Mostly there is none, and nobody's writing is held up.
            if connection.execute(select(jobs.c.id).where(free).limit(1)).first() is None:
                return []
        with self._database.writing() as connection:
            stopped = select(jobs.c.id).where(free, _to_cancel())
            urgency = jobs.c.cancel_asked.desc(), jobs.c.priority.desc()
            order = (*urgency, _run_of_session(), jobs.c.created, jobs.c.id)
            waiting = select(jobs.c.id).where(free, ~_to_cancel()).order_by(*order)
            self._cancel(connection, _locked(connection, stopped))
            taken = _locked(connection, waiting.limit(most))
            _take_back(connection, jobs.c.id.in_(taken), runner=runner, heartbeat_at=now)
            query = _select(jobs.c.id.in_(taken)).order_by(*order)
            return [_job(row) for row in connection.execute(query)]

    def heartbeat(self, runner: str) -> Beat:
        """Renew the leases of a runner's jobs; which those still are."""
        with self._database.writing() as connection:
            # In one order, so that nobody who locks several of them waits in a circle.
            held = select(jobs.c.id).where(_of(runner)).order_by(jobs.c.id).with_for_update()
            mine = connection.execute(held).scalars().all()
            renewed = connection.execute(
                update(jobs)
                .where(jobs.c.id.in_(mine))
                .values(heartbeat_at=self._database.now)
                .returning(jobs.c.id, jobs.c.cancel_asked)
            ).all()
        return Beat(
            frozenset(row.id for row in renewed),
            frozenset(row.id for row in renewed if row.cancel_asked),
        )

    def release(self, runner: str) -> None:
        """Give up a runner's jobs, for the next one to claim."""
        with self._database.writing() as connection:
            held = select(jobs.c.id).where(_of(runner)).order_by(jobs.c.id).with_for_update()
            mine = connection.execute(held).scalars().all()
            asked = select(jobs.c.id).where(jobs.c.id.in_(mine), _to_cancel())
            self._cancel(connection, connection.execute(asked).scalars().all())
            connection.execute(
                update(jobs)
                .where(jobs.c.id.in_(mine), _of(runner))
                .values(state="queued", started=None, runner=None)
            )

    def take_back_all(self) -> None:
        """Make every unfinished job claimable, where no other service can be running one."""
        with self._database.writing() as connection:
            _take_back(connection, jobs.c.runner.is_not(None), runner=None)

    def start(self, job: str, runner: str) -> bool:
        """Mark its runner's queued job as running; False if it is not queued, or not its own, any
        more.
        """
        return self._move(job, runner, ("queued",), state="running", started=self._database.now)

    def requeue(self, job: str, runner: str) -> bool:
        """Take a job back whose worker was lost, which stays its runner's; False if it has ended
        meanwhile, or is another's.
        """
        return self._move(
            job, runner, UNFINISHED, state="queued", started=None, attempts=jobs.c.attempts + 1
        )

    def ask_to_cancel(self, session: str, job: str) -> Job:
        """Have a job's runner stop it; one that has no runner and no parts is cancelled at once."""
        with self._database.writing() as connection:
            mine = (jobs.c.session == session) & (jobs.c.id == job)
            connection.execute(
                update(jobs).where(mine, jobs.c.state.in_(UNFINISHED)).values(cancel_asked=True)
            )
            unowned = select(jobs.c.id).where(
                mine, _to_cancel(), jobs.c.state.in_(UNFINISHED), jobs.c.runner.is_(None)
            )
            self._cancel(connection, connection.execute(unowned).scalars().all())
        return self.get(session, job)

    def hold_in(self, connection: Connection, job: str) -> bool:
        """Hold a job's row to the end of a transaction, before its files; False where it has ended
        or is gone.
        """
        row = select(jobs.c.id).where(jobs.c.id == job, jobs.c.state.in_(UNFINISHED))
        return connection.execute(row.with_for_update()).one_or_none() is not None

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

    def save_progress(self, job: str, runner: str, progress: Mapping[str, Any]) -> None:
        """Keep how far its runner's job has come."""
        self._move(job, runner, UNFINISHED, progress=json.dumps(dict(progress)))

    def delete(self, session: str, job: str) -> None:
        """Remove a job and its result."""
        with self._database.writing() as connection:
            connection.execute(delete(jobs).where(jobs.c.session == session, jobs.c.id == job))

    def _move(self, job: str, runner: str, states: tuple[str, ...], **values: Any) -> bool:
        with self._database.writing() as connection:
            moved = connection.execute(
                update(jobs)
                .where(jobs.c.id == job, jobs.c.runner == runner, jobs.c.state.in_(states))
                .values(**values)
            )
        return bool(moved.rowcount)

    def _cancel(self, connection: Connection, chosen: Sequence[str]) -> None:
        values = {"state": "cancelled", "finished": self._database.now}
        connection.execute(update(jobs).where(jobs.c.id.in_(chosen)).values(**values))
        connection.execute(delete(job_parts).where(job_parts.c.job.in_(chosen)))


def _to_cancel() -> ColumnElement[bool]:
    """Whether a job was asked to stop of which no runner has anything to keep."""
    return jobs.c.cancel_asked & ~exists().where(job_parts.c.job == jobs.c.id)


def _run_of_session() -> ScalarSelect[int]:
    """How many jobs of a job's session somebody runs."""
    others = jobs.alias()
    mine = (others.c.session == jobs.c.session) & others.c.state.in_(UNFINISHED)
    query = select(func.count()).where(mine, others.c.runner.is_not(None))
    return query.correlate(jobs).scalar_subquery()


def _of(runner: str) -> ColumnElement[bool]:
    return (jobs.c.runner == runner) & jobs.c.state.in_(UNFINISHED)


def _locked(connection: Connection, chosen: Select[Any]) -> Sequence[str]:
    """Ids that nobody else holds at the moment, held to the end of the transaction."""
    return connection.execute(chosen.with_for_update(skip_locked=True)).scalars().all()


def _take_back(connection: Connection, chosen: ColumnElement[bool], **values: Any) -> None:
    """Queue unfinished jobs again; those that ran have lost their runner."""
    lost = case((jobs.c.state == "running", 1), else_=0)
    connection.execute(
        update(jobs)
        .where(chosen, jobs.c.state.in_(UNFINISHED))
        .values(state="queued", started=None, restarts=jobs.c.restarts + lost, **values)
    )


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
        runner=row.runner,
        cancel_asked=row.cancel_asked,
        priority=row.priority,
        result=json.loads(result) if result else None,
        file=file,
    )
