"""Mappings that a session keeps by name, for the next recordings whose columns are the same."""

import json
import time
from collections.abc import Mapping
from typing import Any

from sqlalchemy import delete, func, insert, select

from ..errors import Busy, NotFound
from .database import Database
from .file_store import FileStore
from .session_row import lock_session, mark_used
from .tables import mappings

MOST = 100
"""Mappings of one session."""


class MappingStore:
    """The mappings of all sessions, as JSON."""

    def __init__(self, database: Database, files: FileStore):
        self._database = database
        self._files = files

    def of_session(self, session: str) -> dict[str, dict[str, Any]]:
        """By name, the newest first."""
        with self._database.reading() as connection:
            rows = connection.execute(
                select(mappings.c.name, mappings.c.body)
                .where(mappings.c.session == session)
                .order_by(mappings.c.created.desc())
            ).all()
        return {row.name: json.loads(row.body) for row in rows}

    def keep(self, session: str, name: str, mapping: Mapping[str, Any]) -> None:
        """Keep one, in place of that which has its name; `Busy` where there is no room."""
        body, mine = json.dumps(dict(mapping)), mappings.c.session == session
        with self._database.writing() as connection:
            lock_session(connection, session)
            connection.execute(delete(mappings).where(mine, mappings.c.name == name))
            count = connection.execute(
                select(func.count()).select_from(mappings).where(mine)
            ).scalar_one()
            if count >= MOST:
                raise Busy(f"The session already keeps {count} mappings; delete one first.")
            self._files.require_room_in(connection, session, len(body))
            connection.execute(
                insert(mappings).values(session=session, name=name, body=body, created=time.time())
            )
            mark_used(connection, session)

    def delete(self, session: str, name: str) -> None:
        """Remove one."""
        with self._database.writing() as connection:
            found = connection.execute(
                delete(mappings).where(mappings.c.session == session, mappings.c.name == name)
            )
        if not found.rowcount:
            raise NotFound("There is no mapping of that name in this session.")
