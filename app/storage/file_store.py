"""Files with their references: uploads of measurements, what jobs made, and parts of it.

Each has a row in `uploads` under its SHA-256, and goes with its last reference. A file is written
before its row, and removed after it: a row always has its file. Both happen under a lock that
stands for the file's folder, for another service may be writing the same file just then.
"""

import hashlib
import logging
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, delete, exists, func, insert, select

from ..errors import Busy, Unavailable
from ..limits import Limits
from .database import Database
from .disk_errors import OUT_OF_ORDER, files_in_a_sentence
from .originals import Originals
from .tables import job_files, job_parts, jobs, mappings, measurements, uploads

log = logging.getLogger(__name__)

AT_ONCE = 200
"""Files that are removed under one lock."""


class FileStore:
    """The files of all sessions."""

    def __init__(self, database: Database, originals: Originals, limits: Limits):
        self._database = database
        self._originals = originals
        self._limits = limits

    def keep(self, connection: Connection, files: Sequence[bytes]) -> list[str]:
        """Keep files to which the transaction goes on to refer; the SHA-256 of each."""
        hashes = [hashlib.sha256(data).hexdigest() for data in files]
        self._lock(connection, hashes)
        for sha256, data in dict(zip(hashes, files, strict=True)).items():
            with files_in_a_sentence():
                self._originals.keep(sha256, data)
            row = select(uploads.c.sha256).where(uploads.c.sha256 == sha256)
            if connection.execute(row).one_or_none() is None:
                connection.execute(
                    insert(uploads).values(
                        sha256=sha256, bytes=len(data), created=self._database.now
                    )
                )
        return hashes

    def original(self, sha256: str) -> Path:
        """Place of a file that has its row."""
        place = self._originals.original(sha256)
        if not place.is_file():
            raise Unavailable(OUT_OF_ORDER, retry_after=30)
        return place

    def has_row(self, sha256: str) -> bool:
        """Whether a file is kept, as far as the database knows."""
        with self._database.reading() as connection:
            row = select(uploads.c.sha256).where(uploads.c.sha256 == sha256)
            return connection.execute(row).one_or_none() is not None

    def require_room(self, session: str, more: int) -> None:
        """Raise Busy where a session cannot keep so many bytes more."""
        with self._database.reading() as connection:
            self.require_room_in(connection, session, more)

    def require_room_in(self, connection: Connection, session: str, more: int) -> None:
        """The same within a transaction, which holds the session's row to the end if it adds to
        what the session keeps.
        """
        total = sum(int(connection.execute(size).scalar_one()) for size in _sizes(session))
        if total + more > self._limits.session_bytes:
            raise Busy(
                f"The session's measurements and sweeps would exceed "
                f"{self._limits.session_bytes / 1e6:g} MB together; delete one first."
            )

    def drop_unreferenced(self) -> None:
        """Remove files of no measurement and no job: first the rows, then the files.

        What cannot be removed just now is left to the next time.
        """
        try:
            with self._database.reading() as connection:
                found = select(uploads.c.sha256).where(*_unreferenced()).order_by(uploads.c.sha256)
                names = connection.execute(found).scalars().all()
            for some in _batches(names):
                with self._database.writing() as connection:
                    self._lock(connection, some)
                    gone = (
                        delete(uploads)
                        .where(uploads.c.sha256.in_(some), *_unreferenced())
                        .returning(uploads.c.sha256)
                    )
                    dropped = connection.execute(gone).scalars().all()
                self._remove(dropped)
        except Unavailable as error:
            log.warning("files that nothing refers to are left for now: %s", error)

    def sweep(self) -> None:
        """Remove what a crash left behind: half-written files, and those without a row."""
        with self._database.reading() as connection:
            kept = set(connection.execute(select(uploads.c.sha256)).scalars())
        for some in _batches(sorted(set(self._originals.names()) - kept)):
            self._remove(some)

    def _remove(self, names: Sequence[str]) -> None:
        """Remove files that have no row, or none any more."""
        if not names:
            return
        with self._database.writing() as connection:
            self._lock(connection, names)
            rows = select(uploads.c.sha256).where(uploads.c.sha256.in_(names))
            kept = set(connection.execute(rows).scalars())
            with files_in_a_sentence():
                for name in names:
                    if name not in kept:
                        self._originals.drop(name)

    def _lock(self, connection: Connection, names: Iterable[str]) -> None:
        self._database.lock(connection, {f"originals/{name[:2]}" for name in names})


def _batches(names: Sequence[str]) -> Iterable[Sequence[str]]:
    return (names[first : first + AT_ONCE] for first in range(0, len(names), AT_ONCE))


def _unreferenced() -> Iterable[Any]:
    for table in (measurements, job_files, job_parts):
        yield ~exists().where(table.c.sha256 == uploads.c.sha256)


def _sizes(session: str) -> Iterable[Any]:
    """Queries for what a session's files, and what is told of them, take."""
    size = select(func.coalesce(func.sum(uploads.c.bytes), 0))
    yield size.select_from(measurements.join(uploads)).where(measurements.c.session == session)
    for table in (job_files, job_parts):
        yield size.select_from(jobs.join(table).join(uploads)).where(jobs.c.session == session)
    for column in (
        measurements.c.manoeuvre,
        measurements.c.mapping,
        measurements.c.conditioning,
        measurements.c.conditioned,
        mappings.c.body,
    ):
        length = func.coalesce(func.sum(func.length(column)), 0)
        yield select(length).where(column.table.c.session == session)
