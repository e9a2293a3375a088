"""Backups: everything comes back, from either database into either, or nothing is touched."""

import hashlib
import json
import shutil
import threading
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import pytest
import ridetune.app.storage.backup
from ridetune.app.cli import main
from ridetune.app.errors import NotFound
from ridetune.app.limits import Limits
from ridetune.app.setup_form import SetupForm
from ridetune.app.storage.data_directory import DataDirectory
from ridetune.app.storage.measurement import NewMeasurement
from ridetune.app.storage.store import Store
from ridetune.app.storage.tables import SCHEMA_VERSION
from sqlalchemy import create_engine

from ..command_line import refused
from .old_databases import FILES, SHA256, TOKEN, make

CAR = {"name": "a car"}
DRIVEN = {"name": "lap"}


def filled(store: Store) -> tuple[list[str], list[str]]:
    """Two sessions with something of every kind: their ids and tokens."""
    made = [store.sessions.create(CAR, [recording(b"sample")]) for _ in "ab"]
    for session, _ in made:
        one = store.measurements.add(session, recording(session.encode()))
        store.measurements.set_manoeuvre(session, one.id, DRIVEN)
        store.measurements.set_mapping(session, one.id, {"columns": []}, {"chassis.z": 1.0}, {})
        store.measurements.set_conditioning(session, one.id, {"steps": []}, {"samples": 3})
        store.measurements.set_notes(session, one.id, {}, [{"step": {}}], {"samples": 4})
        store.mappings.keep(session, "Fahrzeug \u0663 – 7", {"columns": [1]})
        store.setups.change(session, SetupForm(starts=16))
        store.sessions.set_vehicle(session, {"name": "my car", "mass": 0.1 + 0.2})
        store.sessions.rename(session, "Fahrzeug \u0663 – 7")
        spec = {"runs": [{"id": one.id, "name": "run"}], "asked": "a fit"}
        done, failed, waiting = (
            store.jobs.add(session, "test", spec, key, priority=3)[0].id for key in ("a", "b", None)
        )
        store.finish_job(done, "done", result={"cost": 1e-300}, file=b"rows " + session.encode())
        store.finish_job(failed, "failed", error={"code": "x", "detail": "y\0z"})
        store.jobs.ask_to_cancel(session, failed)
        store.keep_part(waiting, "first", b"part " + session.encode(), {"cars": 5})
    return [session for session, _ in made], [token for _, token in made]


def recording(data: bytes) -> NewMeasurement:
    return NewMeasurement("run.csv", data, {"samples": 3}, {"chassis.z": 1e-3}, manoeuvre=DRIVEN)


def picture(store: Store, sessions: list[str]) -> list:
    """All that is kept of some sessions, with the bytes of every file."""
    found = []
    for session in sessions:
        measurements = store.measurements.of_session(session)
        jobs = store.jobs.of_session(session, "test")
        found += [
            store.sessions.get(session),
            [(one, store.measurements.original(one).read_bytes()) for one in measurements],
            store.mappings.of_session(session),
            [store.jobs.get(session, job.id) for job in jobs],
            [
                (name, progress, store.part(job.id, name))
                for job in jobs
                for name, progress in store.parts(job.id).items()
            ],
            [
                store.files.original(job.file).read_bytes()
                for job in (store.jobs.get(session, job.id) for job in jobs)
                if job.file
            ],
        ]
    return found


@pytest.fixture
def other_database(request, postgresql):
    """What `Store` is told of the database that a backup is restored into."""
    if request.param == "sqlite":
        yield ""
        return
    with postgresql.database() as url:
        yield url


@pytest.fixture
def command(monkeypatch):
    """Run a command of a service that has a database."""

    def run(database: str, *arguments: object) -> None:
        monkeypatch.setenv("RIDETUNE_DATABASE", database)
        assert main([str(one) for one in arguments]) == 0

    return run


@pytest.mark.parametrize("other_database", ["sqlite", "postgresql"], indirect=True)
def test_everything_comes_back(tmp_path, database, other_database, command, capsys):
    """From a service that runs, into either database; oracle: all that the store tells."""
    here, there, file = tmp_path / "here", tmp_path / "there", tmp_path / "backup.zip"
    store = Store(here, Limits(), database)
    sessions, tokens = filled(store)
    before = picture(store, sessions)
    command(database, "backup", "--data", here, "-o", file)
    assert "2 sessions with 4 measurements and 6 jobs, 7 files" in capsys.readouterr().out
    assert file.stat().st_mode & 0o077 == 0
    store.close()
    shutil.rmtree(here)
    command(other_database, "restore", file, "--data", there)
    assert "2 sessions with 4 measurements and 6 jobs, 7 files" in capsys.readouterr().out
    store = Store(there, Limits(), other_database)
    assert picture(store, sessions) == before
    for session, token in zip(sessions, tokens, strict=True):
        assert store.owners.opens(session, user=None, token=token)
    assert len(set(store.directory.names())) == 7
    assert len(store.leases.claim("me", 5)) == 2
    store.close()


def test_a_backup_of_a_busy_service_is_of_one_moment(tmp_path, database, command):
    """While files come and go: every row has its file afterwards, and what was there stays."""
    store = Store(tmp_path / "here", Limits(), database)
    sessions, _ = filled(store)
    before = picture(store, sessions)
    busy, _ = store.sessions.create(CAR, [])
    ended, errors = threading.Event(), []

    def come_and_go() -> None:
        try:
            turn = 0
            while not ended.is_set():
                turn += 1
                kept = store.measurements.add(busy, recording(b"%d" % turn))
                job, _ = store.jobs.add(busy, "test", {"runs": [], "asked": "a fit"}, None)
                store.finish_job(job.id, "done", result={}, file=b"rows %d" % turn)
                store.measurements.delete(busy, kept.id)
                store.delete_job(busy, job.id)
        except Exception as error:
            errors.append(error)

    worker = threading.Thread(target=come_and_go)
    worker.start()
    files = [tmp_path / f"{number}.zip" for number in range(4)]
    try:
        for file in files:
            command(database, "backup", "--data", tmp_path / "here", "-o", file)
    finally:
        ended.set()
        worker.join()
    assert errors == []
    store.close()
    for number, file in enumerate(files):
        there = tmp_path / f"there {number}"
        command("", "restore", file, "--data", there)
        store = Store(there, Limits())
        assert picture(store, sessions) == before
        picture(store, [busy])
        store.close()


def test_what_is_deleted_while_it_is_copied_is_left_out(tmp_path, command, monkeypatch):
    """Its rows are in the copy already, its file is gone when its turn comes."""
    here, there, file = tmp_path / "here", tmp_path / "there", tmp_path / "backup.zip"
    store = Store(here, Limits())
    (one, other), _ = filled(store)
    before = picture(store, [other])
    originals = ridetune.app.storage.backup._originals

    def deleted_by_then(*given):
        store.sessions.delete(one)
        return originals(*given)

    monkeypatch.setattr("ridetune.app.storage.backup._originals", deleted_by_then)
    command("", "backup", "--data", here, "-o", file)
    store.close()
    command("", "restore", file, "--data", there)
    store = Store(there, Limits())
    assert picture(store, [other]) == before
    assert store.measurements.of_session(one)[0].name == "run.csv"
    assert len(store.measurements.of_session(one)) == 1
    store.close()


def test_a_damaged_data_directory_is_told_and_no_backup_left(tmp_path, capsys, monkeypatch):
    """An original that is missing, or not what its name says."""
    monkeypatch.delenv("RIDETUNE_DATABASE", raising=False)
    store = Store(tmp_path / "here", Limits())
    session, _ = store.sessions.create(CAR, [])
    place = store.measurements.original(store.measurements.add(session, recording(b"0 1 2")))
    file = tmp_path / "backup.zip"
    command = ("backup", "--data", str(tmp_path / "here"), "-o", str(file))
    place.write_bytes(b"0 1 3")
    assert f"{place} is damaged" in refused(capsys, *command)
    place.unlink()
    assert f"{place} is missing" in refused(capsys, *command)
    assert list(tmp_path.iterdir()) == [tmp_path / "here"]
    store.close()
    elsewhere = ("backup", "--data", str(tmp_path / "nowhere"), "-o", str(file))
    assert "There is no ridetune.sqlite" in refused(capsys, *elsewhere)


@pytest.fixture
def backup(tmp_path, command) -> Path:
    """Of a service with something of every kind."""
    store = Store(tmp_path / "here", Limits())
    filled(store)
    store.close()
    file = tmp_path / "backup.zip"
    command("", "backup", "--data", tmp_path / "here", "-o", file)
    return file


def changed(file: Path, change: Callable[[dict[str, bytes]], None]) -> None:
    """Write an archive anew with other members."""
    with ZipFile(file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    change(members)
    with ZipFile(file, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)


def told(change: Callable[[dict], None]) -> Callable[[dict[str, bytes]], None]:
    """Change what the archive says of itself."""

    def retold(members: dict[str, bytes]) -> None:
        manifest = json.loads(members["backup.json"])
        change(manifest)
        members["backup.json"] = json.dumps(manifest).encode()

    return retold


def original(members: dict[str, bytes]) -> str:
    return next(name for name in members if name.startswith("originals/"))


def escape(name: str) -> Callable[[dict[str, bytes]], None]:
    """A file that would land elsewhere, listed as any other."""

    def escaping(members: dict[str, bytes]) -> None:
        manifest = json.loads(members["backup.json"])
        one = original(members)
        members[name] = members[one]
        manifest["files"][name] = manifest["files"][one]
        members["backup.json"] = json.dumps(manifest).encode()

    return escaping


REFUSED: dict[str, tuple[Callable[[dict[str, bytes]], object], str]] = {
    "an original is another": (lambda m: m.update({original(m): b"?"}), "is not what it was"),
    "the rows are others": (lambda m: m.update({"ridetune.sqlite": b"?"}), "is not what it was"),
    "an original lacks": (lambda m: m.pop(original(m)), "is not what its backup.json lists"),
    "one more file": (lambda m: m.update(more=b""), "is not what its backup.json lists"),
    "no manifest": (lambda m: m.pop("backup.json"), "is no backup"),
    "no JSON": (lambda m: m.update({"backup.json": b"{"}), "backup.json cannot be read"),
    "another JSON": (lambda m: m.update({"backup.json": b"[]"}), "backup.json cannot be read"),
    "other kind": (told(lambda manifest: manifest.update(kind="x")), "is no backup"),
    "newer": (
        told(lambda manifest: manifest.update(schema_version=SCHEMA_VERSION + 1)),
        "which is newer",
    ),
    "traversal": (escape("../evil"), "a file that no backup has"),
    "absolute": (escape("/tmp/evil"), "a file that no backup has"),
    "hidden traversal": (escape("originals/ab/../../../evil"), "a file that no backup has"),
    "not its own folder": (escape("originals/00/" + "1" * 64), "a file that no backup has"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_damaged_backup_is_refused_whole(tmp_path, backup, capsys, monkeypatch, case):
    change, said = REFUSED[case]
    changed(backup, change)
    there = tmp_path / "there"
    before = set(tmp_path.rglob("*"))
    assert said in refused(capsys, "restore", str(backup), "--data", str(there))
    assert set(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("end", [0, 100, -1])
def test_a_backup_that_was_cut_off_is_refused(tmp_path, backup, capsys, end):
    backup.write_bytes(backup.read_bytes()[:end])
    there = tmp_path / "there"
    assert "is no backup, or cut off" in refused(
        capsys, "restore", str(backup), "--data", str(there)
    )
    assert not there.exists()


def test_a_bit_that_turned_over_is_found(tmp_path, backup, capsys):
    """Anywhere in the archive: by its own sums, or ours."""
    data = backup.read_bytes()
    for place in range(40, len(data), len(data) // 25):
        backup.write_bytes(data[:place] + bytes([data[place] ^ 4]) + data[place + 1 :])
        there = tmp_path / f"there {place}"
        try:
            harmless = main(["restore", str(backup), "--data", str(there)]) == 0
        finally:
            told_of = capsys.readouterr().err
        # What is turned over may be a date that nobody reads.
        assert harmless or (str(backup) in told_of and not there.exists()), place


def test_a_file_is_no_place_for_a_restore(tmp_path, backup, capsys):
    (tmp_path / "file").touch()
    told = refused(capsys, "restore", str(backup), "--data", str(tmp_path / "file"))
    assert "file cannot be used (" in told
    assert (tmp_path / "file").is_file()


def test_a_folder_is_no_backup(tmp_path, capsys):
    there = tmp_path / "there"
    assert "cannot be read" in refused(capsys, "restore", str(tmp_path), "--data", str(there))


def test_what_is_there_is_not_written_over(tmp_path, backup, command, capsys, on_postgresql):
    def said(*arguments: object) -> str:
        return refused(capsys, *map(str, arguments))

    assert "holds data already" in said("restore", backup, "--data", tmp_path / "here")
    shared = tmp_path / "shared"
    store = Store(shared, Limits(), on_postgresql)
    store.sessions.create(CAR, [])
    store.close()
    assert "holds data already" in said("restore", backup, "--data", shared)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RIDETUNE_DATABASE", on_postgresql)
        assert "is not empty" in said("restore", backup, "--data", shared)
    assert list((shared / "originals").rglob("*")) == []


def test_a_restore_into_a_database_in_use_claims_no_directory(
    tmp_path, backup, command, capsys, monkeypatch, on_postgresql, postgresql
):
    """Oracle: the same directory goes with an empty database afterwards."""
    store = Store(tmp_path / "shared", Limits(), on_postgresql)
    store.sessions.create(CAR, [])
    store.close()
    monkeypatch.setenv("RIDETUNE_DATABASE", on_postgresql)
    there = tmp_path / "there"
    assert "is not empty" in refused(capsys, "restore", str(backup), "--data", str(there))
    assert not there.exists()
    with postgresql.database() as empty:
        command(empty, "restore", backup, "--data", there)


def test_a_restore_over_a_key_of_the_same_name_is_refused(
    tmp_path, command, capsys, monkeypatch, on_postgresql
):
    """Of which only one could be kept; nothing is restored."""
    here, there, file = tmp_path / "here", tmp_path / "there", tmp_path / "backup.zip"
    store = Store(here, Limits())
    filled(store)
    store.keys.add("rig")
    store.close()
    command("", "backup", "--data", here, "-o", file)
    command(on_postgresql, "keys", "add", "rig")
    capsys.readouterr()
    assert "is not empty" in refused(capsys, "restore", str(file), "--data", str(there))
    assert not there.exists()
    command(on_postgresql, "keys", "remove", "rig")
    command(on_postgresql, "restore", file, "--data", there)


def test_a_restore_that_fails_half_way_leaves_nothing(
    tmp_path, backup, capsys, monkeypatch, database
):
    """Neither in a new directory nor in one that was there; the same restore succeeds then."""
    monkeypatch.setenv("RIDETUNE_DATABASE", database)
    there = tmp_path / "there"
    there.mkdir()
    (there / "address").touch()
    new = tmp_path / "new"
    kept = []

    def keep(self, sha256, data):
        if len(kept) == 3:
            raise OSError(28, "No space left on device")
        kept.append(sha256)
        true(self, sha256, data)

    true = DataDirectory.keep
    with monkeypatch.context() as patch:
        patch.setattr(DataDirectory, "keep", keep)
        for data, left in ((there, [there / "address"]), (new, [])):
            kept.clear()
            command = ("restore", str(backup), "--data", str(data))
            assert "No space left on device" in refused(capsys, *command)
            assert list(data.rglob("*")) == left
    assert not new.exists()
    assert main(["restore", str(backup), "--data", str(there)]) == 0


@pytest.mark.parametrize("version", [1, 4, 6])
def test_an_older_backup_is_brought_up_to_date(tmp_path, backup, command, version, database):
    def older(members: dict[str, bytes]) -> None:
        place = tmp_path / "old.sqlite"
        engine = create_engine(f"sqlite:///{place}")
        with engine.begin() as connection:
            rows = make(connection, version)
        engine.dispose()
        members.clear()
        members["ridetune.sqlite"] = place.read_bytes()
        for sha256, data in zip(SHA256, FILES, strict=True):
            if sha256 in [row["sha256"] for row in rows["uploads"]]:
                members[f"originals/{sha256[:2]}/{sha256}"] = data
        files = {
            name: {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}
            for name, data in members.items()
        }
        manifest = {"kind": "ridetune-backup", "format": 1, "schema_version": version}
        members["backup.json"] = json.dumps({**manifest, "files": files}).encode()

    changed(backup, older)
    command(database, "restore", backup, "--data", tmp_path / "there")
    store = Store(tmp_path / "there", Limits(), database)
    assert store.owners.opens("s1", user=None, token=TOKEN)
    [kept] = store.measurements.of_session("s1")
    assert store.measurements.original(kept).read_bytes() == FILES[0]
    assert store.jobs.get("s1", "done").result == {"cost": 1.5}
    assert [job.id for job in store.leases.claim("me", 5)] == ["queued", "running"]
    with pytest.raises(NotFound):
        store.sessions.get("s2")
    store.close()
