"""The folder that holds everything the service keeps, owned by one process at a time.

    owner.lock          locked while a service runs; says which process that is
    ridetune.sqlite     the database
    originals/ab/...    uploads, byte for byte, and what jobs made, each under its SHA-256
    reading/            uploads that a child reads, and the folders that children work in
    dask/               scratch space of the job workers

An original is written beside its place, flushed, renamed and the folder flushed, so that after a
power cut it is there whole or not at all. The kernel drops the lock with the process, however it
ended.
"""

import fcntl
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

from .errors import StartError


class DataDirectory:
    """The folder, once locked; `close` gives it up."""

    def __init__(self, path: Path):
        self.path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
            self.originals = path / "originals"
            self.originals.mkdir(exist_ok=True)
            self._lock = os.open(path / "owner.lock", os.O_RDWR | os.O_CREAT, 0o600)
        except OSError as error:
            raise StartError(
                f"The data directory {path} cannot be used ({error.strerror}); "
                "choose another with --data."
            ) from None
        self._own()

    def _own(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            owner = os.read(self._lock, 20).decode(errors="replace").strip() or "unknown"
            os.close(self._lock)
            raise StartError(
                f"The data directory {self.path} is in use by another ridetune (process {owner}); "
                "stop that one or choose another directory with --data."
            ) from None
        os.ftruncate(self._lock, 0)
        os.pwrite(self._lock, f"{os.getpid()}\n".encode(), 0)

    @property
    def database(self) -> Path:
        """Place of the database file."""
        return self.path / "ridetune.sqlite"

    @property
    def scratch(self) -> Path:
        """Place for the job workers' temporary files."""
        return self.path / "dask"

    @property
    def reading(self) -> Path:
        """Place for what is needed while a file is read."""
        return self.path / "reading"

    def original(self, sha256: str) -> Path:
        """Place of an original."""
        return self.originals / sha256[:2] / sha256

    def keep(self, sha256: str, data: bytes) -> None:
        """Write an original so that it survives a power cut, unless it is there."""
        place = self.original(sha256)
        if place.exists():
            return
        place.parent.mkdir(exist_ok=True)
        beside = place.with_suffix(f".{secrets.token_hex(4)}.tmp")
        try:
            with open(beside, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.replace(beside, place)
        except OSError:
            beside.unlink(missing_ok=True)
            raise
        for folder in (place.parent, self.originals):
            _flush_folder(folder)

    def names(self) -> Iterator[str]:
        """The originals by their SHA-256, and what was written of some."""
        return (file.name for file in self.originals.glob("*/*"))

    def drop(self, name: str) -> None:
        """Remove one of them."""
        self.original(name).unlink(missing_ok=True)

    def sweep(self) -> None:
        """Remove what was being read in a crash."""
        shutil.rmtree(self.reading, ignore_errors=True)
        self.reading.mkdir(exist_ok=True)

    def close(self) -> None:
        """Give up the folder."""
        os.close(self._lock)


def _flush_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
