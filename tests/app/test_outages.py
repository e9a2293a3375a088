"""The database or the disk is gone, full, held or read-only: what a caller is told, and that all is
well again by itself. Oracle: what was acknowledged before is there afterwards, and no more.
"""

import errno
import sqlite3
from collections.abc import Callable

import pytest
from ridetune.app.errors import Deleted, Unavailable
from ridetune.app.limits import Limits
from ridetune.app.recordings.recordings import Recordings
from ridetune.app.settings import Settings
from ridetune.app.storage.store import Store
from sqlalchemy import event, text

from .conftest import Visitor, open_client, short_recording

FILE = short_recording()


def refused(reply, status: int, said: str) -> None:
    """One sentence with its remedy, and when to come again."""
    assert reply.status_code == status, reply.text
    assert said in reply.json()["detail"]
    assert "try again" in reply.json()["detail"]
    assert int(reply.headers["retry-after"]) > 0


def names(visitor: Visitor) -> list[str]:
    return [kept["name"] for kept in visitor.get("/measurements").json()]


def car_of(visitor: Visitor, mass: float) -> dict:
    car = visitor.get("/vehicle").json()
    return {**car, "chassis": {**car["chassis"], "mass": mass}}


def test_a_service_outlives_its_database(tmp_path, postgresql, on_postgresql):
    """PostgreSQL stops and comes back; what it acknowledged is there, what it refused is not."""
    with open_client(Settings(data=tmp_path / "data", database=on_postgresql)) as service:
        owner = Visitor(service)
        assert owner.upload(FILE, "before.csv").status_code == 201
        before = names(owner)
        car = car_of(owner, 1234.0)
        store: Store = service.app.state.services.store
        postgresql.stop()
        try:
            for reply in (
                owner.get(),
                owner.upload(FILE, "meanwhile.csv"),
                owner.put("/vehicle", json=car),
                service.post("/api/sessions"),
            ):
                refused(reply, 503, "database cannot be reached")
            # What threads of their own have to be ready for.
            for write in (
                lambda: store.leases.claim("me", 1),
                lambda: store.leases.heartbeat("me"),
                lambda: store.finish_job("any", "done", file=b"rows"),
                lambda: store.keep_part("any", "part", b"rows"),
            ):
                with pytest.raises(Unavailable):
                    write()
        finally:
            postgresql.start()
        assert names(owner) == before
        assert owner.put("/vehicle", json=car).status_code == 200
        assert owner.upload(FILE, "after.csv").status_code == 201
        assert names(owner) == [*before, "after.csv"]


def test_a_database_that_breaks_off_within_a_transaction_keeps_nothing_of_it(
    tmp_path, postgresql, on_postgresql
):
    store = Store(tmp_path, Limits(), on_postgresql)

    def break_off() -> None:
        with store.database.writing() as connection:
            store.files.keep(connection, [b"half"])
            postgresql.stop()
            postgresql.start()
            connection.exec_driver_sql("SELECT 1")

    with pytest.raises(Unavailable):
        break_off()
    assert len(list(store.directory.names())) == 1
    store.files.sweep()
    assert list(store.directory.names()) == []
    store.close()


def test_a_held_database_can_be_looked_at_and_is_written_again_later(settings, monkeypatch):
    monkeypatch.setattr("ridetune.app.storage.sqlite.BUSY_MILLISECONDS", 50)
    with open_client(settings) as service:
        owner = Visitor(service)
        car = car_of(owner, 1234.0)
        other = sqlite3.connect(settings.data / "ridetune.sqlite", isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        refused(owner.put("/vehicle", json=car), 503, "close what else has its ridetune.sqlite")
        assert owner.get("/vehicle").status_code == 200
        other.execute("ROLLBACK")
        other.close()
        assert owner.put("/vehicle", json=car).status_code == 200
        assert owner.get("/vehicle").json()["chassis"]["mass"] == 1234.0


def raising(number: int) -> Callable:
    def fail(*_, **__):
        raise OSError(number, "injected")

    return fail


DISKS = {
    "full": (errno.ENOSPC, 507, "disk of the service is full"),
    "over quota": (errno.EDQUOT, 507, "disk of the service is full"),
    "read-only": (errno.EROFS, 503, "data directory cannot be used"),
    "broken": (errno.EIO, 503, "data directory cannot be used"),
    "away": (errno.ENOENT, 503, "data directory cannot be used"),
    "out of files": (errno.EMFILE, 503, "too many files open"),
    "out of memory": (errno.ENOMEM, 503, "too little memory"),
}
PLACES = {
    "flushing": "ridetune.app.storage.originals.os.fsync",
    "renaming": "ridetune.app.storage.originals.os.replace",
    "reading": "ridetune.app.recordings.recordings.NamedTemporaryFile",
    "starting a reader": "ridetune.engine.formats.child.subprocess.Popen",
    "receiving": "ridetune.app.routes.uploads.SpooledTemporaryFile",
}


@pytest.mark.parametrize("disk", DISKS)
@pytest.mark.parametrize("place", PLACES)
def test_a_disk_that_takes_nothing_loses_nothing(client, disk, place):
    number, status, said = DISKS[disk]
    owner = Visitor(client)
    before = names(owner)
    store: Store = client.app.state.services.store
    files = set(store.directory.names())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PLACES[place], raising(number))
        reply = owner.post("/measurements?name=lap.csv", content=FILE)
        refused(reply, status, said)
        assert names(owner) == before
    assert set(store.directory.names()) == files
    assert list(store.directory.reading.iterdir()) == []
    assert owner.post("/measurements?name=lap.csv", content=FILE).status_code == 201
    assert names(owner) == [*before, "lap.csv"]


def test_an_original_that_cannot_be_had_is_told(client):
    """The volume is not there: the row is, so it is no 404."""
    owner = Visitor(client)
    kept = owner.upload(FILE).json()["id"]
    originals = client.app.state.services.store.directory.originals
    away = originals.with_name("away")
    originals.rename(away)
    refused(owner.get(f"/measurements/{kept}/original"), 503, "data directory cannot be used")
    refused(owner.upload(b"other" + FILE), 503, "data directory cannot be used")
    away.rename(originals)
    assert owner.get(f"/measurements/{kept}/original").content == FILE


def test_a_recording_whose_file_alone_is_gone_is_told_by_its_name(client):
    """Somebody has deleted it; to add it again mends it, since it lies under its SHA-256."""
    owner, shared = Visitor(client), client.app.state.services
    kept = owner.upload(FILE, "lap.csv").json()["id"]
    measurement = shared.store.measurements.get(owner.id, kept)
    original = shared.store.measurements.original(measurement)
    original.unlink()
    for path in ("original", "columns"):
        reply = owner.get(f"/measurements/{kept}/{path}")
        assert reply.status_code == 410
        assert "lap.csv is gone" in reply.json()["detail"]
        assert "add the recording again" in reply.json()["detail"]
    original.parent.rmdir()
    with pytest.raises(Deleted):
        Recordings(shared.store).run(measurement)
    assert owner.upload(FILE, "again.csv").status_code == 201
    assert owner.get(f"/measurements/{kept}/original").content == FILE


@pytest.mark.parametrize("how", ["moved", "emptied", "broken"])
def test_a_recording_on_a_disk_that_is_away_waits_for_it(client, monkeypatch, how):
    """A broken disk looks to the process that reads the file like a spoilt one."""
    owner, shared = Visitor(client), client.app.state.services
    kept = shared.store.measurements.get(owner.id, owner.upload(FILE).json()["id"])
    originals = shared.store.directory.originals
    if how == "broken":
        shared.store.measurements.original(kept).write_bytes(b"\x00 spoilt")
        monkeypatch.setattr("pathlib.Path.open", raising(errno.EIO))
    else:
        originals.rename(originals.with_name("away"))
    if how == "emptied":
        originals.mkdir()
    with pytest.raises(Unavailable, match="data directory cannot be used"):
        Recordings(shared.store).run(kept)


def test_a_job_whose_recording_s_file_is_gone_fails_and_names_it(settings, clusters):
    """Deleted before a later start of the service took the job up."""
    with open_client(settings) as service:
        owner = Visitor(service)
        shared = service.app.state.services
        [kept, *_] = shared.store.measurements.of_session(owner.id)
        original = shared.store.measurements.original(kept)
        job = owner.submit("identifications", {"runs": [kept.id]})["id"]
    original.unlink()
    with open_client(settings) as service:
        owner.client = service
        error = owner.wait_for("identifications", job)["error"]
    assert error["code"] == "deleted"
    assert error["detail"].startswith(f"{kept.name} is gone from the service's data directory; add")


SQLITE = {
    "full": ("max_page_count=1", 507, "disk of the service is full"),
    "read-only": ("query_only=ON", 503, "database cannot be written"),
}


@pytest.mark.parametrize("case", SQLITE)
def test_an_sqlite_database_that_takes_nothing_can_be_looked_at(client, case):
    """Also a minute later, when it would note that the session is in use."""
    pragma, status, said = SQLITE[case]
    owner = Visitor(client)
    store: Store = client.app.state.services.store
    pool = store.database._writer.pool

    def hinder(connection, *_) -> None:
        connection.execute(f"PRAGMA {pragma}").close()

    with store.database.writing() as connection:
        connection.execute(text("UPDATE sessions SET seen = 0"))
    event.listen(pool, "checkout", hinder)
    refused(client.post("/api/sessions"), status, said)
    assert owner.get("/vehicle").status_code == 200
    event.remove(pool, "checkout", hinder)
    pool.dispose()
    assert client.post("/api/sessions").status_code == 201


def test_who_was_let_in_stays_so_while_the_database_takes_nothing(settings):
    """By a key or as a browser; it is time to note that either is in use."""
    pragma = SQLITE["read-only"][0]
    with open_client(settings, login=True) as service:
        store: Store = service.app.state.services.store
        key = {"Authorization": f"Bearer {store.keys.add('script')}"}
        service.get(f"/?token={store.browsers.make_link()}")
        with store.database.writing() as connection:
            connection.execute(text("UPDATE browsers SET expires = expires - 7200"))
        event.listen(
            store.database._writer.pool,
            "checkout",
            lambda connection, *_: connection.execute(f"PRAGMA {pragma}").close(),
        )
        assert service.get("/api/parameters", headers=key).status_code == 200
        assert service.get("/api/parameters").status_code == 200


@pytest.mark.parametrize("disk", DISKS)
def test_a_job_s_files_wait_for_room(tmp_path, database, monkeypatch, disk):
    """Oracle: the job is as it was, and can be ended once there is room."""
    store = Store(tmp_path, Limits(), database)
    session, _ = store.sessions.create({}, [])
    job, _ = store.jobs.add(session, "test", {"runs": [], "asked": "a fit"}, None)
    with monkeypatch.context() as patch:
        patch.setattr(PLACES["flushing"], raising(DISKS[disk][0]))
        for keep in (
            lambda: store.keep_part(job.id, "part", b"rows"),
            lambda: store.finish_job(job.id, "done", file=b"rows"),
        ):
            with pytest.raises(Unavailable):
                keep()
    assert store.jobs.get(session, job.id) == job
    assert store.parts(job.id) == {}
    assert store.keep_part(job.id, "part", b"rows")
    assert store.finish_job(job.id, "done", file=b"rows")
    store.close()
