"""Which service process runs which job.

An unfinished job is run by its runner, one service process, which renews its lease by a heartbeat;
once the lease has run out another one may claim it. A job may thus be run twice, and is ended by
who has it then.

`attempts` counts starts that ended in a lost worker. `restarts` counts those that ended because the
runner was lost: it crashed, or its lease ran out. What one hands over as it stops in good order
counts as neither: a job must not fail for our restarts.
"""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    ScalarSelect,
    Select,
    case,
    func,
    or_,
    select,
    update,
)

from .database import Database
from .job_row import UNFINISHED, Job, cancel_in, job_of, select_jobs, to_cancel
from .tables import jobs

LEASE = 10.0
"""How long a job stays its runner's after the last heartbeat, s."""


@dataclass(frozen=True)
class Beat:
    """The ids of a runner's unfinished jobs, and of those among them that are to stop."""

    jobs: frozenset[str]
    cancel_asked: frozenset[str]


class JobLeases:
    """The runners of all jobs."""

    def __init__(self, database: Database):
        self._database = database

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
            stopped = select(jobs.c.id).where(free, to_cancel())
            urgency = jobs.c.cancel_asked.desc(), jobs.c.priority.desc()
            order = (*urgency, _run_of_session(), jobs.c.created, jobs.c.id)
            waiting = select(jobs.c.id).where(free, ~to_cancel()).order_by(*order)
            cancel_in(connection, self._database, _locked(connection, stopped))
            taken = _locked(connection, waiting.limit(most))
            _take_back(connection, jobs.c.id.in_(taken), runner=runner, heartbeat_at=now)
            query = select_jobs(jobs.c.id.in_(taken)).order_by(*order)
            return [job_of(row) for row in connection.execute(query)]

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
            asked = select(jobs.c.id).where(jobs.c.id.in_(mine), to_cancel())
            cancel_in(connection, self._database, connection.execute(asked).scalars().all())
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

    def save_progress(self, job: str, runner: str, progress: Mapping[str, Any]) -> None:
        """Keep how far its runner's job has come."""
        self._move(job, runner, UNFINISHED, progress=json.dumps(dict(progress)))

    def _move(self, job: str, runner: str, states: tuple[str, ...], **values: Any) -> bool:
        with self._database.writing() as connection:
            moved = connection.execute(
                update(jobs)
                .where(jobs.c.id == job, jobs.c.runner == runner, jobs.c.state.in_(states))
                .values(**values)
            )
        return bool(moved.rowcount)


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
