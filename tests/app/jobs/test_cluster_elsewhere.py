"""Schedulers elsewhere that are lost, away, or not to be trusted: found again, and told."""

import threading

import cloudpickle
import psutil
import pytest
from ridetune.app.errors import Unavailable
from ridetune.app.jobs.cluster import Cluster

from ..waiting import until
from . import tasks
from .dask_processes import DaskProcesses, make_certificates
from .heard import PATIENCE, Heard, heard

__all__ = ["heard"]

cloudpickle.register_pickle_by_value(tasks)


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
    monkeypatch.setattr("ridetune.app.jobs.cluster.LOOK_EVERY", 0.0)
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
    monkeypatch.setattr("ridetune.app.jobs.dask_connection.CONNECT", 0.2)
    cluster = Cluster("tcp://127.0.0.1:9", tmp_path)
    assert is_away(cluster)  # Dask has threads that all its clients share
    threads, files = threading.active_count(), psutil.Process().num_fds()
    for _ in range(3):
        assert is_away(cluster)
    assert threading.active_count() <= threads
    assert psutil.Process().num_fds() <= files
    told = [one.message for one in caplog.records if one.name == "ridetune.app.jobs.cluster"]
    assert [message.partition(":")[0] for message in told] == ["cannot reach the workers at tcp"]
    cluster.close()
