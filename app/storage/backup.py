"""One file with everything that a service keeps, made while it runs.

A backup is a ZIP archive:

    ridetune.sqlite       the rows as they were at one moment, whichever database they are from
    originals/ab/...      the files to which they refer, each under its SHA-256
    backup.json           what this is, the schema's version, size and SHA-256 of each file

Originals never change, but may be deleted while they are copied; what was deleted by then is left
out as if it had been deleted before.
"""

import hashlib
import json
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO
from zipfile import ZIP_DEFLATED, ZipFile

from sqlalchemy import Connection, delete, func, insert, select

from ..errors import BackupError
from ..settings import Settings
from .data_directory import DATABASE, check_owner, usable
from .database import Database
from .originals import place_of_original
from .postgresql import PostgresqlDatabase
from .sqlite import SqliteDatabase
from .tables import (
    SCHEMA_VERSION,
    database_identity,
    job_files,
    job_parts,
    jobs,
    measurements,
    metadata,
    schema_version,
    sessions,
    uploads,
)

KIND, FORMAT = "ridetune-backup", 1
MANIFEST = "backup.json"
ORIGINALS = "originals"
CHUNK = 1 << 20
ROWS = 500
QUICK = 1
"""Level of compression; more takes several times as long for a tenth less."""


@dataclass(frozen=True)
class Kept:
    """How much a backup holds."""

    sessions: int
    measurements: int
    jobs: int
    files: int
    bytes: int


def back_up(settings: Settings, stream: BinaryIO) -> Kept:
    """Write a backup of what a service with these settings keeps, whether it runs or not."""
    with TemporaryDirectory(prefix="ridetune-backup-") as folder:
        copy = Path(folder) / DATABASE
        with (
            _copied(settings, copy) as still_kept,
            closing(SqliteDatabase(copy)) as rows,
            ZipFile(stream, "w", ZIP_DEFLATED, compresslevel=QUICK) as archive,
        ):
            files = _originals(settings.data, archive, rows, still_kept)
            kept = counted(rows)
            # Its pages are all in the one file once it is closed.
            rows.close()
            files[DATABASE] = _add(archive, DATABASE, copy)
            manifest = {
                "kind": KIND,
                "format": FORMAT,
                "schema_version": SCHEMA_VERSION,
                "ridetune": version("ridetune"),
                "made": datetime.now(UTC).isoformat(timespec="seconds"),
                "files": files,
            }
            archive.writestr(MANIFEST, json.dumps(manifest, indent=1))
    return kept


def copy_rows(source: Connection, target: Connection) -> None:
    """Every row of one database into an empty one."""
    for table in metadata.sorted_tables:
        if table in (schema_version, database_identity):
            continue
        found = source.execution_options(yield_per=ROWS).execute(select(table))
        for some in found.mappings().partitions():
            target.execute(insert(table), [_keepable(row) for row in some])


def counted(database: Database) -> Kept:
    """What the rows of a database come to."""
    size = func.coalesce(func.sum(uploads.c.bytes), 0)
    with database.reading() as connection:
        numbers = [
            int(connection.execute(select(number)).scalar_one())
            for number in (
                *(
                    select(func.count()).select_from(table).scalar_subquery()
                    for table in (sessions, measurements, jobs, uploads)
                ),
                select(size).scalar_subquery(),
            )
        ]
    return Kept(*numbers)


def _keepable(row: Mapping[Any, Any]) -> dict[str, Any]:
    """PostgreSQL keeps no NUL, which SQLite does."""
    return {
        name: value.replace("\0", "\ufffd") if isinstance(value, str) else value
        for name, value in row.items()
    }


@contextmanager
def _copied(settings: Settings, copy: Path) -> Iterator[Callable[[str], bool]]:
    """Copy the rows of one moment; gives whether an original has its row in the source still."""
    if settings.database:
        with closing(PostgresqlDatabase(settings.database, made=True)) as database:
            with usable(settings.data):
                check_owner(settings.data, database.id)
            with (
                closing(SqliteDatabase(copy)) as rows,
                database.reading() as source,
                rows.writing() as target,
            ):
                copy_rows(source, target)

            def still_kept(sha256: str) -> bool:
                with database.reading() as connection:
                    row = select(uploads.c.sha256).where(uploads.c.sha256 == sha256)
                    return connection.execute(row).one_or_none() is not None

            yield still_kept
        return
    place = settings.data / DATABASE
    with usable(settings.data):
        check_owner(settings.data, None)
        there = place.is_file()
    if not there:
        raise BackupError(f"There is no {DATABASE} in the directory {settings.data}; see --data.")
    try:
        with closing(sqlite3.connect(place, timeout=10.0)) as source:
            with closing(sqlite3.connect(copy)) as target:
                source.backup(target)

            def row_is_there(sha256: str) -> bool:
                row = source.execute("SELECT 1 FROM uploads WHERE sha256 = ?", [sha256])
                return row.fetchone() is not None

            yield row_is_there
    except sqlite3.Error as error:
        raise BackupError(f"The database {place} cannot be copied ({error}).") from None


def _originals(
    data: Path, archive: ZipFile, rows: Database, still_kept: Callable[[str], bool]
) -> dict[str, dict[str, Any]]:
    with rows.reading() as connection:
        names = connection.execute(select(uploads.c.sha256).order_by(uploads.c.sha256))
        wanted = names.scalars().all()
    files, deleted = {}, []
    for sha256 in wanted:
        place = place_of_original(data, sha256)
        try:
            added = _add(archive, f"{ORIGINALS}/{sha256[:2]}/{sha256}", place)
        except FileNotFoundError:
            if still_kept(sha256):
                raise BackupError(
                    f"{place} is missing, though a measurement or job of the database has it; see "
                    "that --data is the directory that belongs to the database."
                ) from None
            deleted.append(sha256)
            continue
        except OSError as error:
            raise BackupError(f"{place} cannot be read ({error.strerror}).") from None
        if added["sha256"] != sha256:
            raise BackupError(
                f"{place} is damaged: it is not what its name says; put it back from an earlier "
                "backup, or delete the measurement or job that has it."
            )
        files[f"{ORIGINALS}/{sha256[:2]}/{sha256}"] = added
    for sha256 in deleted:
        _delete(rows, sha256)
    return files


def _add(archive: ZipFile, name: str, place: Path) -> dict[str, Any]:
    """Put a file into the archive; what the manifest says of it."""
    made, size = hashlib.sha256(), 0
    with place.open("rb") as source, archive.open(name, "w", force_zip64=True) as target:
        while chunk := source.read(CHUNK):
            made.update(chunk)
            size += len(chunk)
            target.write(chunk)
    return {"sha256": made.hexdigest(), "bytes": size}


def _delete(rows: Database, sha256: str) -> None:
    """What went together with a file."""
    with rows.writing() as connection:
        made_it = select(job_files.c.job).where(job_files.c.sha256 == sha256)
        connection.execute(delete(jobs).where(jobs.c.id.in_(made_it)))
        for table in (measurements, job_parts, uploads):
            connection.execute(delete(table).where(table.c.sha256 == sha256))
