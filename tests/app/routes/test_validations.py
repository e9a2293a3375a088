"""Validations over REST: from a finished identification to the report, by real workers."""

import json

import pytest
from ridetune.app.settings import Settings
from ridetune.engine.manoeuvre import manoeuvre_to_json, reference_manoeuvres
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_to_json

from ..conftest import SAMPLES, Visitor, open_client

PAPER = vehicle_to_json(reference_vehicles()["paper"])


@pytest.fixture(scope="module")
def engineer(tmp_path_factory, workers):
    """A session on a service with workers."""
    with open_client(
        Settings(data=tmp_path_factory.mktemp("validations"), cluster=workers)
    ) as client:
        yield Visitor(client)


@pytest.fixture(scope="module")
def runs(engineer) -> list[str]:
    """Both of the twin's runs, uploaded."""
    files = [SAMPLES / f"twin/manoeuvre_{number}.csv" for number in (1, 2)]
    return [engineer.upload(file.read_bytes(), file.name).json()["id"] for file in files]


@pytest.fixture(scope="module")
def fitted(engineer, runs) -> str:
    """A fit of the springs to the first run; all else is the twin's own."""
    asked = {"runs": runs[:1], "vehicle": PAPER, "free": ["K_F", "K_R"]}
    job = engineer.post("/identifications", json=asked).json()
    done = engineer.wait_for("identifications", job["id"])
    assert done["state"] == "done", done["error"]
    return job["id"]


@pytest.fixture(scope="module")
def done(engineer, runs, fitted) -> dict:
    """A validation that is done."""
    asked = {"identification": fitted, "hold_out": runs[1:], "manoeuvres": {runs[1]: "2"}}
    reply = engineer.post("/validations", json=asked)
    assert reply.status_code == 202, reply.text
    return engineer.wait_for("validations", reply.json()["id"])


def test_the_held_out_run_is_predicted_to_its_noise(engineer, runs, done):
    """Oracle: the noise of 0.5 mm that was added to the twin."""
    assert done["state"] == "done", done["error"]
    assert done["progress"] == {"predictions": 6, "of": 6}
    assert done["manoeuvres"] == {runs[1]: manoeuvre_to_json(reference_manoeuvres()["2"])}
    document = engineer.get(f"/validations/{done['id']}/result.json").json()
    held = document["runs"][1]
    assert (held["name"], held["role"]) == ("manoeuvre_2.csv", "hold-out")
    for one in held["predictions"]:
        if one["model"] == "8dof":
            assert one["scores"]["chassis.z"]["rms_error"] == pytest.approx(0.5e-3, rel=0.045)
            assert one["scores"]["chassis.z"]["coverage"] == pytest.approx(0.95, abs=0.014)
            low, middle, high = (
                one["values"][f"chassis.z{end}"] for end in (".lower", "", ".upper")
            )
            assert all(a <= b <= c for a, b, c in zip(low, middle, high, strict=True))
    shown = done["result"]["runs"][1]["predictions"]
    assert [one["scores"] for one in shown] == [one["scores"] for one in held["predictions"]]
    assert len(document["made"]["recordings"]) == 2


def test_what_is_kept_with_a_run_is_driven_unless_the_request_tells_otherwise(
    engineer, runs, fitted
):
    two = manoeuvre_to_json(reference_manoeuvres()["2"])
    one = manoeuvre_to_json(reference_manoeuvres()["1"])
    path = f"/measurements/{runs[1]}/manoeuvre"
    assert engineer.put(path, content=json.dumps(two).encode()).status_code == 200
    told = [({}, {runs[1]: two}), ({runs[1]: None}, {}), ({runs[1]: "1"}, {runs[1]: one})]
    for manoeuvres, driven in told:
        asked = {"identification": fitted, "hold_out": runs[1:], "manoeuvres": manoeuvres}
        job = engineer.post("/validations", json=asked).json()
        assert job["manoeuvres"] == driven
        engineer.post(f"/validations/{job['id']}/cancel")
    engineer.delete(path)


def test_what_says_little_of_the_car_and_what_is_left_out_is_told(engineer, runs, fitted):
    """Oracle: notes that name another car, and the recordings of the session."""
    notes = b'vehicle = "BMW 320i"'
    noted = engineer.put(f"/measurements/{runs[1]}/notes?name=n.toml", content=notes)
    assert noted.json()["vehicle"] == "BMW 320i"
    steps = [{"kind": "scale", "channel": "chassis.z", "gain": 2}]
    for done in (steps, []):  # it stays known whatever is done to the recording
        path = f"/measurements/{runs[1]}/conditioning"
        assert engineer.put(path, json={"steps": done}).json()["measurement"]["vehicle"]
    job = engineer.post("/validations", json={"identification": fitted, "hold_out": runs[1:]})
    done = engineer.wait_for("validations", job.json()["id"])
    assert [run["findings"] == [] for run in done["result"]["runs"]] == [True, False]
    [finding] = done["result"]["runs"][1]["findings"]
    assert "recorded with another car, BMW 320i" in finding
    document = engineer.get(f"/validations/{done['id']}/result.json").json()
    names = {one["name"]: one for one in engineer.get("/measurements").json()}
    held = {"manoeuvre_1.csv", "manoeuvre_2.csv"}
    assert set(document["made"]["left_out"]) == names.keys() - held
    assert names["detailed_manoeuvre_1.csv"]["vehicle"] == "compact rear-drive car"


def test_the_report_is_served_in_a_sandbox(engineer, done):
    reply = engineer.get(f"/validations/{done['id']}/report.html")
    assert reply.headers["content-type"] == "text/html; charset=utf-8"
    policy = reply.headers["content-security-policy"]
    assert policy.startswith("sandbox allow-scripts")
    assert "allow-same-origin" not in policy
    assert "connect-src" not in policy
    assert "default-src 'none'" in policy
    assert reply.headers["cross-origin-opener-policy"] == "unsafe-none"
    assert reply.text.startswith("<!doctype html>")


def test_what_cannot_be_validated_is_refused(engineer, runs, fitted):
    base = {"identification": fitted}
    for asked, status, sentence in (
        ({"identification": "nothing"}, 404, ""),
        ({**base, "hold_out": ["nothing"]}, 404, ""),
        ({**base, "hold_out": runs[:1]}, 422, "is to be held out, but the car is fitted to it"),
        ({**base, "manoeuvres": {runs[1]: "2"}}, 422, "neither fitted nor held out"),
        ({**base, "manoeuvres": {runs[0]: "heave"}}, 422, "moves the posts of a rig"),
        ({**base, "manoeuvres": {runs[0]: "elsewhere"}}, 404, "no manoeuvre by that key"),
        ({**base, "geometry": {"front": {"distance": 1}}}, 422, "front.angle is missing"),
    ):
        reply = engineer.post("/validations", json=asked)
        assert reply.status_code == status, reply.text
        assert sentence in reply.json()["detail"]


def test_a_cancelled_validation_has_no_report(engineer, runs, fitted):
    asked = {"identification": fitted, "hold_out": runs[1:]}
    job = engineer.post("/validations", json=asked).json()["id"]
    engineer.post(f"/validations/{job}/cancel")
    state = engineer.wait_for("validations", job)["state"]
    reply = engineer.get(f"/validations/{job}/report.html")
    assert reply.status_code == (200 if state == "done" else 409)
    assert engineer.delete(f"/validations/{job}").status_code == 204
    assert engineer.get(f"/validations/{job}").status_code == 404
