"""SQLite in the data directory: one service, one writer at a time.

WAL with synchronous=FULL: what was answered survives a power cut. A writing transaction takes the
write lock at its start (BEGIN IMMEDIATE), so it waits for its turn instead of failing half way; the
service's own threads queue for that, for SQLite would only have them look again and again.
"""

import sqlite3
import threading
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import ColumnElement, Connection, Float, create_engine, event, literal
from sqlalchemy.exc import DBAPIError

from ..errors import ServiceError, StorageFull, Unavailable
from .database import Database

BUSY_MILLISECONDS = 10_000
HELD = (
    "The service's database is held locked; close what else has its ridetune.sqlite open, then try"
    " again."
)


class SqliteDatabase(Database):
    """A file; whoever opens it owns its data directory."""

    shared = False

    def __init__(self, path: Path):
        engine = create_engine(
            f"sqlite+pysqlite:///{path}",
            pool_size=5,
            max_overflow=50,
            pool_timeout=30,
            hide_parameters=True,
        )
        self._turn = threading.Lock()
        event.listen(engine, "connect", _prepare)
        event.listen(engine, "begin", _begin)
        super().__init__(f"The database {path}", engine, engine.execution_options(writing=True))

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """See `Database.writing`."""
        if not self._turn.acquire(timeout=BUSY_MILLISECONDS / 1e3):
            raise Unavailable(HELD, retry_after=5)
        try:
            with super().writing() as connection:
                yield connection
        finally:
            self._turn.release()

    def lock(self, connection: Connection, names: Collection[str]) -> None:
        """Nothing more: no other transaction writes before the end of this one."""

    @property
    def now(self) -> ColumnElement[float]:
        """By the clock of this process."""
        return literal(time.time(), Float)

    def trouble(self, error: DBAPIError) -> ServiceError | None:
        """By SQLite's result codes."""
        match getattr(error.orig, "sqlite_errorcode", 0) & 0xFF:
            case sqlite3.SQLITE_BUSY | sqlite3.SQLITE_LOCKED:
                return Unavailable(HELD, retry_after=5)
            case sqlite3.SQLITE_FULL:
                return StorageFull()
            case (
                sqlite3.SQLITE_READONLY
                | sqlite3.SQLITE_IOERR
                | sqlite3.SQLITE_CANTOPEN
                | sqlite3.SQLITE_PERM
            ):
                return Unavailable(
                    "The service's database cannot be written; see that its data directory is "
                    "there, on a disk that works, and may be written, then try again.",
                    retry_after=30,
                )
            case sqlite3.SQLITE_CORRUPT | sqlite3.SQLITE_NOTADB:
                return Unavailable(
                    "The service's database is damaged; restore a backup of it with ridetune "
                    "restore into another data directory.",
                    retry_after=600,
                )
        return None


def _prepare(connection: Any, _: Any) -> None:
    connection.isolation_level = None
    for pragma in (
        # First, for the change to WAL may have to wait already.
        f"busy_timeout={BUSY_MILLISECONDS}",
        "journal_mode=WAL",
        "synchronous=FULL",
        "foreign_keys=ON",
    ):
        connection.execute(f"PRAGMA {pragma}").close()


def _begin(connection: Connection) -> None:
    writing = connection.get_execution_options().get("writing", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")
