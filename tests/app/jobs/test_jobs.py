"""Jobs as their owner sees them: asked for, at work, ended; the cluster is a stand-in."""

from ..conftest import Visitor, open_client
from ..waiting import until
from .owned_jobs import state, submit


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


def test_jobs_of_others_are_neither_seen_nor_stopped(service, owner, clusters):
    job = submit(owner)["id"]
    stranger = Visitor(service)
    assert stranger.get("/identifications").json() == []
    for method, path in (("GET", ""), ("GET", "/events"), ("POST", "/cancel"), ("DELETE", "")):
        reply = stranger.request(method, f"/identifications/{job}{path}")
        assert reply.status_code == 404
    assert state(owner, job) == "queued"
