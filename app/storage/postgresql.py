"""PostgreSQL by URL, which several services may share.

Writing transactions are READ COMMITTED and lock what they decide by: the row of a session, jobs,
and by advisory locks what has no row. Commits wait for the disk whatever the server's default is.
"""

import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from sqlalchemy import (
    URL,
    ColumnElement,
    Connection,
    Float,
    cast,
    create_engine,
    event,
    extract,
    func,
    make_url,
    select,
)
from sqlalchemy.exc import ArgumentError, DataError, DBAPIError

from ...engine.extras import how_to_install
from ..errors import InvalidRequest, NotFound, ServiceError, StartError, StorageFull, Unavailable
from .database import Database

NAMESPACE = 0x72696465
"""Of the advisory locks; they hold within one database."""
CONNECTING = {
    "application_name": "ridetune",
    "connect_timeout": 5,
    # A server that is cut off is noticed within a quarter of a minute.
    "keepalives_idle": 5,
    "keepalives_interval": 5,
    "keepalives_count": 2,
    "tcp_user_timeout": 15_000,
}
SETTINGS = (
    "synchronous_commit = on",
    "lock_timeout = '10s'",
    # What a service that hangs holds is let go.
    "idle_in_transaction_session_timeout = '60s'",
)
REACH = (
    "The service's database cannot be reached, or refuses it; see that PostgreSQL runs there and"
    " that the host, user, password and name in RIDETUNE_DATABASE are right, then try again."
)
MISUSED = (
    "RIDETUNE_DATABASE is not the address of a PostgreSQL database; write it like"
    " postgresql://user@host/name, or leave it empty for SQLite in the data directory."
)


class Unkeepable(InvalidRequest):
    """A text that PostgreSQL does not take."""


class PostgresqlDatabase(Database):
    """A database of a server."""

    shared = True

    def __init__(self, url: str, *, made: bool = False):
        address = _address(url)
        if not find_spec("psycopg"):
            raise StartError(
                f"A PostgreSQL database needs psycopg; {how_to_install('postgresql')}."
            )
        engine = create_engine(
            address,
            connect_args={name: CONNECTING[name] for name in CONNECTING.keys() - address.query},
            isolation_level="READ COMMITTED",
            pool_size=5,
            max_overflow=15,
            pool_timeout=10,
            pool_pre_ping=True,
            hide_parameters=True,
        )
        event.listen(engine, "connect", _prepare)
        snapshot = engine.execution_options(
            isolation_level="REPEATABLE READ", postgresql_readonly=True
        )
        super().__init__("The database of RIDETUNE_DATABASE", snapshot, engine, made=made)

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """See `Database.reading`; nothing is found by a text that cannot be kept."""
        try:
            with super().reading() as connection:
                yield connection
        except Unkeepable:
            raise NotFound("There is nothing by that name.") from None

    def lock(self, connection: Connection, names: Collection[str]) -> None:
        """By advisory locks, in one order so that nobody waits in a circle."""
        for key in sorted({zlib.crc32(name.encode()) for name in names}):
            connection.execute(select(func.pg_advisory_xact_lock(NAMESPACE, key - 2**31)))

    @property
    def now(self) -> ColumnElement[float]:
        """By the server's clock."""
        return cast(extract("epoch", func.clock_timestamp()), Float)

    def trouble(self, error: DBAPIError) -> ServiceError | None:
        """By PostgreSQL's SQLSTATE; it has none where the connection was lost."""
        if isinstance(error, DataError):
            return Unkeepable("The request has a text that cannot be kept: too long, or with NUL.")
        state = getattr(error.orig, "sqlstate", None) or ""
        if error.connection_invalidated or not state or state[:2] in ("08", "28", "3D", "57"):
            return Unavailable(REACH, retry_after=5)
        match state:
            case "53100":
                return StorageFull()
            case "53300":
                return Unavailable(
                    "The service's database takes no more connections; raise its max_connections "
                    "or run fewer services, then try again.",
                    retry_after=5,
                )
            case "25006":
                return Unavailable(
                    "The service's database takes no changes, as a standby does; name the primary "
                    "in RIDETUNE_DATABASE, then try again.",
                    retry_after=5,
                )
            case "42501":
                return Unavailable(
                    "The service's user may not use its database, or make tables in it; make it "
                    "the owner of the database, then try again.",
                    retry_after=30,
                )
            case "55P03" | "40P01" | "40001" | "25P03":
                return Unavailable(
                    "What the request changes is held by others for too long; try again.",
                    retry_after=1,
                )
        return None


def _address(url: str) -> URL:
    try:
        address = make_url(url)
    except (ArgumentError, ValueError):
        raise StartError(MISUSED) from None
    if address.drivername not in ("postgresql", "postgres") or not address.database:
        raise StartError(MISUSED)
    return address.set(drivername="postgresql+psycopg")


def _prepare(connection: Any, _: Any) -> None:
    connection.execute("; ".join(f"SET {setting}" for setting in SETTINGS))
    connection.commit()
