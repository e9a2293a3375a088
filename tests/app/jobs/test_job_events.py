"""What those who follow a job hear of it, and how many may; the cluster is a stand-in."""

import asyncio
import json
from collections import Counter
from contextlib import ExitStack
from functools import partial

import pytest
from ridetune.app.errors import NotFound, Unavailable
from ridetune.app.limits import Limits
from ridetune.app.storage.job_store import JobStore
from ridetune.app.storage.owner_store import OwnerStore

from ..conftest import Visitor
from ..waiting import until
from .owned_jobs import state, submit


def events(owner: Visitor, job: str) -> list[tuple[str, dict]]:
    """All events of a job that has ended."""
    text = owner.get(f"/identifications/{job}/events").text
    blocks = [
        dict(line.split(": ", 1) for line in block.splitlines() if line[0] != ":")
        for block in text.strip().split("\n\n")
    ]
    return [(block["event"], json.loads(block["data"])) for block in blocks if block]


def test_the_events_end_with_the_final_state(owner, clusters):
    """Whoever comes after the end still hears how far it came and how it ended, and no more."""
    job = submit(owner)["id"]
    until(lambda: job in clusters[-1].tasks)
    clusters[-1].start(job)
    clusters[-1].report(job, cost=2.0)
    clusters[-1].end(job, "failed", error={"code": "identification", "detail": "Sorry."})
    until(lambda: state(owner, job) == "failed")
    ((event, told),) = events(owner, job)
    assert event == "state"
    assert told["progress"] == {"cost": 2.0}
    assert told["error"] == {"code": "identification", "detail": "Sorry."}
    assert "result" not in told


def test_events_of_an_unknown_job_are_not_found(owner):
    assert owner.get("/identifications/nothing/events").status_code == 404


def test_followers_hear_every_change_and_leave_nothing_behind(service, owner, clusters):
    """Straight at the service: a follower that goes away, one that stays to the end."""
    job = submit(owner)["id"]
    until(lambda: job in clusters[-1].tasks)
    jobs = service.app.state.services.jobs

    async def follow() -> list[str]:
        leaver = jobs.follow(owner.id, job)
        await anext(leaver)
        stayer = jobs.follow(owner.id, job)
        seen = [(await anext(stayer)).state]
        await leaver.aclose()
        clusters[-1].start(job)
        while seen[-1] != "running":
            seen.append((await anext(stayer)).state)
        clusters[-1].end(job, "done", result={})
        seen += [now.state async for now in stayer]
        return seen

    seen = service.portal.call(follow)
    assert seen[0] == "queued"
    assert "running" in seen
    assert seen[-1] == "done"
    assert jobs._followers.followed == frozenset()


def test_one_look_at_the_database_serves_all_followers(service, owner, clusters, monkeypatch):
    """Of both jobs, once in a while; of the one with news, at once, and of it alone. Whether each
    may is asked for each."""
    jobs, ids = service.app.state.services.jobs, [submit(owner)["id"] for _ in range(2)]
    until(lambda: set(ids) == set(clusters[-1].tasks))
    standing, looks, asked = JobStore.standing, [], Counter()

    def look(store, some):
        looks.append(sorted(some))
        return standing(store, some)

    monkeypatch.setattr(JobStore, "standing", look)
    monkeypatch.setattr("ridetune.app.jobs.followers.POLL_EVERY", 3600.0)

    async def states(followers) -> list[str]:
        return [found.state for found in await asyncio.gather(*map(anext, followers))]

    async def follow() -> list[list[str]]:
        followers = [
            jobs.follow(owner.id, ids[k % 2], partial(asked.update, [k])) for k in range(10)
        ]
        seen = [await states(followers)]
        jobs._followers.wake(ids[0])
        seen.append(await states(followers[::2]))
        for one in followers:
            await one.aclose()
        return seen

    assert service.portal.call(follow) == [["queued"] * 10, ["queued"] * 5]
    assert looks == [sorted(ids), ids[:1]]
    assert asked == {k: 2 - k % 2 for k in range(10)}


def test_a_follower_hears_no_more_once_the_job_is_not_theirs(service, owner, clusters):
    job = submit(owner)["id"]
    jobs = service.app.state.services.jobs

    async def follow(session: str) -> None:
        await anext(jobs.follow(session, job))

    service.portal.call(follow, owner.id)
    with pytest.raises(NotFound):
        service.portal.call(follow, Visitor(service).id)


def test_a_sessions_jobs_are_followed_so_often_at_once(service, owner, clusters, monkeypatch):
    """For each the database is asked every second, at the cost of all; it counts to its end."""
    job = submit(owner)["id"]
    owner.post(f"/identifications/{job}/cancel")
    jobs, shares = service.app.state.services.jobs, service.app.state.services.event_streams
    usual, during = jobs.follow, []

    def follow(*told):
        during.append(shares.of(owner.id))
        return usual(*told)

    monkeypatch.setattr(jobs, "follow", follow)
    with ExitStack() as others:
        for _ in range(Limits().session_events):
            others.enter_context(shares.one_more(owner.id))
        refused = owner.get(f"/identifications/{job}/events")
        assert refused.status_code == 429
        assert int(refused.headers["retry-after"]) > 0
    assert len(events(owner, job)) == 1
    assert during == [1]
    assert shares.of(owner.id) == 0


def test_followers_wait_for_a_database_that_is_away(service, owner, clusters, monkeypatch):
    """Whether it cannot tell how the job stands or whose it is."""
    monkeypatch.setattr("ridetune.app.jobs.followers.POLL_EVERY", 0.01)
    job = submit(owner)["id"]
    assert owner.post(f"/identifications/{job}/cancel").status_code == 202
    away = [Unavailable("It is away.") for _ in range(4)]
    opens, standing = OwnerStore.opens, JobStore.standing

    def meanwhile(usual, calls):
        """As usual for the request itself, then away, then as usual again."""

        def called(*told, **named):
            calls.append(None)
            if len(calls) > 1 and away:
                raise away.pop()
            return usual(*told, **named)

        return called

    service.app.state.services.store.answers.forget()
    monkeypatch.setattr(OwnerStore, "opens", meanwhile(opens, []))
    assert [told["state"] for _, told in events(owner, job)] == ["cancelled"]
    assert not away
    away = [Unavailable("It is away.")]
    monkeypatch.setattr(OwnerStore, "opens", opens)
    monkeypatch.setattr(JobStore, "standing", meanwhile(standing, [None]))
    assert [told["state"] for _, told in events(owner, job)] == ["cancelled"]
    assert not away
