"""Jobs that fail while they are divided, sent or made: each alone."""

from dataclasses import replace

import pytest

from ..waiting import until
from .dispatcher_team import CUT, KINDS, make


def test_a_unit_that_fails_fails_its_job_alone(team):
    cluster = team.dispatch()
    bad, good = team.submit("sweep", team.ann, "ab"), team.submit("sweep", team.bob, "a")
    until(lambda: f"{bad}/a" in cluster.tasks)
    error = {"code": "worker-lost", "detail": "It killed its workers."}
    cluster.end(f"{bad}/a", "failed", error=error)
    until(lambda: team.state(bad) == "failed")
    until(lambda: f"{bad}/b" in cluster.cancelled)
    assert team.store.jobs.get(team.ann, bad).error == error
    make(cluster, good, "a")
    until(lambda: good in cluster.tasks)


def test_a_job_that_cannot_be_divided_fails_alone(team, monkeypatch):
    """As one whose spec is of another version."""

    def names(spec):
        raise ValueError("no such plant")

    division = replace(CUT, names=names)
    monkeypatch.setitem(KINDS, "sweep", replace(KINDS["sweep"], division=division))
    cluster = team.dispatch()
    bad, fit = team.submit("sweep", team.ann, "ab"), team.submit("fit", team.ann)
    until(lambda: team.state(bad) == "failed")
    until(lambda: fit in cluster.tasks)


def test_a_job_of_which_nobody_knows_how_slow_it_is_fails_alone(team, monkeypatch):
    def slow(spec):
        raise ValueError("no such plant")

    division = replace(CUT, slow=slow)
    monkeypatch.setitem(KINDS, "campaign", replace(KINDS["campaign"], division=division))
    cluster = team.dispatch()
    bad, good = team.submit("campaign", team.ann, "ab"), team.submit("sweep", team.ann, "ab")
    until(lambda: team.state(bad) == "failed")
    until(lambda: f"{good}/a" in cluster.tasks)


@pytest.mark.parametrize("place", ["gathered", "submit", "parts"])
def test_a_job_that_cannot_be_sent_fails_alone(team, monkeypatch, caplog, place):
    """By a fault of ours, which the log tells; those that come after it are sent."""
    team.taking = False
    cluster = team.dispatch()
    bad, good = team.submit("sweep", team.ann, "a"), team.submit("sweep", team.ann, "a")

    def spoil(holder, name):
        usual = getattr(holder, name)

        def spoilt(job, *more):
            if job.startswith(bad):
                raise ValueError("secret detail")
            return usual(job, *more)

        monkeypatch.setattr(holder, name, spoilt)

    match place:
        case "gathered":
            spoil(team.store, "parts")
        case "submit":
            spoil(cluster, "meanwhile")
        case "parts":
            spoil(team.store, "part")
    team.taking = True
    if place == "parts":
        make(cluster, bad, "a")
    until(lambda: team.state(bad) == "failed")
    make(cluster, good, "a")
    until(lambda: good in cluster.tasks)
    cluster.end(good, "done", result={})
    until(lambda: team.state(good) == "done")
    error = team.store.jobs.get(team.ann, bad).error
    assert error["code"] == "internal"
    assert "(ValueError)" in error["detail"]
    assert "secret" not in error["detail"]
    assert "ValueError: secret detail" in caplog.text
