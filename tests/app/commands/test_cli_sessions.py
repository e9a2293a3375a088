"""`ridetune sessions` beside a store that a service has open, with either database."""

import re

import pytest
from ridetune.app.cli import main
from ridetune.app.errors import Unavailable
from ridetune.app.limits import Limits
from ridetune.app.storage.measurement import NewMeasurement
from ridetune.app.storage.store import Store

from ..command_line import refused

CAR = {"name": "a car"}


def recording(data: bytes) -> NewMeasurement:
    return NewMeasurement("run.csv", data, {}, {})


@pytest.fixture
def store(tmp_path, database, monkeypatch):
    monkeypatch.setenv("RIDETUNE_DATABASE", database)
    monkeypatch.setenv("RIDETUNE_DATA", str(tmp_path / "data"))
    store = Store(tmp_path / "data", Limits(), database)
    yield store
    store.close()


def listed(capsys) -> list[list[str]]:
    """Cells of the table's rows without its head."""
    assert main(["sessions", "list"]) == 0
    return [re.split(r"  +", line.strip()) for line in capsys.readouterr().out.splitlines()[1:]]


def test_the_list_tells_whose_a_session_is_and_what_it_holds(store, capsys):
    owners = (None, "key:rig 3", "user:anna\x1b[2J")
    made = [store.sessions.create(CAR, [recording(b"0" * 400_000)], owner)[0] for owner in owners]
    store.sessions.rename(made[2], "car 7\u200d of Anna")
    store.measurements.add(made[0], recording(b"1" * 500_000))
    job, _ = store.jobs.add(made[0], "test", {"runs": [], "asked": "a fit"}, None)
    store.finish_job(job.id, "done", result={}, file=b"2" * 600_000)
    by_id = {row[0]: row[1:] for row in listed(capsys)}
    assert set(by_id) == set(made)
    for id, told in zip(
        made,
        (
            ["a browser", "2", "1", "1.5", "Project"],
            ["key rig 3", "1", "0", "0.4", "Project"],
            ["user anna?[2J", "1", "0", "0.4", "car 7? of Anna"],
        ),
        strict=True,
    ):
        assert [by_id[id][0], *by_id[id][3:]] == told
        assert all(re.fullmatch(r"[\d-]{10} [\d:]{5}", moment) for moment in by_id[id][1:3])


def test_no_session_is_told_with_the_place(store, capsys):
    assert main(["sessions", "list"]) == 0
    where = "the database of" if store.database.shared else str(store.directory.path)
    assert where in capsys.readouterr().out


def test_what_is_removed_goes_as_at_a_delete(store, capsys):
    """Rows and files, but for those that another session has; the room is there again."""
    shared, own = recording(b"sample"), recording(b"own")
    gone, stays = (store.sessions.create(CAR, [shared])[0] for _ in "ab")
    store.measurements.add(gone, own)
    job, _ = store.jobs.add(gone, "test", {"runs": [], "asked": "a fit"}, None)
    store.keep_part(job.id, "first", b"part")
    assert store.leases.claim("me", 1)
    assert main(["sessions", "remove", gone]) == 0
    assert gone in capsys.readouterr().out
    assert [row[0] for row in listed(capsys)] == [stays]
    assert store.leases.heartbeat("me").jobs == frozenset()
    [kept] = store.measurements.of_session(stays)
    assert set(store.directory.names()) == {store.measurements.original(kept).name}


def test_of_several_all_are_removed_or_none(store, capsys):
    made = [store.sessions.create(CAR, [])[0] for _ in "ab"]
    told = refused(capsys, "sessions", "remove", made[0], "\udcff", made[1])
    assert "There is no session '\\udcff'; `ridetune sessions list` shows" in told
    assert {row[0] for row in listed(capsys)} == set(made)
    assert main(["sessions", "remove", *made, made[0]]) == 0
    capsys.readouterr()
    assert listed(capsys) == []


def test_files_are_not_left_behind_in_another_directory(store, capsys, tmp_path):
    session, _ = store.sessions.create(CAR, [recording(b"0 1 2")])
    elsewhere = ("sessions", "remove", session, "--data", str(tmp_path / "none"))
    assert "No service has used the data directory" in refused(capsys, *elsewhere)
    assert [row[0] for row in listed(capsys)] == [session]


def test_where_the_service_is_full_the_remedy_is_told(tmp_path):
    store = Store(tmp_path, Limits(sessions=1))
    store.sessions.create(CAR, [])
    with pytest.raises(Unavailable, match="`ridetune sessions`"):
        store.sessions.create(CAR, [])
    store.close()
