"""The folder that holds what the service keeps: of one process, or of those that share a database.

    address             where the service was found last
    owner.lock          locked while a service runs; says which process that is
    ridetune.sqlite     the database, and in its place
    postgresql.id       which PostgreSQL database has the rows of these files
    originals/ab/...    uploads, byte for byte, and what jobs made, each under its SHA-256
    reading/            uploads that a child reads, and the folders that children work in
    dask/               scratch space of the job workers

The kernel drops the lock with the process, however it ended.
"""

import contextlib
import errno
import fcntl
import math
import os
import secrets
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

from ..errors import StartError
from .originals import Originals, flush, write

DATABASE = "ridetune.sqlite"
MARK = "postgresql.id"


class DataDirectory(Originals):
    """The folder, once it is clear whose it is; `close` gives it up.

    database : id of the PostgreSQL database whose services share the folder; None where one
        service owns it, which locks it
    """

    def __init__(self, path: Path, database: str | None = None):
        super().__init__(path)
        self._lock: int | None = None
        with usable(path):
            check_owner(path, database)
            make_private(path)
            self.originals.mkdir(exist_ok=True)
            self.reading.mkdir(exist_ok=True)
            if not os.access(self.originals, os.W_OK):
                raise PermissionError(errno.EACCES, "it may not be written")
            if database is not None:
                self._join(database)
                return
            self._lock = os.open(path / "owner.lock", os.O_RDWR | os.O_CREAT, 0o600)
        self._own(self._lock)

    def _join(self, database: str) -> None:
        """Claim the folder, unless another database was first."""
        if not self._mark.exists():
            beside = self._mark.with_suffix(f".{secrets.token_hex(4)}.tmp")
            write(beside, f"{database}\n".encode())
            os.replace(beside, self._mark)
            flush(self.path)
        check_owner(self.path, database)

    def _own(self, lock: int) -> None:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            owner = os.read(lock, 20).decode(errors="replace").strip() or "unknown"
            os.close(lock)
            raise StartError(
                f"The data directory {self.path} is in use by another ridetune (process {owner}); "
                "stop that one or choose another directory with --data."
            ) from None
        os.ftruncate(lock, 0)
        os.pwrite(lock, f"{os.getpid()}\n".encode(), 0)

    @property
    def _mark(self) -> Path:
        return self.path / MARK

    @property
    def database(self) -> Path:
        """Place of the database file."""
        return database_of(self.path)

    @property
    def scratch(self) -> Path:
        """Place for the job workers' temporary files."""
        return self.path / "dask"

    @property
    def reading(self) -> Path:
        """Place for what is needed while a file is read."""
        return self.path / "reading"

    def sweep(self, older: float = -math.inf) -> None:
        """Remove what was being read when a service crashed: what is so old, s."""
        for left in self.reading.iterdir():
            with contextlib.suppress(OSError):
                if time.time() - left.lstat().st_mtime < older:
                    continue
                if left.is_dir() and not left.is_symlink():
                    shutil.rmtree(left, ignore_errors=True)
                else:
                    left.unlink()

    def close(self) -> None:
        """Give up the folder."""
        if self._lock is not None:
            os.close(self._lock)


@contextlib.contextmanager
def usable(path: Path) -> Iterator[None]:
    """Where a data directory cannot be had, that is a sentence."""
    try:
        yield
    except OSError as error:
        raise StartError(
            f"The data directory {path} cannot be used ({error.strerror}); "
            "choose another with --data."
        ) from None


def check_owner(path: Path, database: str | None) -> None:
    """Refuse a folder of another database than the PostgreSQL one of this id, or, None, its own
    SQLite one: everything in it would look left over.
    """
    mark = path / MARK
    owner = mark.read_text().strip() if mark.exists() else None
    if owner is None and database is not None and database_of(path).exists():
        raise StartError(
            f"The data directory {path} holds an SQLite database; take it over with ridetune "
            "backup and restore, and choose another directory with --data."
        )
    if owner is not None and database is None:
        raise StartError(
            f"The data directory {path} belongs to a PostgreSQL database; name it in "
            "RIDETUNE_DATABASE, or choose another directory with --data."
        )
    if owner is not None and owner != database:
        raise StartError(
            f"The data directory {path} belongs to another PostgreSQL database; choose another "
            "one with --data, or name its own in RIDETUNE_DATABASE."
        )


def database_of(path: Path) -> Path:
    """Place of the database in a data directory."""
    return path / DATABASE


def is_used(path: Path) -> bool:
    """Whether a data directory is some database's."""
    return database_of(path).exists() or (path / MARK).exists()


def make_private(path: Path) -> None:
    """Make a data directory; other users of the machine do not look into a new one."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
