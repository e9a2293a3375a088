"""Jobs that are refused before they are queued: what cannot be set up, and too many."""

import pytest

from ..conftest import Visitor, open_client
from .owned_jobs import submit

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
