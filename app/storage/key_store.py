"""API keys of programs: shown once, kept as hashes, ended by removing them."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from sqlalchemy import delete, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from ..errors import Conflict, InvalidRequest, NotFound, Unavailable
from .database import Database
from .secret import hashed, new_secret
from .tables import keys

PREFIX = "rt_"
NAME_LENGTH = 100
USED_EVERY = 60.0
"""How exactly it is known when a key was used last, s."""


@dataclass(frozen=True)
class Key:
    """What is known of a key; `begins` tells which it is, and opens nothing."""

    name: str
    begins: str
    created: float
    used: float | None


class KeyStore:
    """The keys, each by its name."""

    def __init__(self, database: Database, removed: Callable[[], None] = lambda: None):
        """removed : called once a key has been ended"""
        self._database = database
        self._removed = removed

    def add(self, name: str) -> str:
        """A new key, which cannot be shown again."""
        if not name.isprintable() or not 0 < len(name.strip()) <= NAME_LENGTH:
            raise InvalidRequest(
                f"A key's name has 1 to {NAME_LENGTH} printable characters; give another."
            )
        key = PREFIX + new_secret()
        row = {"name": name, "hash": hashed(key), "begins": key[:9], "created": time.time()}
        try:
            with self._database.writing() as connection:
                connection.execute(insert(keys).values(row))
        except IntegrityError:
            raise Conflict(
                f"There is a key {name!r} already; remove it first, or give another name."
            ) from None
        return key

    def list(self) -> list[Key]:
        """All keys, oldest first."""
        columns = (keys.c.name, keys.c.begins, keys.c.created, keys.c.used)
        with self._database.reading() as connection:
            rows = connection.execute(select(*columns).order_by(keys.c.created)).all()
        return [Key(*row) for row in rows]

    def remove(self, name: str) -> None:
        """End a key; what it made stays, and is of the next key of that name."""
        with self._database.writing() as connection:
            gone = connection.execute(delete(keys).where(keys.c.name == name)).rowcount
        if not gone:
            raise NotFound(f"There is no key {name!r}; `ridetune keys list` shows those there are.")
        self._removed()

    def any(self) -> bool:
        """Whether there is a key."""
        with self._database.reading() as connection:
            return connection.execute(select(func.count()).select_from(keys)).scalar_one() > 0

    def name_of(self, key: str) -> str | None:
        """Name of a key, None of what is none; notes that it is in use."""
        if not key.startswith(PREFIX):
            return None
        now, ours = time.time(), keys.c.hash == hashed(key)
        with self._database.reading() as connection:
            row = connection.execute(select(keys.c.name, keys.c.used).where(ours)).one_or_none()
        if row is None:
            return None
        if row.used is None or row.used < now - USED_EVERY:
            # Where nothing can be written, what is kept may still be looked at.
            with suppress(Unavailable), self._database.writing() as connection:
                connection.execute(update(keys).where(ours).values(used=now))
        return row.name
