"""Children that read files: how many there are, and who is refused while they are at work."""

import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from ridetune.app.errors import NotFound
from ridetune.app.limits import Limits
from ridetune.app.recordings.recordings import Recordings
from ridetune.app.settings import Settings
from ridetune.engine.errors import MeasurementError
from ridetune.engine.formats import child

from ..conftest import Visitor, open_client, short_recording

PATIENCE = 60.0


class Gate:
    """Holds every child back until it is opened, and counts them."""

    def __init__(self):
        self.open, self.started, self.now, self.most = threading.Event(), 0, 0, 0
        self.came = threading.Semaphore(0)
        self._lock = threading.Lock()

    def count(self, more: int) -> None:
        with self._lock:
            self.now += more
            self.started += more > 0
            self.most = max(self.most, self.now)


@pytest.fixture
def gate(monkeypatch) -> Gate:
    gate = Gate()

    class Held(child.ChildTable):
        def __init__(self, *place, **told):
            gate.count(1)
            gate.came.release()
            assert gate.open.wait(PATIENCE)
            super().__init__(*place, **told)

        def close(self) -> None:
            gate.count(-1)
            super().close()

    monkeypatch.setattr(child, "ChildTable", Held)
    return gate


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    limits = Limits(readers=1, session_readings=4, waiting_readings=5)
    with open_client(Settings(data=tmp_path_factory.mktemp("reading"), limits=limits)) as client:
        yield client


def wait_for(client, under_way: int) -> None:
    """Until so many requests run or wait."""
    deadline = time.monotonic() + PATIENCE
    while client.app.state.services.readers.under_way < under_way:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_one_child_reads_for_all_who_want_the_same(client, gate):
    """As after a start of the service, which has nothing in memory."""
    visitor = Visitor(client)
    gate.open.set()
    kept = visitor.upload(short_recording()).json()
    shared, gate.started = client.app.state.services, 0
    recordings = Recordings(shared.store)
    measurement = shared.store.measurements.get(visitor.id, kept["id"])
    with ThreadPoolExecutor(8) as pool:
        runs = list(pool.map(lambda _: recordings.run(measurement), range(8)))
    assert {run.duration for run in runs} == {kept["duration"]}
    assert gate.started == 1


def test_whatever_reading_needs_lies_in_the_data_directory(client, gate, monkeypatch):
    """Nothing else could be written; and it is gone afterwards."""
    monkeypatch.setattr(tempfile, "tempdir", "/nowhere")
    gate.open.set()
    visitor, folder = Visitor(client), client.app.state.services.store.directory.reading
    kept = visitor.upload(short_recording().replace(b"time", b"Zeit")).json()
    assert visitor.get(f"/measurements/{kept['id']}/columns").status_code == 200
    assert gate.started == 2
    assert list(folder.iterdir()) == []


def test_what_piles_up_is_refused_with_the_time_to_try_again(client, gate):
    """One child may run, a session has four requests under way, all have five."""
    greedy, modest = Visitor(client), Visitor(client)
    with ThreadPoolExecutor(5) as pool:
        sent = [pool.submit(greedy.upload, short_recording()) for _ in range(4)]
        assert gate.came.acquire(timeout=PATIENCE)
        wait_for(client, 4)
        refused = greedy.upload(short_recording())
        assert (refused.status_code, refused.headers["Retry-After"]) == (429, "5")
        sent.append(pool.submit(modest.upload, short_recording()))
        wait_for(client, 5)
        refused = modest.upload(short_recording())
        assert (refused.status_code, refused.headers["Retry-After"]) == (503, "5")
        assert "busy with 5 files to read" in refused.json()["detail"]
        # Nobody is kept from what needs no file.
        assert modest.get("/measurements").status_code == 200
        gate.open.set()
        assert [one.result().status_code for one in sent] == [201] * 5
    assert gate.most == 1


def test_two_changes_of_one_recording_are_done_one_after_the_other(client, gate):
    """Oracle: the histories under both, which are what the summary kept with it must be of."""
    visitor = Visitor(client)
    gate.open.set()
    path = f"/measurements/{visitor.upload(short_recording()).json()['id']}"
    mapping = visitor.get(f"{path}/columns").json()["proposed"]
    next(one for one in mapping["columns"] if one["channel"] == "chassis.z")["gain"] = 2.0
    steps = [{"kind": "scale", "channel": "chassis.z", "bias": 0.001}]
    while gate.came.acquire(blocking=False):
        pass
    gate.open.clear()
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(visitor.put, f"{path}/mapping", json=mapping)
        assert gate.came.acquire(timeout=PATIENCE)
        second = pool.submit(visitor.put, f"{path}/conditioning", json={"steps": steps})
        wait_for(client, 2)
        gate.open.set()
        assert [first.result().status_code, second.result().status_code] == [200, 200]
    heights = visitor.get(f"{path}/frames?channels=chassis.z").json()["values"]["chassis.z"]
    assert max(heights) == pytest.approx(0.007)
    found = {one["name"]: one for one in visitor.get(path).json()["channels"]}
    assert found["chassis.z"]["maximum"] == pytest.approx(max(heights))


def test_a_file_is_read_again_under_a_name_of_another_kind(client, gate):
    """The same bytes are a CSV to one name and to another no MAT file."""
    visitor = Visitor(client)
    gate.open.set()
    kept = visitor.upload(short_recording(), "run.csv").json()
    shared = client.app.state.services
    measurement = shared.store.measurements.get(visitor.id, kept["id"])
    assert shared.recordings.run(measurement).name == "run.csv"
    with pytest.raises(MeasurementError, match=r"run\.mat: the file is no MAT file"):
        shared.recordings.run(replace(measurement, name="run.mat"))


def test_a_recording_that_is_deleted_while_it_waits_to_be_read_is_not_found(client, gate):
    visitor = Visitor(client)
    gate.open.set()
    kept = visitor.upload(short_recording(samples=57)).json()
    shared = client.app.state.services
    measurement = shared.store.measurements.get(visitor.id, kept["id"])
    assert visitor.delete(f"/measurements/{kept['id']}").status_code == 204
    with pytest.raises(NotFound, match=r"run\.csv has been deleted meanwhile"):
        Recordings(shared.store).run(measurement)
