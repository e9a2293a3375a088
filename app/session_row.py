"""The row of a session, which whoever changes what the session holds locks first.

So of two that add to one session at once the second one sees what the first has added, also where
the database lets them write at the same time.
"""

from sqlalchemy import Connection, select, update

from .errors import NotFound
from .tables import sessions

GONE = "The session has been deleted; open the start page for a new one."


def lock_session(connection: Connection, session: str) -> None:
    """Wait for one's turn with a session; NotFound once it is deleted."""
    row = select(sessions.c.id).where(sessions.c.id == session).with_for_update(key_share=True)
    if connection.execute(row).one_or_none() is None:
        raise NotFound(GONE)


def mark_used(connection: Connection, session: str) -> None:
    """Note that a session holds something of its own."""
    connection.execute(update(sessions).where(sessions.c.id == session).values(used=True))
