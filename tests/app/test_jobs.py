"""Jobs as their owner sees them: states, events, cancelling; the cluster is a stand-in."""

import asyncio
import json
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial

import pytest
from fastapi.testclient import TestClient
from ridetune.app.errors import NotFound, Unavailable
from ridetune.app.job_store import JobStore
from ridetune.app.limits import Limits
from ridetune.app.owner_store import OwnerStore

from .conftest import Visitor, open_client
from .waiting import until


@pytest.fixture
def service(settings, clusters) -> Iterator[TestClient]:
    with open_client(settings) as client:
        yield client


@pytest.fixture
def owner(service) -> Visitor:
    return Visitor(service)


def submit(owner: Visitor, **more) -> dict:
    runs = [kept["id"] for kept in owner.get("/measurements").json()][:1]
    return owner.submit("identifications", {"runs": runs, **more})


def state(owner: Visitor, job: str) -> str:
    return owner.get(f"/identifications/{job}").json()["state"]


def events(owner: Visitor, job: str) -> list[tuple[str, dict]]:
    """All events of a job that has ended."""
    text = owner.get(f"/identifications/{job}/events").text
    blocks = [
        dict(line.split(": ", 1) for line in block.splitlines() if line[0] != ":")
        for block in text.strip().split("\n\n")
    ]
    return [(block["event"], json.loads(block["data"])) for block in blocks if block]


def test_a_job_is_answered_for_before_it_runs(owner, clusters):
    """202 with what was asked, the twelve parameters by default, nothing found yet."""
    job = submit(owner)
    assert (job["state"], job["kind"], len(job["free"])) == ("queued", "identification", 12)
    assert job["runs"][0]["name"] == "detailed_manoeuvre_1.csv"
    assert job["created"] is not None
    assert (job["started"], job["finished"], job["error"]) == (None, None, None)
    until(lambda: job["id"] in clusters[-1].tasks)
    assert owner.get("/identifications").json() == [job]
    assert owner.get().json()["identifications"] == [job]


def test_what_goes_to_the_worker_is_everything_it_needs(owner, clusters):
    job = submit(owner, free=["front.suspension.stiffness"], traction="paper")
    until(lambda: job["id"] in clusters[-1].tasks)
    _, payload, _ = clusters[-1].tasks[job["id"]]
    assert payload["free"] == ["front.suspension.stiffness"]
    assert payload["traction"] == "paper"
    assert payload["vehicle"] == owner.get("/vehicle").json()
    assert payload["runs"][0].name == "detailed_manoeuvre_1.csv"
    assert "wheel.fl.z" in payload["runs"][0]


def test_notes_that_come_while_a_job_waits_do_not_change_it(settings, clusters):
    """Oracle: what was stated when it was asked for, which the job shows and the worker gets."""
    with open_client(settings) as service:
        owner = Visitor(service)
        job = submit(owner)
        notes = f"/measurements/{job['runs'][0]['id']}/notes?name=lap.toml"
        changed = owner.put(notes, content=b'[noise]\n"chassis.z" = 0.02\n').json()["noise"]
        assert job["runs"][0]["noise"] != changed
    with open_client(settings) as service:
        owner.client = service
        until(lambda: job["id"] in clusters[-1].tasks)
        _, payload, _ = clusters[-1].tasks[job["id"]]
        assert payload["runs"][0].noise == job["runs"][0]["noise"]
        assert owner.get("/identifications").json() == [job]
        assert submit(owner)["runs"][0]["noise"] == changed


def test_what_held_untold_is_shown_filled_in(owner, clusters):
    """Oracle: the session's car and the default bounds that follow from its start values."""
    free, held = "front.suspension.stiffness", "rear.suspension.stiffness"
    job = submit(owner, free=["K_F"], start={"K_R": 2e4})
    own = owner.get("/vehicle").json()["front"]["suspension"]["stiffness"]
    bounds = owner.client.post("/api/parameters/bounds", json={"start": {free: own}}).json()
    assert job["free"] == [free]
    assert len(job["fixed"]) == 11
    assert held in job["fixed"]
    assert job["start"] == {free: own, held: 2e4}
    assert job["bounds"] == bounds


def test_a_job_runs_reports_and_ends_with_its_result(owner, clusters):
    job = submit(owner)["id"]
    until(lambda: job in clusters[-1].tasks)
    clusters[-1].start(job)
    until(lambda: state(owner, job) == "running")
    clusters[-1].report(job, cost=3.5, cost_history=[9.0, 3.5])
    until(lambda: owner.get(f"/identifications/{job}").json()["progress"])
    assert owner.get(f"/identifications/{job}").json()["progress"]["cost_history"] == [9.0, 3.5]
    clusters[-1].end(job, "done", result={"cost": 1.0, "correlation": [[float("nan")]]})
    until(lambda: state(owner, job) == "done")
    ended = owner.get(f"/identifications/{job}").json()
    assert ended["result"] == {"cost": 1.0, "correlation": [[None]]}
    assert ended["finished"] >= ended["started"] >= ended["created"]
    assert ended["progress"]["cost"] == 3.5
    assert "result" not in owner.get("/identifications").json()[0]


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
    monkeypatch.setattr("ridetune.app.followers.POLL_EVERY", 3600.0)

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
    jobs, most = service.app.state.services.jobs, Limits().session_events
    usual, during = jobs.follow, []

    def follow(*told):
        during.append(dict(jobs._watching))
        return usual(*told)

    monkeypatch.setattr(jobs, "follow", follow)
    with ExitStack() as others:
        for _ in range(most):
            others.enter_context(jobs.watching(owner.id, most))
        refused = owner.get(f"/identifications/{job}/events")
        assert refused.status_code == 429
        assert int(refused.headers["retry-after"]) > 0
    assert len(events(owner, job)) == 1
    assert during == [{owner.id: 1}]
    assert not jobs._watching


def test_followers_wait_for_a_database_that_is_away(service, owner, clusters, monkeypatch):
    """Whether it cannot tell how the job stands or whose it is."""
    monkeypatch.setattr("ridetune.app.followers.POLL_EVERY", 0.01)
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


def test_a_waiting_job_is_cancelled_at_once(owner, clusters):
    """Whether it has reached the cluster or not, where it then does not stay."""
    job = submit(owner)["id"]
    assert owner.post(f"/identifications/{job}/cancel").status_code == 202
    assert state(owner, job) == "cancelled"
    last = submit(owner)["id"]
    until(lambda: set(clusters[-1].tasks) == {last})


def test_a_job_cancelled_while_it_is_handed_over_does_not_run(owner, clusters):
    """The cluster is told to cancel it once it knows it."""
    clusters[-1].meanwhile = lambda name: owner.post(f"/identifications/{name}/cancel")
    job = submit(owner)["id"]
    until(lambda: state(owner, job) == "cancelled")
    until(lambda: job in clusters[-1].cancelled)
    assert clusters[-1].tasks == {}


def test_a_running_job_is_asked_to_stop(owner, clusters):
    job = submit(owner)["id"]
    until(lambda: job in clusters[-1].tasks)
    clusters[-1].start(job)
    until(lambda: state(owner, job) == "running")
    assert owner.post(f"/identifications/{job}/cancel").status_code == 202
    until(lambda: state(owner, job) == "cancelled")
    again = owner.post(f"/identifications/{job}/cancel")
    assert (again.status_code, again.json()["state"]) == (202, "cancelled")


def test_the_same_key_submits_once(owner, clusters):
    first, second = submit(owner, key="click-1"), submit(owner, key="click-1")
    assert first["id"] == second["id"]
    assert len(owner.get("/identifications").json()) == 1


def test_a_request_sent_again_is_the_same_job_whatever_has_changed_since(owner, clusters):
    """The car is another one and the measurement gone; the names may be symbols, in any order."""
    asked = {"key": "click-1", "start": {"K_F": 3e4}, "bounds": {"K_F": [1e4, 9e4]}}
    first = submit(owner, free=["K_F", "rear.suspension.stiffness"], **asked)
    run = first["runs"][0]["id"]
    owner.post(f"/identifications/{first['id']}/cancel")
    car = owner.get("/vehicle").json()
    car["chassis"]["mass"] += 100.0
    assert owner.put("/vehicle", json=car).status_code == 200
    assert owner.delete(f"/measurements/{run}").status_code == 204
    stiffness = "front.suspension.stiffness"
    for free, start in (
        (["K_F", "rear.suspension.stiffness"], {"K_F": 3e4}),
        (["rear.suspension.stiffness", stiffness], {stiffness: 3e4}),
    ):
        body = {**asked, "runs": [run], "free": free, "start": start}
        again = owner.post("/identifications", json=body)
        assert (again.status_code, again.json().get("id")) == (202, first["id"]), again.text
    assert len(owner.get("/identifications").json()) == 1


def test_a_key_stands_for_one_request(owner, clusters):
    kept = submit(owner, key="click-1")
    runs = [run["id"] for run in kept["runs"]]
    other = {"runs": runs, "key": "click-1", "traction": "paper"}
    refused = owner.post("/identifications", json=other)
    assert (refused.status_code, refused.json()["field"]) == (422, "key")
    assert len(owner.get("/identifications").json()) == 1


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


def test_a_deleted_job_is_gone_and_stopped(owner, clusters):
    job = submit(owner)["id"]
    until(lambda: job in clusters[-1].tasks)
    assert owner.delete(f"/identifications/{job}").status_code == 204
    assert owner.get(f"/identifications/{job}").status_code == 404
    until(lambda: job in clusters[-1].cancelled)


def test_a_deleted_session_stops_its_jobs(owner, clusters):
    job = submit(owner)["id"]
    until(lambda: job in clusters[-1].tasks)
    assert owner.delete().status_code == 204
    until(lambda: job in clusters[-1].cancelled)


def test_a_measurement_in_use_stays_until_its_job_has_ended(owner, clusters):
    job = submit(owner)
    measurement = f"/measurements/{job['runs'][0]['id']}"
    refused = owner.delete(measurement)
    assert refused.status_code == 409
    assert job["id"] in refused.json()["detail"]
    owner.post(f"/identifications/{job['id']}/cancel")
    assert owner.delete(measurement).status_code == 204


def test_jobs_of_others_are_neither_seen_nor_stopped(service, owner, clusters):
    job = submit(owner)["id"]
    stranger = Visitor(service)
    assert stranger.get("/identifications").json() == []
    for method, path in (("GET", ""), ("GET", "/events"), ("POST", "/cancel"), ("DELETE", "")):
        reply = stranger.request(method, f"/identifications/{job}{path}")
        assert reply.status_code == 404
    assert state(owner, job) == "queued"


REFUSED = {
    "no runs": ({"runs": []}, "identification", "run"),
    "unknown run": ({"runs": ["nothing"]}, "not-found", "measurement"),
    "nothing free": ({"free": []}, "identification", "free"),
    "unknown name": ({"free": ["front.suspension.stifness"]}, "parameter", "stiffness"),
    "crossed bounds": (
        {"bounds": {"front.suspension.stiffness": [2e4, 1e4]}},
        "identification",
        "front.suspension.stiffness",
    ),
    "start outside": (
        {"start": {"front.suspension.stiffness": 1e9}},
        "identification",
        "front.suspension.stiffness",
    ),
    "free and fixed": (
        {"free": ["front.pivot.angle"], "fixed": ["front.pivot.angle"]},
        "identification",
        "front.pivot.angle",
    ),
    "bad traction": ({"traction": "none"}, "invalid-request", "traction"),
    "bad noise": ({"noise": {"chassis.z": -1.0}}, "identification", "chassis.z"),
    "bad vehicle": ({"vehicle": {"name": "empty"}}, "vehicle", "chassis"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_problem_that_cannot_be_set_up_is_refused_before_it_is_queued(owner, name):
    body, code, said = REFUSED[name]
    runs = [owner.get("/measurements").json()[0]["id"]]
    reply = owner.post("/identifications", json={"runs": runs, **body})
    assert reply.status_code in (404, 422), reply.text
    assert reply.json()["code"] == code
    assert said in reply.json()["detail"]
    assert owner.get("/identifications").json() == []


def test_a_session_has_its_share_of_jobs(small_limits, clusters):
    with open_client(small_limits) as service:
        owner = Visitor(service)
        submit(owner)
        runs = [owner.get("/measurements").json()[0]["id"]]
        refused = owner.post("/identifications", json={"runs": runs})
        assert refused.status_code == 429
        assert "under way" in refused.json()["detail"]
