"""Jobs that are cancelled: what ends with them, and which results are made all the same."""

from dataclasses import replace
from threading import Event

import pytest

from ..waiting import until
from .dispatcher_team import KINDS, make


def test_a_cancelled_campaign_makes_its_result_of_what_there_is(team):
    cluster = team.dispatch()
    job = team.submit("campaign", team.ann, "abcd")
    make(cluster, job, "a")
    until(lambda: f"{job}/c" in cluster.tasks)
    team.dispatchers[0].cancel(job)
    until(lambda: job in cluster.tasks)
    assert cluster.kept[job] == {"a": b"a"}
    assert set(cluster.cancelled) == {f"{job}/b", f"{job}/c"}
    cluster.end(job, "cancelled", result={"files": 1})
    until(lambda: team.state(job) == "cancelled")
    assert team.store.jobs.get(team.ann, job).result == {"files": 1}


def test_a_cancelled_sweep_ends_once_nothing_of_it_runs(team):
    cluster = team.dispatch()
    job = team.submit("sweep", team.ann, "abcd")
    make(cluster, job, "a")
    team.store.jobs.ask_to_cancel(team.ann, job)  # as another process would
    until(lambda: team.state(job) == "cancelled")
    until(lambda: cluster.tasks == {})


def test_a_campaign_cancelled_before_it_is_gathered_has_the_drives_that_are_kept(team, monkeypatch):
    """Kept by a service that ended; the next has claimed it, and reads files yet."""
    first = team.dispatch()
    job = team.submit("campaign", team.ann, "abcd")
    make(first, job, "a")
    until(lambda: len(team.store.parts(job)) == 1)
    team.dispatchers.pop().close()
    gathering = Event()

    def payload(job):
        gathering.wait(10)
        return dict(job.spec)

    monkeypatch.setitem(KINDS, "campaign", replace(KINDS["campaign"], payload=payload))
    second = team.dispatch()
    until(lambda: team.store.jobs.get(team.ann, job).runner is not None)
    team.dispatchers[0].cancel(job)
    gathering.set()
    until(lambda: job in second.tasks)
    assert second.kept[job] == {"a": b"a"}


def test_a_campaign_cancelled_while_its_result_is_made_keeps_it(team):
    cluster = team.dispatch()
    job = team.submit("campaign", team.ann, "a")
    make(cluster, job, "a")
    until(lambda: job in cluster.tasks)
    fit = team.submit("fit", team.bob)
    until(lambda: fit in cluster.tasks)
    for one in (job, fit):
        team.dispatchers[0].cancel(one)
    until(lambda: fit in cluster.cancelled)
    assert cluster.cancelled == [fit]
    cluster.end(job, "done", result={"files": 1})
    until(lambda: team.state(job) == "done")


@pytest.mark.parametrize("asked", ["before", "after"])
def test_a_campaign_cancelled_as_its_service_ends_has_the_drives_that_are_kept(team, asked):
    first = team.dispatch()
    job = team.submit("campaign", team.ann, "abcd")
    make(first, job, "a")
    until(lambda: len(team.store.parts(job)) == 1)
    if asked == "before":
        team.taking = False
        team.store.jobs.ask_to_cancel(team.ann, job)
    team.dispatchers.pop().close()
    if asked == "after":
        team.store.jobs.ask_to_cancel(team.ann, job)
    team.taking = True
    second = team.dispatch()
    until(lambda: job in second.tasks)
    assert second.kept[job] == {"a": b"a"}


def test_a_sweep_cancelled_without_a_service_ends_with_the_next(team):
    first = team.dispatch()
    job = team.submit("sweep", team.ann, "abcd")
    make(first, job, "a")
    until(lambda: len(team.store.parts(job)) == 1)
    team.dispatchers.pop().close()
    team.store.jobs.ask_to_cancel(team.ann, job)
    team.dispatch()
    until(lambda: team.state(job) == "cancelled")
    assert team.store.parts(job) == {}
