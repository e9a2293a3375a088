"""The database through SQLAlchemy Core: durable commits, a checked schema, troubles in a sentence.

Which database it is, and what is particular of it, is in `sqlite` and `postgresql`.
"""

import logging
import secrets
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from itertools import chain

from sqlalchemy import (
    ColumnElement,
    Connection,
    Engine,
    insert,
    inspect,
    select,
    update,
)
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as NoneFree

from ..errors import ServiceError, StartError, Unavailable
from .tables import MIGRATIONS, SCHEMA_VERSION, database_identity, metadata, schema_version

log = logging.getLogger(__name__)


class Database(ABC):
    """One database, opened; made on first use, brought up to date where it is older.

    id : stands for it, wherever it is moved
    shared : whether several services may use it at once
    """

    shared: bool

    def __init__(self, name: str, reader: Engine, writer: Engine, *, made: bool = False):
        """made : whether it has to be there already as this ridetune needs it"""
        self._reader = reader
        self._writer = writer
        self._troubled = False
        self.errors = 0
        """How many transactions have failed by the database."""
        try:
            with self.reading() if made else self.writing() as connection:
                if not made:
                    self.lock(connection, {"schema"})
                    _make_schema(connection)
                _check_schema(connection, name)
                self.id = connection.execute(select(database_identity.c.id)).scalar_one()
        except ServiceError as error:
            self.close()
            raise StartError(str(error)) from None
        except BaseException:
            self.close()
            raise

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """Transaction that sees one state of the database and changes nothing."""
        with self._in_a_sentence(), self._reader.begin() as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """Transaction that commits durably at its end, or leaves no trace."""
        with self._in_a_sentence(), self._writer.begin() as connection:
            yield connection
        if self._troubled:
            self._troubled = False
            log.warning("The service's database takes changes again.")

    @abstractmethod
    def lock(self, connection: Connection, names: Collection[str]) -> None:
        """Hold what the names stand for, against every service, to the end of a writing
        transaction.
        """

    @property
    @abstractmethod
    def now(self) -> ColumnElement[float]:
        """The time, in a statement, by the clock that all who use the database share."""

    @abstractmethod
    def trouble(self, error: DBAPIError) -> ServiceError | None:
        """What an error of the driver means to a person, None where it is a fault of ours."""

    def close(self) -> None:
        """Close every connection."""
        self._reader.dispose()
        self._writer.dispose()

    @contextmanager
    def _in_a_sentence(self) -> Iterator[None]:
        """Neither reply nor log repeats what a driver says: it may name hosts and users."""
        try:
            yield
        except NoneFree:
            raise Unavailable(
                "Too many requests wait for the database; try again shortly.", retry_after=5
            ) from None
        except DBAPIError as error:
            self.errors += 1
            if (trouble := self.trouble(error)) is None:
                raise
            if isinstance(trouble, Unavailable) and not self._troubled:
                self._troubled = True
                log.warning("%s", trouble)
            raise trouble from None


def _make_schema(connection: Connection) -> None:
    """Make the tables, or bring those of an earlier version up to date."""
    if not inspect(connection).has_table(schema_version.name):
        metadata.create_all(connection)
        connection.execute(insert(schema_version).values(version=SCHEMA_VERSION))
    version = connection.execute(select(schema_version.c.version)).scalar_one()
    if 1 <= version < SCHEMA_VERSION:
        lacking = metadata.tables.keys() - set(inspect(connection).get_table_names())
        metadata.create_all(connection)
        for statement in chain.from_iterable(MIGRATIONS[version - 1 :]):
            # What has just been made whole (ALTER TABLE name ...) has its new columns.
            if statement.split()[2] not in lacking:
                connection.exec_driver_sql(statement)
        connection.execute(update(schema_version).values(version=SCHEMA_VERSION))
    if version <= SCHEMA_VERSION and not connection.execute(select(database_identity.c.id)).all():
        connection.execute(insert(database_identity).values(id=secrets.token_hex(16)))


def _check_schema(connection: Connection, name: str) -> None:
    known = inspect(connection).has_table(schema_version.name)
    version = known and connection.execute(select(schema_version.c.version)).scalar_one()
    if version != SCHEMA_VERSION:
        has = f"has schema version {version}" if known else "is empty"
        raise StartError(
            f"{name} {has}, this ridetune needs {SCHEMA_VERSION}; use the ridetune that wrote it, "
            "or another --data directory."
        )
