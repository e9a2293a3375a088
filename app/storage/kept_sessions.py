"""All sessions as whoever keeps the service sees them: whose each is, and how much it holds."""

from collections.abc import Collection
from dataclasses import dataclass

from sqlalchemy import func, select, union

from ..errors import NotFound
from .database import Database
from .file_store import FileStore
from .session_row import delete_sessions
from .tables import job_files, job_parts, jobs, measurements, sessions, uploads


@dataclass(frozen=True)
class KeptSession:
    """What is known of a session without a look into it.

    owner : as the login tells a user, None where whoever holds its token opens it
    bytes : of its files; one that several sessions have counts in each
    """

    id: str
    name: str
    owner: str | None
    created: float
    seen: float
    measurements: int
    jobs: int
    bytes: int


class KeptSessions:
    """The sessions of a database, beside the services that use it."""

    def __init__(self, database: Database, files: FileStore):
        self._database = database
        self._files = files

    def list(self) -> list[KeptSession]:
        """All of them, those used latest first."""
        columns = [sessions.c[name] for name in ("id", "name", "owner", "created", "seen")]
        files = union(
            select(measurements.c.session, measurements.c.sha256),
            *(
                select(jobs.c.session, table.c.sha256).select_from(jobs.join(table))
                for table in (job_files, job_parts)
            ),
        ).subquery()
        size = (
            select(files.c.session, func.sum(uploads.c.bytes))
            .join(uploads, uploads.c.sha256 == files.c.sha256)
            .group_by(files.c.session)
        )
        with self._database.reading() as connection:
            order = (sessions.c.seen.desc(), sessions.c.created.desc(), sessions.c.id)
            rows = connection.execute(select(*columns).order_by(*order)).all()
            held = [
                {session: int(number) for session, number in connection.execute(query)}
                for query in (
                    *(
                        select(table.c.session, func.count()).group_by(table.c.session)
                        for table in (measurements, jobs)
                    ),
                    size,
                )
            ]
        return [KeptSession(*row, *(one.get(row.id, 0) for one in held)) for row in rows]

    def remove(self, ids: Collection[str]) -> None:
        """Delete sessions with all they hold, all or none of them; NotFound where there is none of
        an id. A service that runs a job of one finds it gone at its next heartbeat, and stops it.
        """
        with self._database.writing() as connection:
            known = set(connection.execute(select(sessions.c.id)).scalars())
            if unknown := [id for id in ids if id not in known]:
                raise NotFound(
                    f"There is no session {unknown[0]!r}; `ridetune sessions list` shows those "
                    "there are."
                )
            delete_sessions(connection, ids)
        self._files.drop_unreferenced()
