"""Databases of earlier versions: every row stays, and everything that is new since works."""

from typing import Any

import pytest
from ridetune.app.limits import Limits
from ridetune.app.setup_form import SetupForm
from ridetune.app.storage.store import Store
from ridetune.app.storage.tables import SCHEMA_VERSION
from sqlalchemy import create_engine, text

from .old_databases import FILES, TOKEN, make, make_originals

FIRST_ON_POSTGRESQL = 7
VERSIONS = [
    *[("sqlite", version) for version in range(1, SCHEMA_VERSION + 1)],
    *[("postgresql", version) for version in range(FIRST_ON_POSTGRESQL, SCHEMA_VERSION + 1)],
]


@pytest.fixture(params=VERSIONS, ids=lambda which: f"{which[0]}-{which[1]}")
def old(request, tmp_path) -> tuple[int, str, dict[str, list[dict[str, Any]]]]:
    """An old database in or beside a data directory: its version, what `Store` is told of it, and
    the rows of its tables.
    """
    kind, version = request.param
    data = tmp_path / "data"
    data.mkdir()
    make_originals(data)
    database = "" if kind == "sqlite" else request.getfixturevalue("on_postgresql")
    place = f"sqlite:///{data}/ridetune.sqlite"
    engine = create_engine(database.replace("postgresql:", "postgresql+psycopg:") or place)
    with engine.begin() as connection:
        rows = make(connection, version)
    engine.dispose()
    return version, database, rows


def test_a_database_of_an_earlier_version_keeps_every_row(tmp_path, old):
    _, database, rows = old
    store = Store(tmp_path / "data", Limits(), database)
    with store.database.reading() as connection:
        for table, before in rows.items():
            if table == "schema_version":
                continue
            names = list(before[0])
            found = connection.execute(text(f"SELECT {', '.join(names)} FROM {table}")).all()
            expected = {tuple(row[name] for name in names) for row in before}
            assert {tuple(row) for row in found} == expected, table
    store.close()


def test_a_database_of_an_earlier_version_works_like_any_other(tmp_path, old):
    version, database, _ = old
    store = Store(tmp_path / "data", Limits(), database)
    assert store.owners.opens("s1", user=None, token=TOKEN)
    done = store.jobs.get("s1", "done")
    assert (done.result, done.restarts, done.priority) == ({"cost": 1.5}, 2, 0)
    [kept] = store.measurements.of_session("s1")
    assert store.measurements.original(kept).read_bytes() == FILES[0]
    if version >= 2:
        assert done.file is not None
        assert store.files.original(done.file).read_bytes() == FILES[1]
    measured = store.measurements
    assert measured.set_manoeuvre("s1", "m1", {"name": "lap 2"}).manoeuvre == {"name": "lap 2"}
    done_to_it = [{"step": {"kind": "drift"}}]
    noted = measured.set_notes("s1", "m1", {}, done_to_it, kept.summary)
    assert noted.conditioned == done_to_it
    steps = {"steps": [{"kind": "rest"}], "vehicle": None}
    assert measured.set_conditioning("s1", "m1", steps, kept.summary).conditioning == steps
    mapping = {"columns": [], "step": 0.01}
    assert measured.set_mapping("s1", "m1", mapping, {}, {}).mapping == mapping
    store.mappings.keep("s1", "car 8", {})
    assert "car 8" in store.mappings.of_session("s1")
    store.setups.change("s1", SetupForm(starts=16))
    assert (store.sessions.get("s1").setup or {})["starts"] == 16
    [one] = store.owners.sessions(user=None, tokens=[TOKEN])
    assert (one.name, one.measurements) == ("Fahrzeug 7" if version >= 10 else "Project", 1)
    store.sessions.rename("s1", "car 8")
    assert store.sessions.get("s1").name == "car 8"
    claimed = store.leases.claim("me", 5)
    assert [(job.id, job.restarts) for job in claimed] == [("queued", 0), ("running", 1)]
    assert store.keep_part("running", "second", b"half the rows")
    assert store.finish_job("running", "done", runner="me", file=b"all the rows")
    store.leases.release("me")
    store.sessions.delete("s1")
    assert list(store.directory.names()) == []
    store.close()
