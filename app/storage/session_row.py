"""The row of a session, which whoever changes what the session holds locks first.

So of two that add to one session at once the second one sees what the first has added, also where
the database lets them write at the same time.
"""

from collections.abc import Collection

from sqlalchemy import Connection, delete, select, update

from ..errors import NotFound
from .tables import jobs, sessions

GONE = "The session has been deleted; open the start page for a new one."


def lock_session(connection: Connection, session: str) -> None:
    """Wait for one's turn with a session; NotFound once it is deleted."""
    row = select(sessions.c.id).where(sessions.c.id == session).with_for_update(key_share=True)
    if connection.execute(row).one_or_none() is None:
        raise NotFound(GONE)


def mark_used(connection: Connection, session: str) -> None:
    """Note that a session holds something of its own."""
    connection.execute(update(sessions).where(sessions.c.id == session).values(used=True))


def delete_sessions(connection: Connection, ids: Collection[str]) -> None:
    """Remove sessions with all their measurements, jobs and results."""
    # In the order in which whoever locks several jobs does.
    theirs = select(jobs.c.id).where(jobs.c.session.in_(ids)).order_by(jobs.c.id)
    connection.execute(theirs.with_for_update())
    connection.execute(delete(sessions).where(sessions.c.id.in_(ids)))
