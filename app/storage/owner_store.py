"""Whose a session is: of a user, or, where nobody is known by name, of whoever holds its token.

A user's session opens for that user only, its token opens nothing.
"""

import time
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, func, select, update

from ..errors import NotFound, Unavailable
from .database import Database
from .secret import hashed
from .session_row import GONE
from .tables import measurements, sessions

SEEN_EVERY = 60.0


@dataclass(frozen=True)
class OwnSession:
    """A session in the list of its owner's; instants in s since the epoch."""

    id: str
    name: str
    created: float
    seen: float
    measurements: int


_HELD = select(func.count()).where(measurements.c.session == sessions.c.id).scalar_subquery()
_LISTED = select(sessions.c.id, sessions.c.name, sessions.c.created, sessions.c.seen, _HELD)


class OwnerStore:
    """The owners of all sessions."""

    def __init__(self, database: Database):
        self._database = database

    def opens(self, session: str, *, user: str | None, token: str) -> bool:
        """Whether a session is the caller's; notes that it is in use."""
        mine = (sessions.c.id == session) & _mine(user, [token])
        with self._database.reading() as connection:
            seen = connection.execute(select(sessions.c.seen).where(mine)).scalar()
        if seen is None:
            return False
        if seen < time.time() - SEEN_EVERY:
            self.note_use(session)
        return True

    def note_use(self, session: str) -> None:
        """Note that a session is in use, at this very moment."""
        # Where nothing can be written, what is kept may still be looked at.
        with suppress(Unavailable), self._database.writing() as connection:
            mine = update(sessions).where(sessions.c.id == session)
            connection.execute(mine.values(seen=time.time()))

    def sessions(self, *, user: str | None, tokens: Collection[str]) -> list[OwnSession]:
        """The caller's sessions, those used latest first."""
        query = _LISTED.where(_mine(user, tokens))
        with self._database.reading() as connection:
            rows = connection.execute(
                query.order_by(sessions.c.seen.desc(), sessions.c.created.desc())
            ).all()
        return [OwnSession(*row) for row in rows]

    def session(self, session: str) -> OwnSession:
        """One session as the list has it."""
        with self._database.reading() as connection:
            row = connection.execute(_LISTED.where(sessions.c.id == session)).one_or_none()
        if row is None:
            raise NotFound(GONE)
        return OwnSession(*row)


def _mine(user: str | None, tokens: Collection[str]) -> ColumnElement[Any]:
    held = sessions.c.token_hash.in_([hashed(token) for token in tokens])
    by_token = sessions.c.owner.is_(None) & held
    return by_token if user is None else by_token | (sessions.c.owner == user)
