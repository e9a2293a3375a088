"""Jobs whose worker, scheduler or service went away: sent again; the cluster is a stand-in."""

import time

from ..conftest import Visitor, open_client
from ..waiting import until
from .owned_jobs import state, submit


def test_a_lost_job_is_sent_again_but_not_for_ever(owner, clusters):
    job = submit(owner)["id"]
    for _ in range(3):
        until(lambda: job in clusters[-1].tasks)
        clusters[-1].start(job)
        until(lambda: state(owner, job) == "running")
        clusters[-1].lose(job, with_worker=True)
    until(lambda: state(owner, job) == "failed")
    assert owner.get(f"/identifications/{job}").json()["error"]["code"] == "worker-lost"


def test_a_job_that_went_with_its_scheduler_is_sent_again_as_often_as_it_takes(owner, clusters):
    """It is not its fault."""
    job = submit(owner)["id"]
    for _ in range(5):
        until(lambda: job in clusters[-1].tasks)
        clusters[-1].lose(job, with_worker=False)
    until(lambda: job in clusters[-1].tasks)
    clusters[-1].end(job, "done", result={"cost": 1.0})
    until(lambda: state(owner, job) == "done")


def test_a_job_waits_for_workers_out_of_reach(owner, clusters):
    clusters[-1].refusing = True
    job = submit(owner)["id"]
    time.sleep(0.2)
    assert state(owner, job) == "queued"
    clusters[-1].refusing = False
    until(lambda: job in clusters[-1].tasks)


def test_after_a_restart_the_unfinished_run_again_and_the_finished_stay(settings, clusters):
    with open_client(settings) as service:
        owner = Visitor(service)
        waiting, running, done = (submit(owner)["id"] for _ in range(3))
        until(lambda: len(clusters[-1].tasks) == 3)
        clusters[-1].start(running)
        clusters[-1].end(done, "done", result={"cost": 1.0})
        until(lambda: state(owner, running) == "running" and state(owner, done) == "done")
    with open_client(settings) as service:
        owner.client = service
        until(lambda: set(clusters[-1].tasks) == {waiting, running})
        assert state(owner, running) == "queued"
        assert owner.get(f"/identifications/{done}").json()["result"] == {"cost": 1.0}
        clusters[-1].end(running, "done", result={"cost": 2.0})
        until(lambda: state(owner, running) == "done")
