"""SQLite through SQLAlchemy Core: durable commits, one writer at a time, a checked schema.

WAL with synchronous=FULL: what was answered survives a power cut. A writing transaction takes the
write lock at its start (BEGIN IMMEDIATE), so it waits for its turn instead of failing half way.
"""

import time
from collections.abc import Collection
from contextlib import AbstractContextManager
from itertools import chain
from pathlib import Path
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Float,
    create_engine,
    event,
    insert,
    inspect,
    literal,
    select,
    update,
)

from .errors import StartError
from .tables import MIGRATIONS, SCHEMA_VERSION, metadata, schema_version

BUSY_MILLISECONDS = 10_000


class Database:
    """One database file, opened; made on first use."""

    def __init__(self, path: Path):
        self._engine = create_engine(
            f"sqlite+pysqlite:///{path}", pool_size=5, max_overflow=50, pool_timeout=30
        )
        event.listen(self._engine, "connect", _prepare)
        event.listen(self._engine, "begin", _begin)
        self._writer = self._engine.execution_options(writing=True)
        try:
            with self.writing() as connection:
                _check_schema(connection, path)
        except BaseException:
            self.close()
            raise

    def reading(self) -> AbstractContextManager[Connection]:
        """Transaction that sees one state of the database and changes nothing."""
        return self._engine.begin()

    def writing(self) -> AbstractContextManager[Connection]:
        """Transaction that commits durably at its end, or leaves no trace."""
        return self._writer.begin()

    def lock(self, connection: Connection, names: Collection[str]) -> None:
        """Hold what the names stand for to the end of a writing transaction.

        Here nobody else can write before that anyway.
        """

    @property
    def now(self) -> ColumnElement[float]:
        """The time, in a statement, by the clock that all who use the database share."""
        return literal(time.time(), Float)

    def close(self) -> None:
        """Close every connection."""
        self._engine.dispose()


def _prepare(connection: Any, _: Any) -> None:
    connection.isolation_level = None
    for pragma in (
        "journal_mode=WAL",
        "synchronous=FULL",
        f"busy_timeout={BUSY_MILLISECONDS}",
        "foreign_keys=ON",
    ):
        connection.execute(f"PRAGMA {pragma}").close()


def _begin(connection: Connection) -> None:
    writing = connection.get_execution_options().get("writing", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")


def _check_schema(connection: Connection, path: Path) -> None:
    if not inspect(connection).has_table(schema_version.name):
        metadata.create_all(connection)
        connection.execute(insert(schema_version).values(version=SCHEMA_VERSION))
    version = connection.execute(select(schema_version.c.version)).scalar_one()
    if 1 <= version < SCHEMA_VERSION:
        metadata.create_all(connection)
        for statement in chain.from_iterable(MIGRATIONS[version - 1 :]):
            connection.exec_driver_sql(statement)
        connection.execute(update(schema_version).values(version=SCHEMA_VERSION))
    elif version != SCHEMA_VERSION:
        raise StartError(
            f"The database {path} has schema version {version}, this ridetune needs "
            f"{SCHEMA_VERSION}; use the ridetune that wrote it, or another --data directory."
        )
