"""What the page will ask of the next identification, kept with its session part by part.

Two pages may be open on one session, so what is kept is never replaced as a whole: each sends what
it has changed, and the lock of the session orders them.
"""

import json
from collections.abc import Mapping
from typing import Any

from sqlalchemy import select, update

from ..errors import InvalidRequest
from ..limits import Limits
from ..setup_form import SetupForm
from .database import Database
from .session_row import lock_session
from .tables import measurements, sessions

OF_RUNS = ("use", "braking")
BY_NAME = (*OF_RUNS, "bounds", "noise", "priors", "sensors")


class SetupStore:
    """The set-ups of all sessions, as JSON."""

    def __init__(self, database: Database, limits: Limits):
        self._database = database
        self._limits = limits

    def change(self, session: str, changes: SetupForm) -> dict[str, Any]:
        """Keep what is told in `changes`; the whole set-up.

        What is told of a measurement goes with it.
        """
        most = self._limits.session_measurements
        for part in OF_RUNS:
            if len(getattr(changes, part)) > most:
                raise InvalidRequest(
                    f"{part} names more than the {most} measurements that a session keeps at most;"
                    " leave out those that are gone.",
                    field=part,
                )
        with self._database.writing() as connection:
            lock_session(connection, session)
            kept = connection.execute(
                select(sessions.c.setup).where(sessions.c.id == session)
            ).scalar_one()
            runs = connection.execute(
                select(measurements.c.id).where(measurements.c.session == session)
            ).scalars()
            before = json.loads(kept) if kept else {}
            setup = _merged({**SetupForm().model_dump(mode="json"), **before}, changes)
            here = set(runs)
            for part in OF_RUNS:
                setup[part] = {run: told for run, told in setup[part].items() if run in here}
            connection.execute(
                update(sessions)
                .where(sessions.c.id == session)
                .values(setup=json.dumps(setup), used=True)
            )
        return setup


def _merged(before: Mapping[str, Any], changes: SetupForm) -> dict[str, Any]:
    """`before` with what the changes tell, parts by name and settings entry by entry."""
    setup, told = dict(before), changes.model_dump(mode="json")
    for part in changes.model_fields_set:
        if part in BY_NAME:
            entries = {**before[part], **told[part]}
            setup[part] = {name: value for name, value in entries.items() if value is not None}
        elif part == "settings":
            fields = changes.settings.model_fields_set
            setup[part] = {**before[part], **{name: told[part][name] for name in fields}}
        else:
            setup[part] = told[part]
    return setup
