"""Advice over REST: before any run, after an identification, and what is refused."""

import pytest
from ridetune.app.limits import Limits
from ridetune.app.settings import Settings
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_to_json

from ..conftest import SAMPLES, Visitor, open_client

PAPER = vehicle_to_json(reference_vehicles()["paper"])


@pytest.fixture(scope="module")
def engineer(tmp_path_factory, workers):
    """A session on a service with workers."""
    settings = Settings(
        data=tmp_path_factory.mktemp("advice"), cluster=workers, limits=Limits(advised_seconds=100)
    )
    with open_client(settings) as client:
        yield Visitor(client)


def test_a_plan_before_any_run(engineer):
    """Oracle: nothing but braking moves the front pivot's angle much (docs/advice.md)."""
    own = {"name": "Mine", "kind": "road", "duration": 2}
    asked = {"candidates": {"brake-54": "brake-54", "own": own}, "planned": ["1", "2"]}
    reply = engineer.post("/advice", json=asked | {"noise": {"wheel.fl.z": 0.0}})
    assert reply.status_code == 200, reply.text
    told = reply.json()
    assert [one["key"] for one in told["candidates"]] == ["brake-54", "own"]
    assert len(told["now"]["parameters"]) == 12
    assert told["candidates"][0]["parameters"][0]["unit"] == "N/m"
    assert "phi_F from" in told["candidates"][0]["sentence"]


def test_advice_after_an_identification(engineer):
    """Oracle: the errors of that fit."""
    file = SAMPLES / "twin/manoeuvre_1.csv"
    run = engineer.upload(file.read_bytes(), file.name).json()["id"]
    asked = {"runs": [run], "vehicle": PAPER, "free": ["K_F", "K_R", "phi_F"]}
    job = engineer.post("/identifications", json=asked).json()
    assert engineer.post("/advice", json={"identification": "gone"}).status_code == 404
    done = engineer.wait_for("identifications", job["id"])
    asked = {"identification": job["id"], "candidates": ["brake-54"]}
    told = engineer.post("/advice", json=asked).json()
    for one, other in zip(told["now"]["parameters"], done["result"]["parameters"], strict=True):
        assert one["name"] == other["name"]
        assert one["std_error"] == pytest.approx(other["std_error"], rel=0.01)
    # What is done to the recording afterwards is nothing to the fit.
    steps = [{"kind": "scale", "channel": "chassis.z", "gain": -2}]
    engineer.put(f"/measurements/{run}/conditioning", json={"steps": steps})
    again = engineer.post("/advice", json=asked).json()
    assert (again["now"], again["candidates"]) == (told["now"], told["candidates"])
    refused = engineer.post("/advice", json=asked | {"vehicle": PAPER})
    assert (refused.status_code, refused.json()["field"]) == (422, "vehicle")


def test_what_needs_a_recording_that_was_deleted_names_it(engineer):
    """Advice, a profile and a validation hold the fitted car against what it was fitted to."""
    file = SAMPLES / "twin/manoeuvre_2.csv"
    run = engineer.upload(file.read_bytes(), "monday.csv").json()["id"]
    asked = {"runs": [run], "vehicle": PAPER, "free": ["K_F", "K_R"]}
    job = engineer.post("/identifications", json=asked).json()["id"]
    engineer.wait_for("identifications", job)
    assert engineer.delete(f"/measurements/{run}").status_code == 204
    some = {"candidates": ["brake-54"]}
    for kind, more in (("advice", some), ("profiles", {"parameter": "K_F"}), ("validations", {})):
        refused = engineer.post(f"/{kind}", json={"identification": job, **more})
        assert (refused.status_code, refused.json()["code"]) == (410, "deleted")
        said = "monday.csv, to which this car was fitted, was deleted; add it again and fit anew."
        assert refused.json()["detail"] == said


def test_a_fit_to_a_turned_channel_gives_no_advice(engineer):
    """Oracle: the fit's own words."""
    lines = (SAMPLES / "twin/manoeuvre_2.csv").read_bytes()
    run = engineer.upload(lines, "turned.csv").json()["id"]
    steps = [{"kind": "scale", "channel": "chassis.z", "gain": -1}]
    assert engineer.put(f"/measurements/{run}/conditioning", json={"steps": steps}).is_success
    asked = {"runs": [run], "vehicle": PAPER, "free": ["K_F", "K_R"]}
    job = engineer.post("/identifications", json=asked).json()
    done = engineer.wait_for("identifications", job["id"])
    reply = engineer.post("/advice", json={"identification": job["id"], "candidates": ["brake-54"]})
    assert reply.status_code == 422
    assert reply.json()["detail"] == " ".join(done["result"]["faults"])
    assert "chassis.z of run turned.csv runs against the model" in reply.json()["detail"]


@pytest.mark.parametrize(
    ("asked", "status", "said"),
    [
        ({"candidates": ["1", "2", "roll", "warp"]}, 422, "last 120 s together"),
        ({"candidates": ["brake-5"]}, 404, "did you mean brake-54?"),
        ({"candidates": ["heave"], "noise": {"chassis.v_x": 1.0}}, 422, "chassis.v_x; it counts"),
        ({"candidates": 3}, 422, "give a list of known manoeuvres' keys"),
        ({"candidates": {"x": {"name": "X"}}}, 422, "kind"),
    ],
)
def test_refusals(engineer, asked, status, said):
    reply = engineer.post("/advice", json=asked)
    assert reply.status_code == status, reply.text
    assert said in reply.json()["detail"]
