"""Processes that simulate: what they give back, what they ask, and what losing one costs."""

import errno
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import psutil
import pytest
from ridetune.app import errors as of_service
from ridetune.app.errors import Busy, Unavailable
from ridetune.app.recordings.lent import LentRecordings
from ridetune.app.simulators import simulators as module
from ridetune.app.simulators.simulators import Simulators
from ridetune.app.storage.measurement import Measurement
from ridetune.app.work.samples import sample_project
from ridetune.engine.errors import RideError, SimulationDiverged
from ridetune.engine.measurement import read_run
from ridetune.engine.simulation.rims_settings import RimsSettings

from ..conftest import SAMPLES, Visitor
from ..live import LiveService
from . import simulator_work as work

SAMPLE = SAMPLES / "detailed" / "manoeuvre_1.csv"


@pytest.fixture(scope="module")
def recording() -> Measurement:
    new = sample_project().measurements[0]
    rest = {"manoeuvre": None, "mapping": None, "conditioning": None, "conditioned": None}
    known = {"noise": dict(new.noise), "summary": dict(new.summary), "sample": True, **rest}
    return Measurement("m", new.name, "0" * 64, len(new.data), 0.0, **known)


@pytest.fixture
def two():
    simulators = Simulators(2)
    yield simulators
    simulators.close()


def test_work_runs_elsewhere_where_all_is_loaded(two):
    """Oracle: process ids; a session's work stays where it was, and all have begun at the start."""
    two.start()
    assert two.count() == 2
    (first, loaded), (again, _) = (two.run("a", work.process) for _ in range(2))
    assert first == again != os.getpid()
    assert loaded


def test_two_work_at_the_same_time_where_one_is_taken(two):
    """The second session's usual place may be the first's; it takes the other."""
    with ThreadPoolExecutor(2) as threads:
        busy = threads.submit(two.run, "a", work.slept, 1.0)
        time.sleep(0.2)
        here, _ = two.run("a", work.process)
        assert not busy.done()
        busy.result()
    assert two.count() == 2
    assert here in {child.pid for child in psutil.Process().children(recursive=True)}


def test_an_error_comes_back_as_it_was_raised(two):
    with pytest.raises(SimulationDiverged, match=r"^The simulation diverged at t = 1\.500 s") as it:
        two.run("a", work.diverged)
    assert (it.value.time, it.value.coordinate) == (1.5, "chassis.z")


def _kinds(kind: type[RideError]):
    yield kind
    for one in kind.__subclasses__():
        yield from _kinds(one)


def test_every_error_goes_between_processes():
    """Whatever its constructor takes: kind, sentence and what else it knows."""
    assert {of_service.StorageFull, SimulationDiverged} <= set(_kinds(RideError))
    for kind in _kinds(RideError):
        error = RideError.__new__(kind)
        error.args = ("Name the place.",)
        error.field, error.headers = "step", {"Retry-After": "3"}
        copy = pickle.loads(pickle.dumps(error))
        assert (type(copy), str(copy), vars(copy)) == (kind, "Name the place.", vars(error))


def test_a_fault_tells_where_it_happened(two):
    with pytest.raises(RuntimeError, match=r"(?s)in broken.*ZeroDivisionError"):
        two.run("a", work.broken)
    assert two.lost == 0


def test_work_asks_the_service(two):
    """What it answers goes back, and its refusal is raised here as it is."""
    refusal = Busy("Later.", retry_after=7)

    def refuse(seconds: float) -> None:
        raise refusal

    assert two.run("a", work.asked, "sum", 1, 2, sum=lambda *numbers: sum(numbers)) == 3
    with pytest.raises(Busy) as raised:
        two.run("a", work.asked, "charge", 1.0, charge=refuse)
    assert raised.value is refusal
    assert two.run("a", work.asked, "sum", 3, sum=lambda *numbers: sum(numbers)) == 3


def test_a_recording_is_fetched_once_as_it_is_told(recording):
    """Oracle: the fetched ones; other noise is another run, from which nothing else moves."""
    fetched = []

    def fetch(measurement: Measurement):
        fetched.append(measurement)
        return replace(read_run(SAMPLE), noise=measurement.noise)

    lent, louder = LentRecordings(fetch), replace(recording, noise={"chassis.z": 0.5})
    for one in (recording, louder, recording, louder):
        assert lent.run(one).noise == one.noise
    assert fetched == [recording, louder]
    settings = RimsSettings()
    motions = [lent.motion(one, settings, [(1.0, 2.0)]) for one in (recording, louder)]
    assert motions[0].stage_inputs is motions[1].stage_inputs
    assert [motion.run.noise for motion in motions] == [recording.noise, louder.noise]
    assert motions[0].run.braking == ((1.0, 2.0),)


def test_a_simulator_remembers_recordings(recording):
    """Fetched by the first work of a process, not by the next."""
    fetched = []

    def fetch(measurement: Measurement):
        fetched.append(measurement.id)
        return read_run(SAMPLE)

    one = Simulators(1)
    try:
        runs = [one.run("a", work.run_of, recording, recording=fetch) for _ in range(2)]
        twice = [recording, recording]
        assert one.run("a", work.motions, twice, RimsSettings(), recording=fetch) == 1
    finally:
        one.close()
    assert fetched == ["m"]
    assert [run.duration for run in runs] == [read_run(SAMPLE).duration] * 2


def test_one_that_was_killed_is_replaced(two):
    before, _ = two.run("a", work.process)
    os.kill(before, signal.SIGKILL)
    after, loaded = two.run("a", work.process)
    assert after != before
    assert loaded
    assert two.lost == 1


def test_work_whose_process_is_lost_is_done_again(two, tmp_path):
    before, _ = two.run("a", work.process)
    assert two.run("a", work.killed_once, str(tmp_path / "mark")) != before
    assert two.lost == 1


def test_work_that_ends_its_process_is_refused_and_nothing_else(two):
    with pytest.raises(Unavailable, match=r"^The process that computed this was lost"):
        two.run("a", work.killed)
    assert two.lost == 2
    assert two.run("a", work.told_to_end) == "done"


@pytest.mark.parametrize("size", [10, 10_000_000], ids=["that is taken", "that is not"])
def test_one_that_is_silent_is_replaced(monkeypatch, size):
    """Stopped, not ended, whether the socket takes what it is told or not: once patience is at its
    end it is killed, and the next one works.
    """
    monkeypatch.setattr(module, "ENDING", 0.1)
    impatient = Simulators(1, patience=1.0)
    try:
        before, _ = impatient.run("a", work.process)
        os.kill(before, signal.SIGSTOP)
        with pytest.raises(Unavailable):
            impatient.run("a", work.length, bytes(size))
        assert not psutil.pid_exists(before) or psutil.Process(before).status() == "zombie"
        assert impatient.lost == 1
        assert impatient.run("a", work.process)[0] != before
    finally:
        impatient.close()


def test_what_broke_off_is_not_taken_for_the_next_answer():
    """An answer that cannot be sent: the simulator still waits for it, and is replaced."""
    one = Simulators(1)
    try:
        before, _ = one.run("a", work.process)
        with pytest.raises(Exception, match="pickle"):
            one.run("a", work.asked, "lock", lock=threading.Lock)
        assert one.run("b", work.length, b"four") == 4
        assert one.run("b", work.process)[0] != before
        assert one.lost == 1
    finally:
        one.close()


def test_one_that_cannot_be_started_is_told(two, monkeypatch):
    """As where too many files are open; later it can."""

    def too_many():
        raise OSError(errno.EMFILE, "Too many open files")

    with monkeypatch.context() as without:
        without.setattr(module.processes, "Pipe", too_many)
        with pytest.raises(Unavailable, match=r"^A process that simulates could not") as refused:
            two.run("a", work.process)
    assert refused.value.headers == {"Retry-After": "5"}
    assert two.lost == 0
    assert two.run("a", work.length, b"four") == 4


def test_one_that_ends_at_its_start_is_told(two, monkeypatch):
    with monkeypatch.context() as without:
        without.setattr(module, "simulator", os._exit)
        with pytest.raises(Unavailable, match=r"^A process that simulates could not"):
            two.run("a", work.process)
    assert two.run("a", work.length, b"four") == 4


def test_closed_they_are_gone_and_begin_no_more(two):
    two.start()
    ended = [two.run(session, work.process)[0] for session in "ab"]
    two.close()
    assert two.count() == 0
    assert not any(psutil.pid_exists(one) for one in ended)
    with pytest.raises(Unavailable, match="about to end"):
        two.run("a", work.process)


def test_told_to_end_with_the_service_they_go_on_with_what_they_do(two):
    """A terminal and a service manager tell all processes of a service; it ends them itself."""
    assert two.run("a", work.told_to_end) == "done"
    assert two.lost == 0


def test_nothing_is_left_of_a_service_that_was_killed(tmp_path):
    with LiveService(tmp_path) as service:
        visitor = Visitor(service.ready().client)
        asked = {"manoeuvre": "bump", "max_samples": 2}
        assert visitor.post("/simulations", json=asked).status_code == 200
        children = psutil.Process(service.process.pid).children(recursive=True)
        assert len(children) > 2
        service.kill()
        _, alive = psutil.wait_procs(children, timeout=10)
        assert alive == []


LEAN = """
import sys
from pathlib import Path
from fastapi.testclient import TestClient
from ridetune.app.main import create_app
from ridetune.app.settings import Settings

if __name__ == "__main__":
    settings = Settings(data=Path(sys.argv[1]), login=False)
    app = create_app(settings, warm_up=lambda *_: None)
    with TestClient(app, base_url="http://127.0.0.1:8000") as client:
        session = client.post("/api/sessions").json()
        place = f"/api/sessions/{session['id']}"
        runs = [one["id"] for one in client.get(f"{place}/measurements").json()]
        bump = {"manoeuvre": "bump", "duration": 1}
        levels = {"kind": "full-factorial", "levels": {"K_F": [15_000]}}
        for name, asked in {
            "simulations": bump,
            "simulations?": {"rims": {"measurement": runs[0]}},
            "advice": {"candidates": ["bump"]},
            "sweeps": {**bump, "design": levels},
            "identifications": {"runs": runs},
            "campaigns": {"manoeuvres": ["bump"]},
        }.items():
            reply = client.post(f"{place}/{name}", json=asked)
            assert reply.status_code in (200, 202), reply.text
        print("numba" in sys.modules)
"""


def test_the_service_itself_never_loads_the_compiler(tmp_path):
    """Which takes a second of Python's lock and a hundred megabytes."""
    command = [sys.executable, "-c", LEAN, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.stdout == "False\n", done.stderr
