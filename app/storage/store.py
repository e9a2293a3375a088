"""Everything the service keeps: rows in its database, and files beside it in the data directory.

Every query names the session it serves, so that an id of somebody else's is simply not found.
Methods block for a millisecond or so; the service calls them off the event loop.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sqlalchemy import delete, insert, select

from ..errors import NotFound
from ..limits import Limits
from .browser_store import BrowserStore
from .data_directory import DataDirectory, check_owner, database_of
from .database import Database
from .disk_errors import files_in_a_sentence
from .file_store import FileStore
from .job_leases import JobLeases
from .job_store import JobStore
from .key_store import KeyStore
from .mapping_store import MappingStore
from .measurement_store import MeasurementStore
from .owner_store import OwnerStore
from .postgresql import PostgresqlDatabase
from .recent_answers import RecentAnswers
from .session_store import SessionStore
from .setup_store import SetupStore
from .sqlite import SqliteDatabase
from .tables import job_parts

RESTING = 3600.0
"""How long nothing happens to what is left of a file that was being read, s."""


class Store:
    """Everything kept by one service; with SQLite, opening it locks the data directory.

    database : empty for SQLite in the data directory, else a PostgreSQL URL
    """

    def __init__(self, path: Path, limits: Limits, database: str = ""):
        self.limits = limits
        self.database, self.directory = _open_shared(path, database) if database else _open(path)
        self.files = FileStore(self.database, self.directory, limits)
        self.jobs = JobStore(self.database, limits)
        self.leases = JobLeases(self.database)
        self.setups = SetupStore(self.database, limits)
        self.mappings = MappingStore(self.database, self.files)
        self.measurements = MeasurementStore(
            self.database, self.directory, limits, self.files, self.jobs
        )
        self.answers = RecentAnswers()
        self.sessions = SessionStore(
            self.database, limits, self.files, self.measurements, self.answers.forget
        )
        self.owners = OwnerStore(self.database)
        self.browsers = BrowserStore(self.database, self.answers.forget)
        self.keys = KeyStore(self.database, self.answers.forget)
        if self.database.shared:
            self.directory.sweep(older=RESTING)
        else:
            # The lock of the directory tells that whoever was at them is gone.
            self.directory.sweep()
            self.leases.take_back_all()
        self.files.sweep()

    def close(self) -> None:
        """Close the database and give up the directory."""
        self.database.close()
        self.directory.close()

    # Jobs and their files

    def finish_job(
        self,
        job: str,
        state: str,
        *,
        runner: str | None = None,
        file: bytes | None = None,
        **found: Any,
    ) -> bool:
        """Give a job its final state, see `JobStore.finish_in`, and keep the file it made; False
        if it had one, or is another's: whoever took it over goes on with it.

        runner : whose it is;  None where it is nobody's
        """
        with self.database.writing() as connection:
            held = self.jobs.hold_in(connection, job)
            if held is None or held.runner != runner:
                return False
            sha256 = None if file is None else self.files.keep(connection, [file])[0]
            self.jobs.finish_in(connection, job, state, file=sha256, **found)
        self.files.drop_unreferenced()
        return True

    def keep_part(
        self, job: str, name: str, data: bytes, progress: Mapping[str, Any] | None = None
    ) -> bool:
        """Keep what a job has found so far under a name, durably, until the job ends; False where
        it has ended.

        progress : how far that came, given back by `parts`

        What is kept under that name already stays. Parts count in the session's bytes, but are not
        refused: what a job may take was asked for when it was taken.
        """
        mine = (job_parts.c.job == job) & (job_parts.c.name == name)
        with self.database.writing() as connection:
            if self.jobs.hold_in(connection, job) is None:
                return False
            if connection.execute(select(job_parts.c.name).where(mine)).one_or_none() is None:
                [sha256] = self.files.keep(connection, [data])
                told = json.dumps(dict(progress or {}))
                connection.execute(
                    insert(job_parts).values(job=job, name=name, sha256=sha256, progress=told)
                )
        return True

    def parts(self, job: str) -> dict[str, dict[str, Any]]:
        """What is kept of a job that runs: how far each part came, by its name, in their order."""
        with self.database.reading() as connection:
            query = select(job_parts.c.name, job_parts.c.progress).where(job_parts.c.job == job)
            rows = connection.execute(query).all()
        # A database has an order of its own for texts.
        return {row.name: json.loads(row.progress) for row in sorted(rows)}

    def part(self, job: str, name: str) -> bytes:
        """What is kept of a job under a name; `NotFound` once it has ended, or where the disk has
        lost the part, which is no part any more then: it can be made again.
        """
        mine = (job_parts.c.job == job) & (job_parts.c.name == name)
        with self.database.reading() as connection:
            sha256 = connection.execute(select(job_parts.c.sha256).where(mine)).scalar_one_or_none()
        with files_in_a_sentence():
            if sha256 is not None and not self.directory.lacks(sha256):
                return self.directory.original(sha256).read_bytes()
        if sha256 is not None:
            with self.database.writing() as connection:
                connection.execute(delete(job_parts).where(mine))
        raise NotFound(f"There is no part {name} of the job {job} any more.")

    def delete_job(self, session: str, job: str) -> None:
        """Remove a job with its result, its file and its parts."""
        self.jobs.delete(session, job)
        self.files.drop_unreferenced()


def database_beside(path: Path, url: str) -> Database:
    """The database of a data directory, opened beside the service that uses both."""
    if not url:
        check_owner(path, None)
        return SqliteDatabase(database_of(path))
    database = PostgresqlDatabase(url)
    try:
        check_owner(path, database.id)
    except BaseException:
        database.close()
        raise
    return database


def _open(path: Path) -> tuple[Database, DataDirectory]:
    directory = DataDirectory(path)
    try:
        return SqliteDatabase(directory.database), directory
    except BaseException:
        directory.close()
        raise


def _open_shared(path: Path, url: str) -> tuple[Database, DataDirectory]:
    database = PostgresqlDatabase(url)
    try:
        return database, DataDirectory(path, database.id)
    except BaseException:
        database.close()
        raise
