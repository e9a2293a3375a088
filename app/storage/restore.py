"""A backup into an empty data directory, and an empty database where that is PostgreSQL.

Everything is checked before anything is written, and what was written is taken back where the rest
cannot be.
"""

import hashlib
import json
import os
import re
import shutil
import struct
import zlib
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import BadZipFile, ZipFile

from sqlalchemy import select
from sqlalchemy.exc import IntegrityError

from ..errors import BackupError
from ..settings import Settings
from .backup import CHUNK, FORMAT, KIND, MANIFEST, ORIGINALS, Kept, copy_rows, counted
from .data_directory import DATABASE, MARK, DataDirectory, usable
from .database import Database
from .originals import flush
from .postgresql import PostgresqlDatabase
from .sqlite import SqliteDatabase
from .tables import SCHEMA_VERSION, uploads

NAME = re.compile(rf"{ORIGINALS}/([0-9a-f]{{2}})/(\1[0-9a-f]{{62}})|{re.escape(DATABASE)}")
LONGEST_MANIFEST = 200_000_000
IN_USE = "The database of RIDETUNE_DATABASE is not empty; a backup is restored into a fresh one."
UNREADABLE = (
    *(BadZipFile, EOFError, NotImplementedError, OSError, RuntimeError, ValueError),
    *(struct.error, zlib.error),
)
"""What reading a damaged archive may raise."""


def restore(path: Path, settings: Settings) -> Kept:
    """Restore a backup into a target that is empty; `BackupError` with nothing changed where that
    cannot be.
    """
    _require_empty(settings)
    with _opened(path) as archive, TemporaryDirectory(prefix="ridetune-restore-") as folder:
        files = _manifest(archive, path)["files"]
        copy = Path(folder) / DATABASE
        for name, told in files.items():
            _check(archive, path, name, told, copy if name == DATABASE else None)
        # Opened once, it has today's schema.
        with closing(SqliteDatabase(copy)) as rows:
            kept = counted(rows)
            with rows.reading() as connection:
                wanted = set(connection.execute(select(uploads.c.sha256)).scalars())
            held = {Path(name).name for name in files} - {DATABASE}
            if wanted != held:
                raise _damaged(path, "its rows and its files are not of one backup")
            if settings.database:
                with _unclaimed_again(settings.data):
                    _to_postgresql(archive, files, rows, settings)
                return kept
        with (
            _unclaimed_again(settings.data),
            closing(DataDirectory(settings.data)) as directory,
            _all_or_none(directory) as put,
        ):
            put(archive, files)
            _move(copy, directory.database)
    return kept


def _to_postgresql(
    archive: ZipFile, files: dict[str, Any], rows: Database, settings: Settings
) -> None:
    with closing(PostgresqlDatabase(settings.database)) as database:
        if any(vars(counted(database)).values()):
            raise BackupError(IN_USE)
        directory = DataDirectory(settings.data, database.id)
        with _all_or_none(directory) as put:
            put(archive, files)
            try:
                with rows.reading() as source, database.writing() as target:
                    copy_rows(source, target)
            except IntegrityError:  # by a key, or by whoever was let in
                raise BackupError(IN_USE) from None


def _require_empty(settings: Settings) -> None:
    data = settings.data
    in_the_way = [DATABASE] if settings.database else [DATABASE, MARK]
    with usable(data):
        held = any((data / name).exists() for name in in_the_way)
        held = held or any(data.glob(f"{ORIGINALS}/*/*"))
    if held:
        raise BackupError(
            f"The directory {data} holds data already; a backup is restored into an empty one, "
            "named with --data."
        )


@contextmanager
def _opened(path: Path) -> Iterator[ZipFile]:
    try:
        archive = ZipFile(path)
    except (FileNotFoundError, IsADirectoryError, PermissionError) as error:
        raise BackupError(f"{path} cannot be read ({error.strerror}).") from None
    except UNREADABLE:
        raise _damaged(path, "it is no backup, or cut off") from None
    with archive:
        yield archive


def _manifest(archive: ZipFile, path: Path) -> dict[str, Any]:
    """What the archive says of itself, once it agrees with what is in it."""
    inside = archive.namelist()
    if MANIFEST not in inside or archive.getinfo(MANIFEST).file_size > LONGEST_MANIFEST:
        raise BackupError(f"{path} is no backup that ridetune backup has made.")
    try:
        manifest = json.loads(archive.read(MANIFEST))
        kind, version = manifest["kind"], (manifest["format"], manifest["schema_version"])
        files = {name: (told["sha256"], told["bytes"]) for name, told in manifest["files"].items()}
    except (*UNREADABLE, KeyError, TypeError, AttributeError):
        raise _damaged(path, f"its {MANIFEST} cannot be read") from None
    if kind != KIND:
        raise BackupError(f"{path} is no backup that ridetune backup has made.")
    if version[0] != FORMAT or not 1 <= version[1] <= SCHEMA_VERSION:
        raise BackupError(
            f"{path} was made by ridetune {manifest.get('ridetune')}, which is newer; restore it "
            "with that or a later one."
        )
    if sorted(inside) != sorted([*files, MANIFEST]) or DATABASE not in files:
        raise _damaged(path, f"what is in it is not what its {MANIFEST} lists")
    for name in files:
        if not NAME.fullmatch(name):
            raise _damaged(path, "it has a file that no backup has")
    return manifest


def _check(
    archive: ZipFile, path: Path, name: str, told: dict[str, Any], target: Path | None
) -> None:
    """Compare one file with what the manifest says of it; write it to the target on the way."""
    made, size = hashlib.sha256(), 0
    with open(target or os.devnull, "wb") as written:
        for chunk in _chunks(archive, path, name):
            made.update(chunk)
            size += len(chunk)
            written.write(chunk)
            if size > told["bytes"]:
                break
    expected = {told["sha256"]} if name == DATABASE else {told["sha256"], Path(name).name}
    if size != told["bytes"] or {made.hexdigest()} != expected:
        raise _damaged(path, f"{name} is not what it was")


def _chunks(archive: ZipFile, path: Path, name: str) -> Iterator[bytes]:
    try:
        with archive.open(name) as source:
            while chunk := source.read(CHUNK):
                yield chunk
    except UNREADABLE:
        raise _damaged(path, f"{name} cannot be read") from None


@contextmanager
def _unclaimed_again(data: Path) -> Iterator[None]:
    """On an error what was made of a data directory goes, so that any database may have it."""
    names = (MARK, "owner.lock", ORIGINALS, "reading", "")
    made = [data / name for name in names if not (data / name).exists()]
    try:
        yield
    except BaseException:
        for place in made:
            with suppress(OSError):
                if place.name == ORIGINALS:
                    shutil.rmtree(place)
                elif place.is_dir():
                    place.rmdir()
                else:
                    place.unlink()
        raise


@contextmanager
def _all_or_none(directory: DataDirectory) -> Iterator[Any]:
    """Gives what puts an archive's originals into a directory, from which they go on an error."""
    kept: list[str] = []

    def put(archive: ZipFile, files: dict[str, Any]) -> None:
        for name in files:
            if name != DATABASE:
                kept.append(Path(name).name)
                directory.keep(kept[-1], archive.read(name))

    try:
        yield put
    except BaseException as error:
        for sha256 in kept:
            directory.drop(sha256)
        if isinstance(error, OSError):
            raise BackupError(
                f"The directory {directory.path} cannot be written ({error.strerror}); choose "
                "another with --data."
            ) from None
        raise


def _move(copy: Path, place: Path) -> None:
    """A database to its place, durably, whole or not at all."""
    beside = place.with_suffix(".tmp")
    try:
        shutil.copyfile(copy, beside)
        flush(beside)
        os.replace(beside, place)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
    flush(place.parent)


def _damaged(path: Path, how: str) -> BackupError:
    return BackupError(f"{path} is damaged: {how}; nothing was restored, take another backup.")
