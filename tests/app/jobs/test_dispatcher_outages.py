"""The database, the disk, files or memory are away for a while: jobs wait, and nothing is lost."""

import errno
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from threading import Event

import pytest
from ridetune.app.errors import Unavailable

from ..waiting import until
from .dispatcher_team import KINDS, make


def test_a_job_waits_for_what_it_is_gathered_from(team, monkeypatch):
    """As while the database, or the disk with its recordings, is away."""
    refusals = [Unavailable("It is away."), Unavailable("It is away.")]

    def payload(job):
        if refusals:
            raise refusals.pop()
        return dict(job.spec)

    monkeypatch.setitem(KINDS, "fit", replace(KINDS["fit"], payload=payload))
    fit = team.submit("fit", team.ann)
    cluster = team.dispatch()
    until(lambda: fit in cluster.tasks)
    assert team.state(fit) == "queued"


@pytest.mark.parametrize("number", [errno.EMFILE, errno.ENOMEM, errno.ENOSPC, errno.EIO])
def test_a_job_is_sent_once_the_service_has_what_it_takes(team, number):
    """It is not the job's fault."""
    refusals = [OSError(number, "injected"), Unavailable("It is away.")]

    def refuse(name):
        if refusals:
            raise refusals.pop()

    cluster = team.dispatch()
    cluster.meanwhile = refuse
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    assert not refusals
    assert team.state(fit) == "queued"


@pytest.mark.parametrize("number", [errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOSPC])
def test_a_part_waits_for_what_there_is_too_little_of(team, monkeypatch, number):
    """Files, memory, or room on the disk; the part is kept once there is enough again."""
    cluster = team.dispatch()
    job = team.submit("sweep", team.ann, "a")
    keep, refused = team.store.directory.keep, []

    def short(*told):
        refused.append(told)
        if len(refused) < 3:
            raise OSError(number, "injected")
        keep(*told)

    monkeypatch.setattr(team.store.directory, "keep", short)
    make(cluster, job, "a")
    until(lambda: job in cluster.tasks or team.store.jobs.get(team.ann, job).ended)
    assert cluster.kept.get(job) == {"a": b"a"}


def test_a_job_whose_part_lies_on_a_bad_sector_waits_alone(team, monkeypatch):
    """It goes on once the part can be read; jobs after it do not wait for that."""
    cluster = team.dispatch()
    bad, good = team.submit("sweep", team.ann, "a"), team.submit("sweep", team.ann, "b")
    part, readable = team.store.directory.original(sha256(b"a").hexdigest()), Event()
    read = Path.read_bytes

    def sector(path):
        if path == part and not readable.is_set():
            raise OSError(errno.EIO, "injected")
        return read(path)

    monkeypatch.setattr(Path, "read_bytes", sector)
    make(cluster, bad, "a")
    make(cluster, good, "b")
    until(lambda: good in cluster.tasks)
    assert bad not in cluster.tasks
    assert not team.store.jobs.get(team.ann, bad).ended
    readable.set()
    until(lambda: bad in cluster.tasks)


def test_a_part_that_the_disk_lost_is_made_again(team):
    cluster = team.dispatch()
    job = team.submit("sweep", team.ann, "ab")
    make(cluster, job, "a")
    until(lambda: len(team.store.parts(job)) == 1)
    for name in list(team.store.directory.names()):
        team.store.directory.drop(name)
    make(cluster, job, "b")
    make(cluster, job, "a")
    until(lambda: job in cluster.tasks)
    assert cluster.kept[job] == {"a": b"a", "b": b"b"}


def test_a_claim_whose_answer_was_lost_is_not_a_job_lost(team, monkeypatch):
    """The database has committed it, but the connection broke before it could tell."""
    claim, broken = team.store.leases.claim, []

    def claimed_unheard(*asked, **more):
        found = claim(*asked, **more)
        if found and not broken:
            broken.append(found)
            raise Unavailable("The database went away.")
        return found

    monkeypatch.setattr(team.store.leases, "claim", claimed_unheard)
    fit = team.submit("fit", team.ann)
    cluster = team.dispatch()
    until(lambda: fit in cluster.tasks)


def test_nothing_that_was_told_is_lost_while_the_database_is_away(team, monkeypatch):
    cluster = team.dispatch()
    fit = team.submit("fit", team.ann)
    until(lambda: fit in cluster.tasks)
    finish, refused = team.store.finish_job, []

    def away(*told, **found):
        refused.append(told)
        if len(refused) < 4:
            raise Unavailable("The database cannot be reached.")
        return finish(*told, **found)

    monkeypatch.setattr(team.store, "finish_job", away)
    cluster.end(fit, "done", result={"cost": 1.0})
    until(lambda: team.state(fit) == "done")
    assert len(refused) == 4
    assert team.store.jobs.get(team.ann, fit).result == {"cost": 1.0}


def test_of_progress_told_while_the_database_is_away_only_the_latest_waits(team, monkeypatch):
    """So that the memory it takes is bounded however long that lasts."""
    cluster = team.dispatch()
    ended, fit = team.submit("fit", team.bob), team.submit("fit", team.ann)
    until(lambda: {ended, fit} == set(cluster.tasks))
    finish, asked, back = team.store.finish_job, Event(), Event()

    def away(*told, **found):
        asked.set()
        if not back.is_set():
            raise Unavailable("The database cannot be reached.")
        return finish(*told, **found)

    monkeypatch.setattr(team.store, "finish_job", away)
    cluster.end(ended, "done", result={})
    asked.wait(10)
    for cost in range(1000):
        cluster.report(fit, cost=cost)
    back.set()
    until(lambda: team.dispatchers[0].progress(fit) == {"cost": 999})
    assert team.changed.count(fit) == 1
