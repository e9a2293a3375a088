"""The seam to Dask: results, progress, cancelling, lost workers, on both kinds of cluster."""

import json
import os
import signal
import threading
from collections.abc import Callable
from contextlib import suppress

import cloudpickle
import psutil
import pytest
from ridetune.app.jobs.cluster import Cluster
from ridetune.app.jobs.worker import MOST_KEPT

from ..waiting import until
from . import tasks
from .heard import PATIENCE, Heard, heard

__all__ = ["heard"]

cloudpickle.register_pickle_by_value(tasks)


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
