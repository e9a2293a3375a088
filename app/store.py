"""What the service keeps: sessions and their measurements; the originals stay on disk beside it.

Every query names the session it serves, so that an id of somebody else's is simply not found.
Methods block for a millisecond or so; the service calls them off the event loop.
"""

import hashlib
import hmac
import json
import secrets
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Row, delete, func, insert, select, update
from sqlalchemy.dialects.sqlite import insert as insert_or

from .data_directory import DataDirectory
from .database import Database
from .errors import Busy, Conflict, NotFound, Unavailable
from .job_store import UNFINISHED, JobStore
from .mapping_store import MappingStore
from .settings import Limits
from .setup_store import SetupStore
from .tables import job_files, job_parts, jobs, mappings, measurements, sessions, uploads

SEEN_EVERY = 60.0
UNUSED_AFTER = 3600.0


@dataclass(frozen=True)
class Session:
    """One visitor's workspace: the car being tuned and the car it is compared with, as JSON.

    setup : what the next identification is told, None while nothing was chosen
    """

    id: str
    vehicle: dict[str, Any]
    baseline: dict[str, Any]
    setup: dict[str, Any] | None


@dataclass(frozen=True)
class Measurement:
    """One uploaded recording.

    summary : what was found in it
    manoeuvre : what was driven
    mapping : which of its columns are which channels where their names do not say it
    conditioning : what is done to it before it is used, {"steps": [...], "vehicle": {...} or None}
    conditioned : what its notes say was done to it before it came here, a list of step records
    """

    id: str
    name: str
    sha256: str
    bytes: int
    created: float
    sample: bool
    noise: dict[str, float]
    summary: dict[str, Any]
    manoeuvre: dict[str, Any] | None
    mapping: dict[str, Any] | None
    conditioning: dict[str, Any] | None
    conditioned: list[dict[str, Any]] | None


@dataclass(frozen=True)
class NewMeasurement:
    """A recording to be kept, already parsed."""

    name: str
    data: bytes
    summary: Mapping[str, Any]
    noise: Mapping[str, float]
    sample: bool = False
    manoeuvre: Mapping[str, Any] | None = None


class Store:
    """Everything kept in one data directory; opening it locks the directory."""

    def __init__(self, path: Path, limits: Limits):
        self.limits = limits
        self.directory = DataDirectory(path)
        try:
            self.database = Database(self.directory.database)
        except BaseException:
            self.directory.close()
            raise
        self.jobs = JobStore(self.database, limits)
        self.setups = SetupStore(self.database, limits)
        self.mappings = MappingStore(self.database, self._require_room)
        self._seen: dict[str, float] = {}
        self._originals = threading.Lock()
        # The lock of the directory tells that whoever ran them is gone.
        self.jobs.take_back_all()
        with self.database.reading() as connection:
            kept = set(connection.execute(select(uploads.c.sha256)).scalars())
        self.directory.sweep(kept)

    def close(self) -> None:
        """Close the database and give up the directory."""
        self.database.close()
        self.directory.close()

    # Sessions

    def create_session(
        self, vehicle: Mapping[str, Any], samples: Iterable[NewMeasurement]
    ) -> tuple[str, str]:
        """Id and token of a fresh session that holds a vehicle and sample measurements."""
        session, token, now = secrets.token_hex(8), secrets.token_urlsafe(32), time.time()
        text = json.dumps(vehicle)
        with self._originals, self.database.writing() as connection:
            self._make_room(connection, now)
            connection.execute(
                insert(sessions).values(
                    id=session,
                    token_hash=_hash(token),
                    created=now,
                    seen=now,
                    vehicle=text,
                    baseline=text,
                )
            )
            for order, sample in enumerate(samples):
                self._insert(connection, session, sample, now + 1e-3 * order)
        return session, token

    def _make_room(self, connection: Any, now: float) -> None:
        """Let go of workspaces that nobody ever used, if there are too many."""
        count = select(func.count()).select_from(sessions)
        if connection.execute(count).scalar_one() < self.limits.sessions:
            return
        unused = sessions.c.used.is_(False) & (sessions.c.seen < now - UNUSED_AFTER)
        connection.execute(delete(sessions).where(unused))
        if connection.execute(count).scalar_one() >= self.limits.sessions:
            raise Unavailable(
                f"The service already keeps {self.limits.sessions} sessions; delete one that is "
                "no longer needed, or try again later.",
                retry_after=600,
            )

    def holds(self, session: str, token: str) -> bool:
        """Whether the token opens the session; notes that the session is in use."""
        with self.database.reading() as connection:
            kept = connection.execute(
                select(sessions.c.token_hash).where(sessions.c.id == session)
            ).scalar_one_or_none()
        if kept is None or not hmac.compare_digest(kept, _hash(token)):
            return False
        now = time.time()
        if now - self._seen.get(session, 0.0) > SEEN_EVERY:
            self._seen[session] = now
            self._set(session, seen=now)
        return True

    def session(self, session: str) -> Session:
        """The workspace."""
        with self.database.reading() as connection:
            row = connection.execute(
                select(sessions.c.vehicle, sessions.c.baseline, sessions.c.setup).where(
                    sessions.c.id == session
                )
            ).one_or_none()
        if row is None:
            raise NotFound("The session has been deleted; open the start page for a new one.")
        return Session(
            session,
            json.loads(row.vehicle),
            json.loads(row.baseline),
            row.setup and json.loads(row.setup),
        )

    def set_vehicle(self, session: str, vehicle: Mapping[str, Any]) -> None:
        """Replace the car being tuned."""
        self._set(session, vehicle=json.dumps(vehicle), used=True)

    def set_baseline(self, session: str, vehicle: Mapping[str, Any]) -> None:
        """Replace the car it is compared with."""
        self._set(session, baseline=json.dumps(vehicle), used=True)

    def _set(self, session: str, **values: Any) -> None:
        with self.database.writing() as connection:
            connection.execute(update(sessions).where(sessions.c.id == session).values(**values))

    def delete_session(self, session: str) -> None:
        """Remove a workspace with all its measurements, jobs and results."""
        with self._originals:
            with self.database.writing() as connection:
                connection.execute(delete(sessions).where(sessions.c.id == session))
            self._drop_unreferenced()
        self._seen.pop(session, None)

    # Measurements

    def add_measurement(self, session: str, new: NewMeasurement) -> Measurement:
        """Keep an original and what was found in it; `Busy` where the session is full."""
        return self.add_measurements(session, [new])[0]

    def add_measurements(self, session: str, new: Sequence[NewMeasurement]) -> list[Measurement]:
        """Keep all of them in their order, or `Busy` and none."""
        with self._originals, self.database.writing() as connection:
            count = connection.execute(
                select(func.count()).where(measurements.c.session == session)
            ).scalar_one()
            if count + len(new) > (most := self.limits.session_measurements):
                remedy = f"delete {'one' if count + len(new) == most + 1 else 'some'} first."
                raise Busy(f"The session already holds {count} measurements of {most}; {remedy}")
            self._require_room(connection, session, sum(len(one.data) for one in new))
            now = time.time()
            added = [
                self._insert(connection, session, one, now + 1e-3 * order)
                for order, one in enumerate(new)
            ]
            connection.execute(update(sessions).where(sessions.c.id == session).values(used=True))
        return [self.measurement(session, one) for one in added]

    def _insert(self, connection: Any, session: str, new: NewMeasurement, now: float) -> str:
        sha256, measurement = self._keep(connection, new.data, now), secrets.token_hex(8)
        connection.execute(
            insert(measurements).values(
                id=measurement,
                session=session,
                sha256=sha256,
                name=new.name,
                created=now,
                sample=new.sample,
                noise=json.dumps(dict(new.noise)),
                summary=json.dumps(dict(new.summary)),
                manoeuvre=_optional(new.manoeuvre),
            )
        )
        return measurement

    def _keep(self, connection: Connection, data: bytes, now: float) -> str:
        """Keep a file; its SHA-256."""
        sha256 = self.directory.keep(data)
        connection.execute(
            insert_or(uploads)
            .values(sha256=sha256, bytes=len(data), created=now)
            .on_conflict_do_nothing()
        )
        return sha256

    def _require_room(self, connection: Connection, session: str, more: int) -> None:
        """Raise Busy where the session's files would become too large together."""
        size = select(func.coalesce(func.sum(uploads.c.bytes), 0))
        measured = size.select_from(measurements.join(uploads)).where(
            measurements.c.session == session
        )
        made = (
            size.select_from(jobs.join(table).join(uploads)).where(jobs.c.session == session)
            for table in (job_files, job_parts)
        )
        columns = (
            measurements.c.manoeuvre,
            measurements.c.mapping,
            measurements.c.conditioning,
            measurements.c.conditioned,
            mappings.c.body,
        )
        told = (
            select(func.coalesce(func.sum(func.length(column)), 0)).where(
                column.table.c.session == session
            )
            for column in columns
        )
        total = sum(connection.execute(part).scalar_one() for part in (measured, *made, *told))
        if total + more > self.limits.session_bytes:
            raise Busy(
                f"The session's measurements and sweeps would exceed "
                f"{self.limits.session_bytes / 1e6:g} MB together; delete one first."
            )

    def measurements(self, session: str) -> list[Measurement]:
        """All measurements of a session, oldest first."""
        with self.database.reading() as connection:
            rows = connection.execute(_measurements(session).order_by(measurements.c.created)).all()
        return [_measurement(row) for row in rows]

    def measurement(self, session: str, measurement: str) -> Measurement:
        """One measurement of a session."""
        with self.database.reading() as connection:
            row = connection.execute(
                _measurements(session).where(measurements.c.id == measurement)
            ).one_or_none()
        if row is None:
            raise NotFound("There is no measurement with that id in this session.")
        return _measurement(row)

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
        self.require_unused(session, measurement)
        text = _optional(mapping)
        return self._set_of(
            session,
            measurement,
            more=len(text or ""),
            mapping=text,
            noise=json.dumps(dict(noise)),
            summary=json.dumps(dict(summary)),
        )

    def _set_of(
        self, session: str, measurement: str, *, more: int = 0, **values: Any
    ) -> Measurement:
        """Change some columns of a measurement, which take so many bytes more."""
        with self.database.writing() as connection:
            if more:
                self._require_room(connection, session, more)
            connection.execute(
                update(measurements)
                .where(measurements.c.session == session, measurements.c.id == measurement)
                .values(**values)
            )
        return self.measurement(session, measurement)

    def original(self, measurement: Measurement) -> Path:
        """Place of a measurement's original file."""
        return self.directory.original(measurement.sha256)

    def require_unused(self, session: str, measurement: str) -> None:
        """`Conflict` while an unfinished job reads a measurement, `NotFound` without it."""
        for job in self.jobs.unfinished(session):
            if measurement in job.measurements:
                raise Conflict(
                    f"The {job.kind} {job.id} is still using this measurement; cancel it first."
                )
        self.measurement(session, measurement)

    def delete_measurement(self, session: str, measurement: str) -> None:
        """Remove a measurement; `Conflict` while an unfinished job reads it."""
        self.require_unused(session, measurement)
        with self._originals:
            with self.database.writing() as connection:
                connection.execute(
                    delete(measurements).where(
                        measurements.c.session == session, measurements.c.id == measurement
                    )
                )
            self._drop_unreferenced()

    # Files of jobs

    def require_room(self, session: str, more: int) -> None:
        """Raise Busy where a session cannot keep so many bytes more."""
        with self.database.reading() as connection:
            self._require_room(connection, session, more)

    def finish_job(self, job: str, state: str, *, file: bytes | None = None, **found: Any) -> bool:
        """Give a job its final state, see `JobStore.finish`, and keep the file it made; its parts
        go.
        """
        with self._originals:
            sha256 = None
            if file is not None:
                with self.database.writing() as connection:
                    sha256 = self._keep(connection, file, time.time())
            ended = self.jobs.finish(job, state, file=sha256, **found)
            self._drop_unreferenced()
        return ended

    def keep_part(
        self, job: str, name: str, data: bytes, progress: Mapping[str, Any] | None = None
    ) -> bool:
        """Keep what a job has found so far under a name, durably, until the job ends; False where
        it has ended.

        progress : how far that came, given back by `parts`

        What is kept under that name already stays. Parts count in the session's bytes, but are not
        refused: what a job may take was asked for when it was taken.
        """
        mine = (job_parts.c.job == job) & (job_parts.c.name == name)
        with self._originals, self.database.writing() as connection:
            unfinished = jobs.c.state.in_(UNFINISHED)
            found = connection.execute(
                select(jobs.c.id).where(jobs.c.id == job, unfinished).with_for_update()
            ).one_or_none()
            if found is None:
                return False
            if connection.execute(select(job_parts.c.name).where(mine)).one_or_none() is None:
                sha256 = self._keep(connection, data, time.time())
                told = json.dumps(dict(progress or {}))
                connection.execute(
                    insert(job_parts).values(job=job, name=name, sha256=sha256, progress=told)
                )
        return True

    def parts(self, job: str) -> dict[str, dict[str, Any]]:
        """What is kept of a job that runs: how far each part came, by its name, in their order."""
        with self.database.reading() as connection:
            query = select(job_parts.c.name, job_parts.c.progress).where(job_parts.c.job == job)
            rows = connection.execute(query.order_by(job_parts.c.name)).all()
        return {row.name: json.loads(row.progress) for row in rows}

    def part(self, job: str, name: str) -> bytes:
        """What is kept of a job under a name; `NotFound` once it has ended."""
        with self.database.reading() as connection:
            sha256 = connection.execute(
                select(job_parts.c.sha256).where(job_parts.c.job == job, job_parts.c.name == name)
            ).scalar_one_or_none()
        if sha256 is None:
            raise NotFound(f"There is no part {name} of the job {job} any more.")
        return self.directory.original(sha256).read_bytes()

    def delete_job(self, session: str, job: str) -> None:
        """Remove a job with its result, its file and its parts."""
        with self._originals:
            self.jobs.delete(session, job)
            self._drop_unreferenced()

    def _drop_unreferenced(self) -> None:
        """Remove files of no measurement and no job: first the rows, then the files."""
        with self.database.writing() as connection:
            unreferenced = [
                uploads.c.sha256.not_in(select(table.c.sha256))
                for table in (measurements, job_files, job_parts)
            ]
            gone = connection.execute(
                delete(uploads).where(*unreferenced).returning(uploads.c.sha256)
            ).scalars()
            dropped = list(gone)
        for sha256 in dropped:
            self.directory.drop(sha256)


def _hash(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()


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
