"""Identifications from upload to result, by the real engine on real workers, kills included."""

import json
import os
import signal
from dataclasses import replace
from types import SimpleNamespace

import httpx2
import psutil
import pytest
from ridetune.app.errors import OverBudget
from ridetune.app.jobs.kinds import digest
from ridetune.app.limits import Limits
from ridetune.app.schemas import IdentificationRequest
from ridetune.app.settings import Settings
from ridetune.app.work.identification import as_asked, check_budget
from ridetune.engine.identification.multistart import fits_of
from ridetune.engine.measurement import read_run, run_to_csv
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.vehicle_file import read_vehicle, vehicle_to_json

from ..conftest import SAMPLES, Visitor, open_client
from ..live import LiveService

REAR = "rear.suspension.stiffness"


@pytest.fixture(scope="module")
def engineer(tmp_path_factory, workers):
    """A session on a service with workers."""
    with open_client(Settings(data=tmp_path_factory.mktemp("fits"), cluster=workers)) as client:
        yield Visitor(client)


def test_two_parameters_come_back_from_the_twins_recording(engineer):
    """Oracle: the car the recording was simulated with; four standard errors of tolerance."""
    truth = read_vehicle(SAMPLES / "twin/vehicle.json")
    names = ["front.suspension.stiffness", "rear.suspension.damping"]
    start = {name: 1.3 * truth.value(name) for name in names}
    recording = SAMPLES / "twin/manoeuvre_1.csv"
    run = engineer.upload(recording.read_bytes(), recording.name).json()
    asked = {
        "vehicle": vehicle_to_json(truth),
        "runs": [run["id"]],
        "free": names,
        "start": start,
    }
    job = engineer.post("/identifications", json=asked).json()
    events = engineer.get(f"/identifications/{job['id']}/events").text
    assert events.startswith("event: state")
    assert "event: progress" in events
    ended = engineer.wait_for("identifications", job["id"])
    assert ended["state"] == "done", ended["error"]
    assert ended["progress"]["cost"] == ended["progress"]["cost_history"][-1]
    for found in ended["result"]["parameters"]:
        assert found["start"] == start[found["name"]]
        assert abs(found["value"] - truth.value(found["name"])) < 4.0 * found["std_error"]
        assert found["determined"] == "yes"
    applied = engineer.put("/vehicle", json=ended["result"])
    assert applied.json() == ended["result"]["vehicle"]


def test_marked_braking_and_settings_are_used_and_kept(engineer):
    recording = SAMPLES / "twin/manoeuvre_2.csv"
    run = engineer.upload(recording.read_bytes(), recording.name).json()["id"]
    asked = {
        "runs": [run],
        "free": ["rear.suspension.stiffness"],
        "settings": {"rim_cutoff_hz": 40.0},
        "braking": {run: [[12.0, 15.0]]},
    }
    stranger = engineer.post("/identifications", json={**asked, "braking": {"x": [[1, 2]]}})
    assert (stranger.status_code, "not among the runs" in stranger.text) == (422, True)
    beyond = engineer.post("/identifications", json={**asked, "braking": {run: [[50, 60]]}})
    assert (beyond.status_code, "mark a time in it" in beyond.text) == (422, True)
    job = engineer.post("/identifications", json=asked).json()["id"]
    result = engineer.wait_for("identifications", job)["result"]
    assert result["settings"]["rim_cutoff_hz"] == 40.0
    assert result["settings"]["a_x_cutoff_hz"] == 20.0
    assert result["runs"][0]["braking"] == [[12.0, 15.0]]


def test_what_a_job_shows_repeats_its_fit(engineer):
    """Oracle: the first fit. The session's car has changed in between."""
    run = engineer.get("/measurements").json()[0]["id"]
    asked = {
        "runs": [run],
        "fixed": [name for name in PARAMETER_NAMES if name not in (REAR, "front.pivot.angle")],
        "bounds": {REAR: [1e4, 9e4]},
        "start": {REAR: 4e4},
        "noise": {"chassis.z": 1e-3},
        "traction": "paper",
        "settings": {"rim_cutoff_hz": None, "initial_state": "measured", "step": 0.004},
        "braking": {run: []},
        "starts": 3,
        "seed": 5,
        "loss": "cauchy",
        "loss_scale": 5.0,
        "priors": {"phi_F": [0.07, 0.05]},
        "sensors": {
            "chassis.pitch": {"delay": 0.005, "gain": "fit"},
            "chassis.a_x": {"bias": "fit"},
        },
        "fit_noise": True,
    }
    first = engineer.post("/identifications", json=asked).json()["id"]
    first = engineer.wait_for("identifications", first)
    assert engineer.get("/identifications").json()[-1].keys() == first.keys() - {
        "vehicle",
        "result",
    }
    stiffer = {**first["vehicle"], "chassis": {**first["vehicle"]["chassis"], "mass": 1500.0}}
    assert engineer.put("/vehicle", json=stiffer).status_code == 200

    again = {name: first[name] for name in IdentificationRequest.model_fields if name != "key"}
    again["runs"] = [run["id"] for run in first["runs"]]
    again = engineer.post("/identifications", json=again).json()["id"]
    again = engineer.wait_for("identifications", again)
    differ = {name for name in first["result"] if first["result"][name] != again["result"][name]}
    assert differ <= {"seconds"}
    assert first["free"] == again["free"] == [REAR, "front.pivot.angle"]
    assert first["sensors"] == again["sensors"] == asked["sensors"]
    assert [(one["name"], one["run"]) for one in first["result"]["sensors"]] == [
        ("sensor.chassis.pitch.gain", None),
        ("sensor.chassis.a_x.bias", first["runs"][0]["name"]),
    ]
    assert first["result"]["fixed_sensors"] == {"chassis.pitch": {"delay": 0.005}}
    assert first["priors"] == {"front.pivot.angle": [0.07, 0.05]}
    assert first["result"]["starts"] == 3
    # At the end every minimum is refined with the noise that was found.
    told = {name: first["progress"][name] for name in ("stage", "search", "searches")}
    minima = len(first["result"]["minima"])
    assert told == {"stage": "reweighing", "search": minima, "searches": minima}
    assert first["progress"]["seconds_left"] is None
    assert sum(one["starts"] for one in first["result"]["minima"]) == 3


def test_a_turned_channel_is_mended_by_sending_what_is_offered(engineer):
    """Oracle: the twin's own car; four standard errors."""
    truth = read_vehicle(SAMPLES / "twin/vehicle.json")
    run = read_run(SAMPLES / "twin/manoeuvre_2.csv")
    turned = {**run.channels, "chassis.roll": -run["chassis.roll"]}
    content = run_to_csv(replace(run, channels=turned)).encode()
    kept = engineer.upload(content, "turned.csv").json()["id"]
    names = ["front.suspension.stiffness", "rear.suspension.damping"]
    asked = {"vehicle": vehicle_to_json(truth), "runs": [kept], "free": names}

    def fit(more):
        job = engineer.post("/identifications", json={**asked, **more}).json()["id"]
        return engineer.wait_for("identifications", job)["result"]

    [offer] = fit({})["offers"]
    assert offer["channel"] == "chassis.roll"
    assert "sign" in offer["sentence"]
    mended = fit({"sensors": {offer["channel"]: offer["sensor"]}})
    assert mended["offers"] == []
    for found in mended["parameters"]:
        assert abs(found["value"] - truth.value(found["name"])) < 4.0 * found["std_error"]


def test_requests_without_sensors_stand_for_what_they_did_before_there_were_any():
    """Oracle: the digest of the same form without the fields."""
    request = IdentificationRequest(runs=["a"])
    form = request.model_dump(mode="json", exclude={"key", "sensors", "fit_noise"})
    for given in ("bounds", "start", "priors"):
        form[given] = []
    assert as_asked(request) == digest(form)
    other = IdentificationRequest(runs=["a"], sensors={"chassis.z": {"sign": -1}})
    assert as_asked(other) != as_asked(request)


def test_the_budget_counts_starts_and_rounds_of_noise():
    """Oracle: what the study of many starts measured: 64 starts are worth 12 to 14 single fits;
    noise takes two more."""
    kept = SimpleNamespace(summary={"samples": 4001, "duration": 20.0})
    limits = Limits(identified_samples=14 * 4001)
    check_budget([kept], 0.005, limits, starts=64)
    for more in ({"starts": 256}, {"starts": 64, "fit_noise": True}):
        with pytest.raises(OverBudget, match="choose fewer starts"):
            check_budget([kept], 0.005, limits, **more)
    assert 12.0 < fits_of(64) < 14.0
    check_budget([kept], 0.005, Limits(identified_samples=3 * 4001), fit_noise=True)
    with pytest.raises(OverBudget, match="choose noise that is stated, fewer or shorter runs"):
        check_budget([kept], 0.005, Limits(identified_samples=2 * 4001), fit_noise=True)


def test_what_a_search_cannot_be_asked_is_refused(engineer):
    run = engineer.get("/measurements").json()[0]["id"]
    for asked, sentence in (
        ({"starts": 2000}, "less than or equal to 1024"),
        ({"sensors": {"chasis.z": {"gain": 1}}}, "did you mean chassis.z?"),
        ({"sensors": {"chassis.z": {"gian": 1}}}, "did you mean gain?"),
        ({"sensors": {"chassis.z": {"gain": "x"}}}, 'give a number or \\"fit\\"'),
        ({"sensors": {"chassis.z": 1}}, "sensors.chassis.z is refused"),
        ({"fit_noise": 1}, "fit_noise is refused"),
        ({"loss": "hubert"}, "'linear', 'soft_l1', 'huber'"),
        ({"loss_scale": 0}, "greater than or equal to 0.01"),
        ({"priors": {"K_R": [1e3, 1.0]}}, "lies outside its bounds"),
        ({"priors": {"K_Q": [1e3, 1.0]}}, "did you mean"),
    ):
        refused = engineer.post("/identifications", json={"runs": [run], **asked})
        assert (refused.status_code, sentence in refused.text) == (422, True), refused.text


def test_a_start_too_stiff_for_the_step_is_refused_with_one_that_it_takes(engineer):
    """Oracle: the step that the refusal states is taken."""
    run = engineer.get("/measurements").json()[0]["id"]
    asked = {"runs": [run], "free": ["rear.suspension.stiffness"]}
    car = read_vehicle(SAMPLES / "twin/vehicle.json")
    asked["vehicle"] = vehicle_to_json(car.with_values({"front.suspension.damping": 2e5}))
    refused = engineer.post("/identifications", json=asked)
    assert (refused.status_code, "too long for this car" in refused.text) == (422, True)
    longest = float(refused.json()["detail"].split("at most ")[1].split()[0])
    taken = engineer.post("/identifications", json={**asked, "settings": {"step": longest / 1e3}})
    assert taken.status_code == 202, taken.text
    assert engineer.delete(f"/identifications/{taken.json()['id']}").status_code == 204


def test_a_running_identification_is_cancelled(engineer):
    runs = [kept["id"] for kept in engineer.get("/measurements").json()][:2]
    job = engineer.post("/identifications", json={"runs": runs}).json()["id"]
    engineer.wait_for("identifications", job, "running")
    assert engineer.post(f"/identifications/{job}/cancel").status_code == 202
    ended = engineer.wait_for("identifications", job)
    assert (ended["state"], ended["error"], ended["result"]) == ("cancelled", None, None)


def test_after_a_kill_nothing_is_left_behind_and_nothing_is_lost(tmp_path, workers):
    """Workers go with the service; uploads are byte-exact; acknowledged jobs run after all."""
    recording = (SAMPLES / "twin/manoeuvre_1.csv").read_bytes()
    with LiveService(tmp_path) as service:
        visitor = Visitor(service.ready().client)
        run = visitor.upload(recording, "twin.csv").json()["id"]
        asked = {"runs": [run], "free": ["front.suspension.stiffness"]}
        job = visitor.post("/identifications", json=asked).json()["id"]
        visitor.wait_for("identifications", job, "running")
        family = psutil.Process(service.process.pid).children(recursive=True)
        assert family
        service.kill()
        _, alive = psutil.wait_procs(family, timeout=10)
        assert alive == []
    with open_client(Settings(data=tmp_path, cluster=workers)) as visitor.client:
        assert visitor.get(f"/measurements/{run}/original").content == recording
        ended = visitor.wait_for("identifications", job)
        assert ended["state"] == "done", ended["error"]
        assert ended["result"]["parameters"][0]["name"] == "front.suspension.stiffness"


def test_a_live_stream_ends_with_the_client_and_the_service_stops_on_request(tmp_path):
    """The first event comes while the job is still queued; a signal ends the service in time."""
    with LiveService(tmp_path) as service:
        visitor = Visitor(service.ready().client)
        runs = [kept["id"] for kept in visitor.get("/measurements").json()]
        job = visitor.post("/identifications", json={"runs": runs}).json()["id"]
        with service.client.stream(
            "GET",
            f"/api/sessions/{visitor.id}/identifications/{job}/events",
            headers={"Authorization": f"Bearer {visitor.token}"},
        ) as reply:
            assert reply.headers["content-type"].startswith("text/event-stream")
            lines = (line for line in reply.iter_lines() if line)
            assert next(lines) == "event: state"
            first = json.loads(next(lines).removeprefix("data: "))
            assert first["id"] == job
            assert first["state"] in ("queued", "running")
        assert service.client.get("/healthz").json() == {"state": "running"}
        os.kill(service.process.pid, signal.SIGINT)
        assert service.process.wait(timeout=30) == 0
        with pytest.raises(httpx2.ConnectError):
            service.client.get("/healthz")
