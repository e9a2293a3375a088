"""Where measurements are kept: rows of the database, and their originals on disk."""

import json
import secrets
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Row, delete, func, insert, select, update

from ..errors import Busy, Conflict, Deleted, NotFound, Unavailable
from ..limits import Limits
from .data_directory import DataDirectory
from .database import Database
from .disk_errors import OUT_OF_ORDER, files_in_a_sentence
from .file_store import FileStore
from .job_store import JobStore
from .measurement import Measurement, NewMeasurement
from .session_row import lock_session, mark_used
from .tables import measurements, uploads

ABSENT = "There is no measurement with that id in this session."


class MeasurementStore:
    """The measurements of all sessions; their originals stay on disk."""

    def __init__(
        self,
        database: Database,
        directory: DataDirectory,
        limits: Limits,
        files: FileStore,
        jobs: JobStore,
    ):
        self._database = database
        self._directory = directory
        self._limits = limits
        self._files = files
        self._jobs = jobs

    def add(self, session: str, new: NewMeasurement) -> Measurement:
        """Keep an original and what was found in it; `Busy` where the session is full."""
        return self.add_all(session, [new])[0]

    def add_all(self, session: str, new: Sequence[NewMeasurement]) -> list[Measurement]:
        """Keep all of them in their order, or `Busy` and none."""
        with self._database.writing() as connection:
            lock_session(connection, session)
            count = connection.execute(
                select(func.count()).where(measurements.c.session == session)
            ).scalar_one()
            if count + len(new) > (most := self._limits.session_measurements):
                remedy = f"delete {'one' if count + len(new) == most + 1 else 'some'} first."
                raise Busy(f"The session already holds {count} measurements of {most}; {remedy}")
            self._files.require_room_in(connection, session, sum(len(one.data) for one in new))
            added = self.insert(connection, session, new)
            mark_used(connection, session)
        return [self.get(session, one) for one in added]

    def insert(
        self, connection: Connection, session: str, new: Sequence[NewMeasurement]
    ) -> list[str]:
        """Keep all of them within a transaction, whatever room there is; their ids."""
        ids = [secrets.token_hex(8) for _ in new]
        newest = select(func.max(measurements.c.created)).where(measurements.c.session == session)
        # Also where the clock has gone back, what comes later is later.
        now = max(time.time(), (connection.execute(newest).scalar_one() or 0.0) + 1e-3)
        hashes = self._files.keep(connection, [one.data for one in new])
        for order, (measurement, sha256, one) in enumerate(zip(ids, hashes, new, strict=True)):
            connection.execute(
                insert(measurements).values(
                    id=measurement,
                    session=session,
                    sha256=sha256,
                    name=one.name,
                    created=now + 1e-3 * order,
                    sample=one.sample,
                    noise=json.dumps(dict(one.noise)),
                    summary=json.dumps(dict(one.summary)),
                    manoeuvre=_optional(one.manoeuvre),
                )
            )
        return ids

    def of_session(self, session: str) -> list[Measurement]:
        """All measurements of a session, oldest first."""
        with self._database.reading() as connection:
            rows = connection.execute(_measurements(session).order_by(measurements.c.created)).all()
        return [_measurement(row) for row in rows]

    def get(self, session: str, measurement: str) -> Measurement:
        """One measurement of a session."""
        with self._database.reading() as connection:
            row = connection.execute(
                _measurements(session).where(measurements.c.id == measurement)
            ).one_or_none()
        if row is None:
            raise NotFound(ABSENT)
        return _measurement(row)

    def original(self, measurement: Measurement) -> Path:
        """Place of a measurement's original file; Unavailable while the disk is away, NotFound
        where the measurement was deleted meanwhile, Deleted where only its file was.
        """
        name, sha256 = measurement.name, measurement.sha256
        with files_in_a_sentence():
            place = self._directory.original(sha256)
            if place.is_file():
                return place
            if not self._directory.lacks(sha256):
                raise Unavailable(OUT_OF_ORDER, retry_after=30)
        if not self._files.has_row(sha256):
            raise NotFound(f"{name} has been deleted meanwhile; choose another measurement.")
        raise Deleted(
            f"{name} is gone from the service's data directory; add the recording again, or restore"
            " a backup."
        )

    def set_notes(
        self,
        session: str,
        measurement: str,
        noise: Mapping[str, float],
        conditioned: Sequence[Mapping[str, Any]],
        summary: Mapping[str, Any],
    ) -> Measurement:
        """Keep what notes say of a measurement, and what is found in it with that; `Busy` as of
        files.
        """
        text = json.dumps([dict(one) for one in conditioned]) if conditioned else None
        return self._set_of(
            session,
            measurement,
            more=len(text or ""),
            noise=json.dumps(dict(noise)),
            conditioned=text,
            summary=json.dumps(dict(summary)),
        )

    def set_manoeuvre(
        self, session: str, measurement: str, manoeuvre: Mapping[str, Any] | None
    ) -> Measurement:
        """Keep what was driven in a measurement, None where it is not known; `Busy` as of files."""
        text = _optional(manoeuvre)
        return self._set_of(session, measurement, more=len(text or ""), manoeuvre=text)

    def set_conditioning(
        self,
        session: str,
        measurement: str,
        conditioning: Mapping[str, Any] | None,
        summary: Mapping[str, Any],
    ) -> Measurement:
        """Keep what is done to a measurement, None for nothing, and what is found in it then."""
        text = _optional(conditioning)
        return self._set_of(
            session,
            measurement,
            more=len(text or ""),
            conditioning=text,
            summary=json.dumps(dict(summary)),
        )

    def set_mapping(
        self,
        session: str,
        measurement: str,
        mapping: Mapping[str, Any] | None,
        noise: Mapping[str, float],
        summary: Mapping[str, Any],
    ) -> Measurement:
        """Keep which columns of a measurement are which channels, and what is found in it by that;
        `Conflict` while an unfinished job reads it, `Busy` as of files.
        """
        text = _optional(mapping)
        return self._set_of(
            session,
            measurement,
            more=len(text or ""),
            unused=True,
            mapping=text,
            noise=json.dumps(dict(noise)),
            summary=json.dumps(dict(summary)),
        )

    def _set_of(
        self,
        session: str,
        measurement: str,
        *,
        more: int = 0,
        unused: bool = False,
        **values: Any,
    ) -> Measurement:
        """Change some columns of a measurement, which take so many bytes more, and which unfinished
        jobs may still need if it has to be `unused`.
        """
        with self._database.writing() as connection:
            lock_session(connection, session)
            if unused:
                self._require_unused(connection, session, measurement)
            if more:
                self._files.require_room_in(connection, session, more)
            connection.execute(
                update(measurements)
                .where(measurements.c.session == session, measurements.c.id == measurement)
                .values(**values)
            )
        return self.get(session, measurement)

    def require_unused(self, session: str, measurement: str) -> None:
        """`Conflict` while an unfinished job reads a measurement, `NotFound` without it."""
        with self._database.reading() as connection:
            self._require_unused(connection, session, measurement)
        self.get(session, measurement)

    def _require_unused(self, connection: Connection, session: str, measurement: str) -> None:
        for job in self._jobs.unfinished_in(connection, session):
            if measurement in job.measurements:
                raise Conflict(
                    f"The {job.kind} {job.id} is still using this measurement; cancel it first."
                )

    def delete(self, session: str, measurement: str) -> None:
        """Remove a measurement; `Conflict` while an unfinished job reads it."""
        with self._database.writing() as connection:
            lock_session(connection, session)
            self._require_unused(connection, session, measurement)
            found = connection.execute(
                delete(measurements).where(
                    measurements.c.session == session, measurements.c.id == measurement
                )
            )
            if not found.rowcount:
                raise NotFound(ABSENT)
        self._files.drop_unreferenced()


def _measurements(session: str) -> Any:
    return (
        select(measurements, uploads.c.bytes).join(uploads).where(measurements.c.session == session)
    )


def _measurement(row: Row[Any]) -> Measurement:
    return Measurement(
        id=row.id,
        name=row.name,
        sha256=row.sha256,
        bytes=row.bytes,
        created=row.created,
        sample=row.sample,
        noise=json.loads(row.noise),
        summary=json.loads(row.summary),
        manoeuvre=row.manoeuvre and json.loads(row.manoeuvre),
        mapping=row.mapping and json.loads(row.mapping),
        conditioning=row.conditioning and json.loads(row.conditioning),
        conditioned=row.conditioned and json.loads(row.conditioned),
    )


def _optional(data: Mapping[str, Any] | None) -> str | None:
    return None if data is None else json.dumps(dict(data))
