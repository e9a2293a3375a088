"""The seam to Dask: results, progress, cancelling, lost workers, on both kinds of cluster."""

import json
import os
import queue
import signal
import threading
from collections.abc import Callable
from contextlib import suppress

import cloudpickle
import psutil
import pytest
from ridetune.app.cluster import Cluster
from ridetune.app.errors import Unavailable
from ridetune.app.worker import MOST_KEPT, Ending

from . import tasks
from .dask_processes import DaskProcesses, make_certificates
from .waiting import until

PATIENCE = 60.0

cloudpickle.register_pickle_by_value(tasks)


class Heard:
    """A listener that writes down what it is told."""

    def __init__(self):
        self.started: queue.Queue[str] = queue.Queue()
        self.progress: queue.Queue[tuple[str, dict]] = queue.Queue()
        self.ends: queue.Queue[tuple[str, Ending]] = queue.Queue()
        self.kept: queue.Queue[tuple[str, str, bytes]] = queue.Queue()
        self.lost: queue.Queue[tuple[str, bool]] = queue.Queue()

    def task_started(self, task):
        self.started.put(task)

    def task_progressed(self, task, progress):
        self.progress.put((task, dict(progress)))

    def task_kept(self, task, part, data):
        self.kept.put((task, part, data))

    def task_ended(self, task, ending):
        self.ends.put((task, ending))

    def task_lost(self, task, *, with_worker):
        self.lost.put((task, with_worker))

    def end_of(self, task: str) -> Ending:
        name, ending = self.ends.get(timeout=PATIENCE)
        assert name == task
        return ending


@pytest.fixture(scope="module", params=["own workers", "a scheduler elsewhere"])
def cluster(request, tmp_path_factory):
    """Two workers: of its own, and two that a scheduler in another process has, behind TLS."""
    scratch = tmp_path_factory.mktemp("dask")
    if request.param == "own workers":
        cluster = Cluster("", scratch, workers=2)
    else:
        far = request.getfixturevalue("dask_processes")
        cluster = Cluster(far.address, scratch, certificates=far.certificates)
    yield cluster
    cluster.close()


@pytest.fixture
def heard() -> Heard:
    return Heard()


def test_a_task_gives_its_result_and_reports_on_the_way(cluster, heard):
    """At the lowest priority, in another process, with the progress told as it comes."""
    cluster.submit("double", tasks.double, 21, heard)
    ending = heard.end_of("double")
    assert ending["state"] == "done"
    assert ending["progress"] == {"cost": 0.5}
    assert ending["result"] is not None
    assert ending["result"]["value"] == 42
    assert ending["result"]["priority"] == 19
    assert ending["result"]["process"] != os.getpid()
    assert heard.started.get(timeout=1) == "double"
    told = [heard.progress.get(timeout=1) for _ in range(2)]
    assert told == [("double", {"cost": 1.0}), ("double", {"cost": 0.5})]


def test_a_worker_logs_as_the_service_does_and_names_the_job(cluster, heard):
    cluster.submit("noted/7", tasks.note, "half way", heard)
    told = heard.end_of("noted/7")["result"]
    assert told is not None
    assert told["formatter"] == "TextLines"
    line = json.loads(told["line"])
    assert [line[name] for name in ("job", "unit", "message")] == ["noted", "7", "half way"]


def test_a_file_comes_back_byte_for_byte(cluster, heard):
    data = bytes(range(256)) * 1000
    cluster.submit("write", tasks.write, data, heard)
    ending = heard.end_of("write")
    assert ending["result"] == {"rows": len(data)}
    assert ending["file"] == data


def test_parts_come_back_on_the_way_and_go_out_with_the_next_attempt(cluster, heard):
    """Byte for byte; what is not small has no place in the scheduler's memory."""
    data = bytes(range(256))
    cluster.submit("halfway", tasks.halfway, data, heard)
    assert heard.end_of("halfway")["state"] == "done"
    assert heard.kept.get(timeout=PATIENCE) == ("halfway", "half", data)
    cluster.submit("kept", tasks.kept, None, heard, kept={"half": data})
    assert heard.end_of("kept")["result"] == {"half": data.hex()}
    cluster.submit("large", tasks.halfway, bytes(MOST_KEPT + 1), heard)
    ending = heard.end_of("large")
    assert ending["error"] is not None
    assert ending["error"]["code"] == "internal"


def test_a_running_task_stops_when_asked(cluster, heard):
    cluster.submit("wait", tasks.wait, None, heard)
    heard.progress.get(timeout=PATIENCE)
    cluster.cancel("wait", grace=30.0)
    assert heard.end_of("wait")["state"] == "cancelled"


def test_a_deaf_task_is_killed_after_its_grace_and_the_worker_replaced(cluster, heard):
    """Both workers are taken by two tasks at once afterwards."""
    cluster.submit("deaf", tasks.ignore, None, heard)
    heard.progress.get(timeout=PATIENCE)
    cluster.cancel("deaf", grace=0.2)
    assert heard.end_of("deaf")["state"] == "cancelled"
    for name in ("left", "right"):
        cluster.submit(name, tasks.wait, None, heard)
    assert {heard.started.get(timeout=PATIENCE) for _ in range(3)} == {"deaf", "left", "right"}
    for name in ("left", "right"):
        cluster.cancel(name, grace=30.0)
        assert heard.end_of(name)["state"] == "cancelled"


def frozen(cluster: Cluster, heard: Heard) -> int:
    """The process of a worker that was stopped within the task "frozen", as by a debugger."""
    cluster.submit("frozen", tasks.ignore, None, heard)
    process = heard.progress.get(timeout=PATIENCE)[1]["process"]
    os.kill(process, signal.SIGSTOP)
    return process


def in_time(work: Callable[[], object]) -> bool:
    """Whether something that may hang comes to its end."""
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(PATIENCE)
    return not thread.is_alive()


def test_a_frozen_worker_keeps_no_other_task_from_being_cancelled(cluster, heard):
    """Neither one that stops nor one that has to be killed; then it is killed itself."""
    until(lambda: cluster.width() == 2)
    process = frozen(cluster, heard)
    try:
        for name, task in (("soft", tasks.wait), ("deaf", tasks.ignore)):
            cluster.submit(name, task, None, heard)
            heard.progress.get(timeout=PATIENCE)
            assert in_time(lambda name=name: cluster.cancel(name, grace=0.2))
            assert heard.end_of(name)["state"] == "cancelled"
        assert in_time(lambda: cluster.cancel("frozen", grace=0.2))
        assert heard.end_of("frozen")["state"] == "cancelled"
        until(lambda: not psutil.pid_exists(process))
    finally:
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGCONT)


def test_a_frozen_worker_does_not_keep_a_cluster_from_closing(tmp_path, heard):
    cluster = Cluster("", tmp_path, workers=1)
    process = frozen(cluster, heard)
    try:
        assert in_time(cluster.close)
        assert not psutil.pid_exists(process)
    finally:
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGCONT)


def test_a_worker_that_ends_with_its_cluster_does_not_warn_of_its_task(tmp_path, heard, capfd):
    """As Dask would; whoever closes the cluster knows."""
    cluster = Cluster("", tmp_path, workers=1)
    cluster.submit("deaf", tasks.ignore, None, heard)
    heard.started.get(timeout=PATIENCE)
    cluster.close()
    assert "CancelledError" not in capfd.readouterr().err


def test_a_task_that_waits_for_a_worker_is_cancelled_at_once(cluster, heard):
    for name in ("first", "second", "third"):
        cluster.submit(name, tasks.wait, None, heard)
    for _ in range(2):
        heard.started.get(timeout=PATIENCE)
    cluster.cancel("third", grace=30.0)
    assert heard.end_of("third")["state"] == "cancelled"
    for name in ("first", "second"):
        cluster.cancel(name, grace=30.0)
        assert heard.end_of(name)["state"] == "cancelled"


def test_a_task_whose_worker_dies_is_tried_again(cluster, heard, tmp_path):
    cluster.submit("phoenix", tasks.die_once, str(tmp_path / "died"), heard)
    ending = heard.end_of("phoenix")
    assert (ending["state"], ending["result"]) == ("done", {"value": "second time"})


def test_a_task_that_kills_every_worker_fails_and_the_others_do_not(cluster, heard):
    cluster.submit("poison", tasks.poison, None, heard)
    ending = heard.end_of("poison")
    assert ending["state"] == "failed"
    assert ending["error"] is not None
    assert ending["error"]["code"] == "worker-lost"
    cluster.submit("after", tasks.double, 1, heard)
    assert heard.end_of("after")["state"] == "done"


def test_what_the_caller_can_mend_comes_back_as_its_sentence(cluster, heard):
    """Also for an error that cannot be pickled."""
    cluster.submit("refuse", tasks.refuse, None, heard)
    ending = heard.end_of("refuse")
    assert ending["state"] == "failed"
    assert ending["error"] == {
        "code": "simulation-diverged",
        "detail": "The simulation diverged at t = 1.250 s in chassis.roll; soften it.",
    }


def test_an_unforeseen_error_is_logged_here_and_not_told(cluster, heard, caplog):
    cluster.submit("crash", tasks.crash, None, heard)
    ending = heard.end_of("crash")
    assert ending["error"] is not None
    assert ending["error"]["code"] == "internal"
    assert "secret" not in ending["error"]["detail"]
    assert "secret detail" in caplog.text


def test_an_idle_cluster_leaves_and_comes_back(tmp_path, heard):
    """Its processes are gone once nothing has run for a while; the next task starts new ones."""
    cluster = Cluster("", tmp_path, workers=1, idle_seconds=0.1)
    try:
        cluster.submit("one", tasks.double, 1, heard)
        ending = heard.end_of("one")
        assert ending["result"] is not None
        first = ending["result"]["process"]
        until(lambda: not psutil.pid_exists(first))
        cluster.submit("two", tasks.double, 2, heard)
        assert heard.end_of("two")["state"] == "done"
    finally:
        cluster.close()


def test_it_tells_how_wide_it_is_and_what_became_of_its_tasks(cluster, heard):
    until(lambda: cluster.width() == 2)  # where tests before have killed some
    before = cluster.became.copy()
    cluster.submit("one", tasks.double, 1, heard)
    cluster.submit("two", tasks.refuse, 1, heard)
    for _ in range(2):
        heard.ends.get(timeout=PATIENCE)
    assert cluster.became - before == {"submitted": 2, "done": 1, "failed": 1}
    until(lambda: cluster.workers() == 2)


def test_a_scheduler_that_was_lost_is_found_again(tmp_path, heard, caplog):
    """What ran is told to be lost, with no blame; at first nothing can be submitted, then it can,
    and the new scheduler's tasks are heard of. Its workers end with it and are started again. The
    log tells of it in sentences."""
    folder = tmp_path / "far"
    folder.mkdir()
    far = DaskProcesses(folder, make_certificates(folder))
    far.start_scheduler()
    far.start_worker()
    cluster = Cluster(far.address, tmp_path, certificates=far.certificates)
    try:
        cluster.submit("lost", tasks.wait, None, heard)
        assert heard.progress.get(timeout=PATIENCE)[0] == "lost"
        far.scheduler.kill()
        far.scheduler.wait()
        assert heard.lost.get(timeout=PATIENCE) == ("lost", False)
        until(lambda: is_away(cluster))
        far.start_scheduler(port=int(far.address.rpartition(":")[2]))
        far.start_worker()
        until(lambda: not is_away(cluster))
        cluster.submit("again", tasks.double, 21, heard)
        ending = heard.end_of("again")
        assert ending["result"] is not None
        assert ending["result"]["value"] == 42
        assert {heard.started.get(timeout=PATIENCE) for _ in range(2)} == {"lost", "again"}
        assert heard.progress.get(timeout=PATIENCE) == ("again", {"cost": 1.0})
        assert any("lost the workers" in record.message for record in caplog.records)
        assert not [record for record in caplog.records if record.exc_info]
    finally:
        cluster.close()
        far.close()


def test_a_scheduler_that_was_away_while_nobody_needed_it_is_found_again(tmp_path, heard):
    """For so long that Dask's client has closed itself."""
    folder = tmp_path / "far"
    folder.mkdir()
    far = DaskProcesses(folder, make_certificates(folder))
    far.start_scheduler()
    cluster = Cluster(far.address, tmp_path, certificates=far.certificates)
    try:
        cluster.width()
        far.scheduler.kill()
        far.scheduler.wait()
        until(lambda: cluster._client.status == "closed")
        assert cluster.workers() == 0
        far.start_scheduler(port=int(far.address.rpartition(":")[2]))
        far.start_worker()
        until(lambda: not is_away(cluster))
        cluster.submit("again", tasks.double, 21, heard)
        assert heard.end_of("again")["state"] == "done"
    finally:
        cluster.close()
        far.close()


CLOSES = {
    "before": lambda client, submit: (client.close(), submit()),
    "after": lambda client, submit: (submit(), client.close())[0],
}


@pytest.mark.parametrize("when", CLOSES)
def test_a_client_that_closes_itself_as_a_task_is_sent_is_replaced(
    tmp_path, heard, dask_processes, when
):
    far = dask_processes
    cluster = Cluster(far.address, tmp_path, certificates=far.certificates)
    try:
        cluster.width()
        client = cluster._client
        submit = client.submit
        client.submit = lambda *told, **more: CLOSES[when](client, lambda: submit(*told, **more))
        with pytest.raises(Unavailable):
            cluster.submit("lost", tasks.double, 1, heard)
        cluster.submit("again", tasks.double, 21, heard)
        assert heard.end_of("again")["state"] == "done"
        assert cluster.became == {"submitted": 1, "done": 1}
    finally:
        cluster.close()


def test_a_client_that_closes_itself_as_it_is_looked_at_is_replaced(
    tmp_path, heard, dask_processes, monkeypatch
):
    monkeypatch.setattr("ridetune.app.cluster.LOOK_EVERY", 0.0)
    far = dask_processes
    cluster = Cluster(far.address, tmp_path, certificates=far.certificates)
    try:
        cluster.width()
        cluster._client.scheduler = None
        cluster.submit("again", tasks.double, 21, heard)
        assert heard.end_of("again")["state"] == "done"
    finally:
        cluster.close()


def test_a_task_that_cannot_be_sent_keeps_no_workers(tmp_path, heard):
    """They leave as if it had never been."""
    cluster = Cluster("", tmp_path, workers=1, idle_seconds=0.1)
    try:
        with pytest.raises(TypeError):
            cluster.submit("locked", tasks.double, threading.Lock(), heard)
        until(lambda: cluster._client is None)
        cluster.submit("after", tasks.double, 1, heard)
        assert heard.end_of("after")["state"] == "done"
    finally:
        cluster.close()


def test_what_one_service_stops_is_not_what_another_runs(tmp_path, heard, dask_processes):
    """The same task of both, on one scheduler, as when a lease was lost: each hears of its own."""
    far, other, goes_on = dask_processes, Heard(), tmp_path / "goes on"
    clusters = [Cluster(far.address, tmp_path, certificates=far.certificates) for _ in range(2)]
    try:
        clusters[0].submit("shared", tasks.wait, None, heard)
        heard.progress.get(timeout=PATIENCE)
        clusters[1].submit("shared", tasks.asked, str(goes_on), other)
        other.progress.get(timeout=PATIENCE)
        clusters[0].cancel("shared", grace=30.0)
        assert heard.end_of("shared")["state"] == "cancelled"
        goes_on.touch()
        assert other.end_of("shared")["result"] == {"asked": False}
        assert other.started.qsize() == heard.started.qsize() == 1
    finally:
        for one in clusters:
            one.close()


def is_away(cluster: Cluster) -> bool:
    try:
        cluster.width()
    except Unavailable:
        return True
    return False


def test_a_stranger_is_not_let_in(tmp_path, heard, dask_processes):
    """Certificates of another authority; whoever got in would run code there."""
    from dask import config

    strangers = make_certificates(tmp_path)
    with config.set({"distributed.comm.timeouts.connect": "2s"}):
        cluster = Cluster(dask_processes.address, tmp_path, certificates=strangers)
        assert not cluster.refused
        with pytest.raises(Unavailable):
            cluster.submit("stranger", tasks.double, 1, heard)
        assert cluster.refused
        cluster.close()


def test_workers_that_cannot_be_reached_are_a_sentence(tmp_path, heard, monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT", "1s")
    from dask import config

    with config.set({"distributed.comm.timeouts.connect": "1s"}):
        cluster = Cluster("tcp://127.0.0.1:9", tmp_path)
        with pytest.raises(Unavailable, match=r"tcp://127\.0\.0\.1:9"):
            cluster.submit("lost", tasks.double, 1, heard)
        cluster.close()


def test_a_scheduler_that_stays_away_costs_no_more_each_time_it_is_tried(
    tmp_path, monkeypatch, caplog
):
    """Neither threads nor open files nor lines in the log, however long that lasts."""
    monkeypatch.setattr("ridetune.app.dask_connection.CONNECT", 0.2)
    cluster = Cluster("tcp://127.0.0.1:9", tmp_path)
    assert is_away(cluster)  # Dask has threads that all its clients share
    threads, files = threading.active_count(), psutil.Process().num_fds()
    for _ in range(3):
        assert is_away(cluster)
    assert threading.active_count() <= threads
    assert psutil.Process().num_fds() <= files
    told = [one.message for one in caplog.records if one.name == "ridetune.app.cluster"]
    assert [message.partition(":")[0] for message in told] == ["cannot reach the workers at tcp"]
    cluster.close()
