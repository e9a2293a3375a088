"""Files that are kept as they came, or as jobs made them, each under its SHA-256.

An original is written beside its place, flushed, renamed and the folder flushed, so that after a
power cut it is there whole or not at all.
"""

import os
import secrets
from collections.abc import Iterator
from pathlib import Path


class Originals:
    """Those of a data directory; who owns that is another matter (data_directory.py)."""

    def __init__(self, path: Path):
        self.path = path
        self.originals = path / "originals"

    def original(self, sha256: str) -> Path:
        """Place of an original."""
        return place_of_original(self.path, sha256)

    def lacks(self, sha256: str) -> bool:
        """Whether an original is not there, although others are; OSError where nobody can tell."""
        return not self.original(sha256).exists() and any(self.originals.iterdir())

    def keep(self, sha256: str, data: bytes) -> None:
        """Write an original so that it survives a power cut, unless it is there."""
        place = self.original(sha256)
        if place.exists():
            return
        place.parent.mkdir(exist_ok=True)
        beside = place.with_suffix(f".{secrets.token_hex(4)}.tmp")
        try:
            write(beside, data)
            os.replace(beside, place)
        except OSError:
            beside.unlink(missing_ok=True)
            raise
        for folder in (place.parent, self.originals):
            flush(folder)

    def names(self) -> Iterator[str]:
        """The originals by their SHA-256, and what was written of some."""
        return (file.name for file in self.originals.glob("*/*"))

    def drop(self, name: str) -> None:
        """Remove one of them."""
        self.original(name).unlink(missing_ok=True)


def place_of_original(data: Path, sha256: str) -> Path:
    """Place of an original in a data directory."""
    return data / "originals" / sha256[:2] / sha256


def write(place: Path, data: bytes) -> None:
    """Write a file and wait until it is on the disk."""
    with open(place, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def flush(place: Path) -> None:
    """Wait until a file or a folder is on the disk."""
    descriptor = os.open(place, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
