"""Sessions and the cars that are tuned in them; whose they are is in `owner_store`."""

import json
import secrets
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    bindparam,
    delete,
    func,
    insert,
    select,
    true,
    update,
)

from ..errors import Busy, NotFound, Unavailable
from ..limits import Limits
from ..session_name import DEFAULT
from .database import Database
from .file_store import FileStore
from .measurement import NewMeasurement
from .measurement_store import MeasurementStore
from .secret import hashed, new_secret
from .session_row import GONE, delete_sessions
from .tables import sessions

UNUSED_AFTER = 3600.0

# Made once: to make it takes as long as to execute it.
_KEPT = select(sessions.c.name, sessions.c.vehicle, sessions.c.baseline, sessions.c.setup).where(
    sessions.c.id == bindparam("session")
)


@dataclass(frozen=True)
class Session:
    """One visitor's workspace: the car being tuned and the car it is compared with, as JSON.

    setup : what the next identification is told, None while nothing was chosen
    """

    id: str
    name: str
    vehicle: dict[str, Any]
    baseline: dict[str, Any]
    setup: dict[str, Any] | None


class SessionStore:
    """All sessions."""

    def __init__(
        self,
        database: Database,
        limits: Limits,
        files: FileStore,
        measurements: MeasurementStore,
        removed: Callable[[], None],
    ):
        """removed : called once a session has been deleted"""
        self._database = database
        self._limits = limits
        self._files = files
        self._measurements = measurements
        self._removed = removed

    def create(
        self,
        vehicle: Mapping[str, Any],
        samples: Sequence[NewMeasurement],
        owner: str | None = None,
        name: str = DEFAULT,
        *,
        used: bool = False,
    ) -> tuple[str, str]:
        """Id and token of a fresh session that holds a vehicle and sample measurements; the token
        opens it where it has no owner.

        used : whether it holds something of its visitor's already, as a name of their choice
        """
        session, token, now = secrets.token_hex(8), new_secret(), time.time()
        text = json.dumps(vehicle)
        with self._database.writing() as connection:
            self._make_room(connection, now, owner)
            connection.execute(
                insert(sessions).values(
                    id=session,
                    token_hash=hashed(token),
                    owner=owner,
                    created=now,
                    seen=now,
                    used=used,
                    vehicle=text,
                    baseline=text,
                    name=name,
                )
            )
            self._measurements.insert(connection, session, samples)
        return session, token

    def _make_room(self, connection: Connection, now: float, owner: str | None) -> None:
        """Let go of workspaces that nobody ever used where there are too many, also of a user's."""
        self._database.lock(connection, {"sessions"})
        if owner is not None and not _has_room(
            connection, now, sessions.c.owner == owner, self._limits.user_sessions
        ):
            raise Busy(
                f"You already keep {self._limits.user_sessions} sessions; delete one that is no "
                "longer needed, or go on with it. Those that hold nothing of yours make room an "
                "hour after their last use."
            )
        if not _has_room(connection, now, true(), self._limits.sessions):
            raise Unavailable(
                f"The service already keeps {self._limits.sessions} sessions; delete one that is "
                "no longer needed, try again later, or ask whoever runs it, who can delete some "
                "with `ridetune sessions`.",
                retry_after=600,
            )

    def get(self, session: str) -> Session:
        """The workspace."""
        with self._database.reading() as connection:
            row = connection.execute(_KEPT, {"session": session}).one_or_none()
        if row is None:
            raise NotFound(GONE)
        return Session(
            session,
            row.name,
            json.loads(row.vehicle),
            json.loads(row.baseline),
            row.setup and json.loads(row.setup),
        )

    def rename(self, session: str, name: str) -> None:
        """Call it something else."""
        self._set(session, name=name, used=True)

    def set_vehicle(self, session: str, vehicle: Mapping[str, Any]) -> None:
        """Replace the car being tuned."""
        self._set(session, vehicle=json.dumps(vehicle), used=True)

    def set_baseline(self, session: str, vehicle: Mapping[str, Any]) -> None:
        """Replace the car it is compared with."""
        self._set(session, baseline=json.dumps(vehicle), used=True)

    def _set(self, session: str, **values: Any) -> None:
        with self._database.writing() as connection:
            mine = update(sessions).where(sessions.c.id == session)
            if not connection.execute(mine.values(**values)).rowcount:
                raise NotFound(GONE)

    def delete(self, session: str) -> None:
        """Remove a workspace with all its measurements, jobs and results."""
        with self._database.writing() as connection:
            delete_sessions(connection, [session])
        self._removed()
        self._files.drop_unreferenced()


def _has_room(connection: Connection, now: float, these: ColumnElement[bool], most: int) -> bool:
    """Whether one more may join these, of which the unused ones go if it must be."""
    count = select(func.count()).select_from(sessions).where(these)
    if connection.execute(count).scalar_one() < most:
        return True
    unused = sessions.c.used.is_(False) & (sessions.c.seen < now - UNUSED_AFTER)
    connection.execute(delete(sessions).where(these & unused))
    return connection.execute(count).scalar_one() < most
