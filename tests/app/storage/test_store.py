"""What is kept, and that it is kept: locks, durability, references between rows and files."""

import hashlib
import os
import sqlite3
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from ridetune.app.errors import Busy, Conflict, NotFound, StartError
from ridetune.app.limits import Limits
from ridetune.app.storage.data_directory import DataDirectory
from ridetune.app.storage.measurement import NewMeasurement
from ridetune.app.storage.store import Store

CAR = {"name": "a car"}


@pytest.fixture
def store(tmp_path, database):
    store = Store(tmp_path / "data", Limits(unfinished_jobs=2, session_jobs=3), database)
    yield store
    store.close()


@pytest.fixture
def session(store) -> str:
    return store.sessions.create(CAR, [])[0]


def recording(data: bytes = b"0 1 2") -> NewMeasurement:
    return NewMeasurement("run.csv", data, {"samples": 3}, {"chassis.z": 1e-3})


def queued(store: Store, session: str, key: str | None = None, runs: tuple[str, ...] = ()) -> str:
    spec = {"runs": [{"id": run, "name": "run"} for run in runs], "asked": "a fit"}
    return store.jobs.add(session, "test", spec, key)[0].id


def test_a_data_directory_has_one_owner(tmp_path):
    """The second one is told whose it is and what to do; afterwards it is free."""
    first = DataDirectory(tmp_path)
    with pytest.raises(StartError, match=rf"process {os.getpid()}.*--data"):
        DataDirectory(tmp_path)
    first.close()
    DataDirectory(tmp_path).close()


def test_the_lock_goes_with_its_process_however_it_ends(tmp_path):
    """kill -9 leaves nothing locked."""
    script = (
        "import sys, time; from pathlib import Path;"
        "from ridetune.app.storage.data_directory import DataDirectory;"
        "owner = DataDirectory(Path(sys.argv[1])); print('owned', flush=True); time.sleep(60)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path)], stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"owned\n"
        with pytest.raises(StartError, match=f"process {other.pid}"):
            DataDirectory(tmp_path)
        other.kill()
    DataDirectory(tmp_path).close()


def test_a_directory_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StartError, match="--data"):
        DataDirectory(tmp_path / "file" / "below")


def test_a_directory_that_may_not_be_written_is_told_at_the_start(tmp_path, monkeypatch, database):
    """Oracle: access(2), which also knows of a file system that is mounted read-only."""
    Store(tmp_path, Limits(), database).close()
    with monkeypatch.context() as patch:
        patch.setattr("ridetune.app.storage.data_directory.os.access", lambda path, mode: False)
        with pytest.raises(StartError, match="may not be written.*--data"):
            Store(tmp_path, Limits(), database)
    Store(tmp_path, Limits(), database).close()


def test_a_damaged_database_is_told_at_the_start(tmp_path):
    (tmp_path / "ridetune.sqlite").write_bytes(b"no database at all" * 100)
    with pytest.raises(StartError, match="damaged; restore a backup"):
        Store(tmp_path, Limits())


def test_sqlite_flushes_every_commit_and_checks_references(tmp_path):
    """WAL, synchronous=FULL (2), foreign keys on: read back from the connection itself."""
    store = Store(tmp_path, Limits())
    with store.database.reading() as connection:
        answers = {
            name: connection.exec_driver_sql(f"PRAGMA {name}").scalar()
            for name in ("journal_mode", "synchronous", "foreign_keys", "busy_timeout")
        }
    assert answers == {
        "journal_mode": "wal",
        "synchronous": 2,
        "foreign_keys": 1,
        "busy_timeout": 10_000,
    }
    store.close()


def test_a_database_of_another_version_is_refused(tmp_path):
    Store(tmp_path, Limits()).close()
    with sqlite3.connect(tmp_path / "ridetune.sqlite") as connection:
        connection.execute("UPDATE schema_version SET version = 99")
    connection.close()
    with pytest.raises(StartError, match="version 99"):
        Store(tmp_path, Limits())
    DataDirectory(tmp_path).close()


def test_everything_is_there_after_reopening(tmp_path, database):
    store = Store(tmp_path, Limits(), database)
    session, token = store.sessions.create(CAR, [recording(b"sample")])
    kept = store.measurements.add(session, recording())
    job = queued(store, session)
    store.finish_job(job, "done", result={"cost": 1.5})
    store.close()

    store = Store(tmp_path, Limits(), database)
    assert store.owners.opens(session, user=None, token=token)
    assert store.sessions.get(session).vehicle == CAR
    assert [one.name for one in store.measurements.of_session(session)] == ["run.csv", "run.csv"]
    assert (
        store.measurements.original(store.measurements.get(session, kept.id)).read_bytes()
        == b"0 1 2"
    )
    assert store.measurements.get(session, kept.id).noise == {"chassis.z": 1e-3}
    assert store.jobs.get(session, job).result == {"cost": 1.5}
    store.close()


def test_leftovers_of_a_crash_are_swept_and_originals_stay(tmp_path, database):
    """A half-written file and one whose row was never committed."""
    store = Store(tmp_path, Limits(), database)
    session, _ = store.sessions.create(CAR, [])
    kept = store.measurements.original(store.measurements.add(session, recording()))
    store.close()
    orphan = store.directory.original("0" * 64)
    orphan.parent.mkdir()
    half = kept.with_suffix(".tmp")
    for leftover in (orphan, half):
        leftover.write_bytes(b"?")
    Store(tmp_path, Limits(), database).close()
    assert kept.read_bytes() == b"0 1 2"
    assert not orphan.exists()
    assert not half.exists()


def test_an_original_is_named_by_its_hash(store, session):
    kept = store.measurements.add(session, recording(b"abc"))
    assert kept.sha256 == hashlib.sha256(b"abc").hexdigest()
    assert store.measurements.original(kept).name == kept.sha256


def test_uploads_and_deletions_of_the_same_bytes_at_once_never_lose_a_file(store, session):
    """Every measurement that is listed has its original, whatever else goes on."""
    errors = []

    def come_and_go() -> None:
        try:
            for _ in range(15):
                kept = store.measurements.add(session, recording())
                assert store.measurements.original(kept).read_bytes() == b"0 1 2"
                store.measurements.delete(session, kept.id)
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=come_and_go) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    assert store.measurements.of_session(session) == []


def test_room_is_made_from_sessions_nobody_used(tmp_path, database, monkeypatch):
    """A session with something of its own stays; one that only looked goes after an hour."""
    store = Store(tmp_path, Limits(sessions=2), database)
    used, used_token = store.sessions.create(CAR, [])
    store.sessions.set_vehicle(used, {"name": "mine"})
    looked, looked_token = store.sessions.create(CAR, [])
    now = time.time()
    monkeypatch.setattr("ridetune.app.storage.session_store.time.time", lambda: now + 7200.0)
    store.sessions.create(CAR, [])
    assert store.owners.opens(used, user=None, token=used_token)
    assert not store.owners.opens(looked, user=None, token=looked_token)
    store.close()


def test_a_measurement_in_use_is_not_deleted(store, session):
    kept = store.measurements.add(session, recording())
    job = queued(store, session, runs=(kept.id,))
    with pytest.raises(Conflict, match=job):
        store.measurements.delete(session, kept.id)
    store.finish_job(job, "cancelled")
    store.measurements.delete(session, kept.id)
    with pytest.raises(NotFound):
        store.measurements.get(session, kept.id)


def test_the_same_key_is_the_same_job(store, session):
    first, new = store.jobs.add(session, "test", {"runs": [], "asked": "a fit"}, "mine")
    again, newer = store.jobs.add(session, "test", {"runs": [], "asked": "a fit"}, "mine")
    assert (new, newer) == (True, False)
    assert again.id == first.id
    assert store.jobs.known(session, "mine", "a fit") == first
    assert store.jobs.known(session, "yours", "a fit") is None
    assert store.jobs.known(session, None, "a fit") is None
    other, _ = store.sessions.create(CAR, [])
    assert queued(store, other, key="mine") != first.id


def test_a_session_has_its_share_of_jobs(store, session):
    """Two under way, three kept in all."""
    first, _ = queued(store, session), queued(store, session)
    with pytest.raises(Busy, match="2 jobs under way"):
        queued(store, session)
    store.finish_job(first, "done")
    store.finish_job(queued(store, session), "failed", error={"code": "x", "detail": "y"})
    with pytest.raises(Busy, match="delete some"):
        queued(store, session)
    assert [job.state for job in store.jobs.of_session(session, "test")] == [
        "done",
        "queued",
        "failed",
    ]


def test_a_final_state_stays(store, session):
    """Whatever news comes late: the first end is the end."""
    job = queued(store, session)
    assert store.finish_job(job, "cancelled")
    assert not store.finish_job(job, "done", result={"late": True})
    assert not store.leases.start(job, "me")
    assert not store.leases.requeue(job, "me")
    kept = store.jobs.get(session, job)
    assert (kept.state, kept.result) == ("cancelled", None)


def made(store: Store, session: str, data: bytes) -> tuple[str, Path]:
    """A job that made a file, and where that is."""
    job = queued(store, session)
    assert store.finish_job(job, "done", result={"rows": 1}, file=data)
    sha256 = store.jobs.get(session, job).file
    assert sha256 == hashlib.sha256(data).hexdigest()
    return job, store.directory.original(sha256)


def test_a_job_s_file_goes_with_its_last_owner(store, session):
    """Two jobs and a measurement that happen to hold the same bytes; then the session."""
    measured = store.measurements.add(session, recording(b"rows"))
    (first, file), (second, same) = made(store, session, b"rows"), made(store, session, b"rows")
    assert file == same
    store.measurements.delete(session, measured.id)
    store.delete_job(session, first)
    assert file.read_bytes() == b"rows"
    store.delete_job(session, second)
    assert not file.exists()
    _, file = made(store, session, b"others")
    store.sessions.delete(session)
    assert not file.exists()


def test_a_job_s_file_outlives_a_restart_and_one_that_came_too_late_is_not_kept(tmp_path, database):
    store = Store(tmp_path, Limits(), database)
    session, _ = store.sessions.create(CAR, [])
    _, kept = made(store, session, b"rows")
    cancelled = queued(store, session)
    store.finish_job(cancelled, "cancelled")
    assert not store.finish_job(cancelled, "done", result={}, file=b"late")
    store.close()
    store = Store(tmp_path, Limits(), database)
    assert kept.read_bytes() == b"rows"
    assert [file.name for file in store.directory.originals.glob("*/*")] == [kept.name]
    store.close()


def test_files_of_jobs_take_their_share_of_the_session(tmp_path, database):
    store = Store(tmp_path, Limits(session_bytes=10), database)
    session, _ = store.sessions.create(CAR, [])
    job, _ = made(store, session, b"1234567")
    store.files.require_room(session, 3)
    with pytest.raises(Busy, match="measurements and sweeps would exceed 1e-05 MB together"):
        store.files.require_room(session, 4)
    with pytest.raises(Busy, match="delete one first"):
        store.measurements.add(session, recording(b"1234"))
    store.delete_job(session, job)
    store.measurements.add(session, recording(b"1234"))
    store.close()


def test_manoeuvres_take_their_share_of_the_session(tmp_path, database):
    """Oracle: {"name": "..."} has 12 characters besides the name."""
    store = Store(tmp_path, Limits(session_bytes=100), database)
    session, _ = store.sessions.create(CAR, [])
    one, other = (store.measurements.add(session, recording(b"12345")) for _ in range(2))
    store.measurements.set_manoeuvre(session, one.id, {"name": "x" * 68})
    store.files.require_room(session, 10)
    with pytest.raises(Busy, match="delete one first"):
        store.measurements.set_manoeuvre(session, other.id, {"name": ""})
    assert store.measurements.get(session, other.id).manoeuvre is None
    store.measurements.set_manoeuvre(session, one.id, None)
    store.measurements.set_manoeuvre(session, other.id, {"name": ""})
    store.close()


def test_mappings_are_kept_by_name_and_take_their_share_of_the_session(tmp_path, database):
    """Oracle: {"a": "..."} has 9 characters besides what is between the quotes."""
    store = Store(tmp_path, Limits(session_bytes=100), database)
    (session, _), (other, _) = (store.sessions.create(CAR, []) for _ in "ab")
    store.mappings.keep(session, "first", {"a": "x" * 31})
    store.mappings.keep(session, "second", {"a": ""})
    assert list(store.mappings.of_session(session)) == ["second", "first"]
    with pytest.raises(Busy, match="delete one first"):
        store.mappings.keep(session, "third", {"a": "x" * 50})
    store.mappings.keep(session, "first", {"a": "x" * 50})
    assert list(store.mappings.of_session(session)) == ["first", "second"]
    assert store.mappings.of_session(other) == {}
    with pytest.raises(NotFound):
        store.mappings.delete(other, "first")
    store.mappings.delete(session, "first")
    assert store.mappings.of_session(session) == {"second": {"a": ""}}
    store.sessions.delete(session)
    assert store.mappings.of_session(session) == {}
    store.close()


def test_a_session_keeps_a_hundred_mappings(store, session):
    for number in range(100):
        store.mappings.keep(session, str(number), {})
    store.mappings.keep(session, "7", {"again": 1})
    with pytest.raises(Busy, match="already keeps 100 mappings"):
        store.mappings.keep(session, "one more", {})


def test_a_measurement_in_use_keeps_its_mapping(store, session):
    kept = store.measurements.add(session, recording())
    job = queued(store, session, runs=(kept.id,))
    with pytest.raises(Conflict, match=job):
        store.measurements.set_mapping(session, kept.id, {}, {}, {})
    store.finish_job(job, "cancelled")
    assert store.measurements.set_mapping(session, kept.id, {}, {}, {}).mapping == {}


def test_jobs_of_another_session_are_not_found(store, session):
    job = queued(store, session)
    other, _ = store.sessions.create(CAR, [])
    with pytest.raises(NotFound):
        store.jobs.get(other, job)
    store.jobs.delete(other, job)
    assert store.jobs.get(session, job).id == job


def test_what_was_being_read_when_the_service_was_killed_is_removed(tmp_path):
    left = tmp_path / "reading/ridetune-child"
    left.mkdir(parents=True)
    (left / "half.bin").write_bytes(b"1")
    (tmp_path / "reading/upload").write_bytes(b"2")
    Store(tmp_path, Limits()).close()
    assert list((tmp_path / "reading").iterdir()) == []


def test_what_another_service_reads_stays_in_a_shared_directory(tmp_path, on_postgresql):
    """Only what is so old that nobody can be reading it any more goes."""
    fresh, old = tmp_path / "reading/fresh", tmp_path / "reading/old"
    fresh.mkdir(parents=True)
    old.mkdir()
    os.utime(old, (0, 0))
    Store(tmp_path, Limits(), on_postgresql).close()
    assert list((tmp_path / "reading").iterdir()) == [fresh]
