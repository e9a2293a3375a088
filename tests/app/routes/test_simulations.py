"""Interactive simulations: the three modes over HTTP, and refusals before any work."""

import threading
import time
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from fastapi.testclient import TestClient
from numpy.testing import assert_allclose
from ridetune.app.main import create_app
from ridetune.app.settings import Settings
from ridetune.engine.errors import SimulationError
from ridetune.engine.manoeuvre import manoeuvre_from_json, reference_manoeuvres
from ridetune.engine.measurement import read_run
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import simulate_rims, simulate_road
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_from_json, vehicle_to_json

from ..conftest import ADDRESS, SAMPLES, Visitor, open_client
from ..test_frames import read_binary

BINARY = {"Accept": "application/vnd.ridetune.frames"}
PAPER = vehicle_to_json(reference_vehicles()["paper"])


@pytest.fixture(scope="module")
def driver(tmp_path_factory):
    """One session for all simulations that change nothing."""
    with open_client(Settings(data=tmp_path_factory.mktemp("drive"))) as client:
        yield Visitor(client)


@pytest.fixture(scope="module")
def recording(driver) -> str:
    return driver.get("/measurements").json()[0]["id"]


def test_a_manoeuvre_gives_what_the_engine_gives(driver):
    """Oracle: the engine called directly; single precision on the wire."""
    body = {
        "vehicle": PAPER,
        "manoeuvre": "2",
        "channels": ["chassis.z", "tyre.fl.load"],
        "seq": 41,
    }
    head, values = read_binary(driver.post("/simulations", json=body, headers=BINARY).content)
    run = simulate_road(reference_vehicles()["paper"], reference_manoeuvres()["2"]).run
    for name in ("time", "chassis.z", "tyre.fl.load"):
        assert_allclose(values[name], run[name], rtol=1e-6, atol=1e-9)
    assert (head["seq"], head["mode"], head["duration"]) == (41, "road", 20.0)
    assert set(head["negative_load_share"]) == {"fl", "fr", "rl", "rr"}
    assert {"name", "label", "value", "unit"} <= set(head["metrics"][0])


def test_without_a_body_of_its_own_it_is_the_sessions_car_in_manoeuvre_2(driver):
    plain = driver.post("/simulations", json={"max_samples": 2000, "channels": ["chassis.z"]})
    assert plain.headers["content-type"] == "application/json"
    asked = {"manoeuvre": "2", "max_samples": 2000, "channels": ["chassis.z"]}
    asked["vehicle"] = driver.get("/vehicle").json()
    assert plain.json()["values"] == driver.post("/simulations", json=asked).json()["values"]


def test_values_are_put_into_the_car(driver):
    """A slider's move is the same as a car with that number in it."""
    stiff = {**PAPER, "front": {**PAPER["front"]}}
    stiff["front"]["suspension"] = {**PAPER["front"]["suspension"], "stiffness": 40_000.0}
    common = {"manoeuvre": "bump", "channels": ["chassis.z"], "max_samples": 100}
    moved = {"vehicle": PAPER, "values": {"front.suspension.stiffness": 40_000.0}, **common}
    replies = [
        driver.post("/simulations", json=body).json()["values"]
        for body in (moved, {"vehicle": stiff, **common}, {"vehicle": PAPER, **common})
    ]
    assert replies[0] == replies[1]
    assert replies[0] != replies[2]


def test_a_recording_is_followed_on_its_rims(driver, recording):
    body = {"rims": {"measurement": recording}, "channels": ["chassis.z", "time"]}
    head, values = read_binary(driver.post("/simulations", json=body, headers=BINARY).content)
    assert head["mode"] == "rims"
    assert {"chassis.z", "chassis.pitch", "chassis.roll"} <= set(head["fit_percent"])
    assert head["samples"] == driver.get(f"/measurements/{recording}").json()["samples"]
    assert np.all(np.isfinite(values["chassis.z"]))


def test_a_recording_is_prepared_as_the_request_says(driver):
    """Oracle: the engine, told the same; each of the three changes what comes out, and nothing is
    left of them when the first is asked for again."""
    path = SAMPLES / "twin/manoeuvre_1.csv"
    recording = driver.upload(path.read_bytes(), "twin.csv").json()["id"]
    car, run = vehicle_from_json(PAPER), replace(read_run(path), braking=((2.0, 6.0),))
    told = {"rim_cutoff_hz": 8.0, "a_x_cutoff_hz": None, "initial_state": "measured"}
    told["step"] = 0.001
    expected = simulate_rims(car, run, settings=RimsSettings(**told)).run["chassis.pitch"]
    found, steps = [], []
    marked = [[2.0, 6.0]]
    for settings, braking in ((told, marked), (told, None), ({}, marked), (told, marked)):
        rims = {"measurement": recording, "settings": settings, "braking": braking}
        body = {"vehicle": PAPER, "rims": rims, "channels": ["chassis.pitch"]}
        head, values = read_binary(driver.post("/simulations", json=body, headers=BINARY).content)
        found.append(values["chassis.pitch"])
        steps.append(head["steps"])
    assert_allclose(found[0], expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    assert np.abs(found[1] - found[0]).max() > 1e-4
    assert np.abs(found[2] - found[0]).max() > 1e-4
    assert np.array_equal(found[3], found[0])
    assert steps == [20_000, 20_000, 4_000, 20_000]


def test_a_rig_test_and_a_recorded_one_agree(driver):
    """A simulation's own CSV with the posts' heights, uploaded, moves the car the same way."""
    heave = {**driver.client.get("/api/manoeuvres/heave").json(), "duration": 3.0}
    body = {"manoeuvre": heave, "vehicle": PAPER}
    direct = driver.post("/simulations", json={**body, "channels": ["chassis.z"]}).json()
    csv = driver.post("/simulations", json=body, headers={"Accept": "text/csv"})
    kept = driver.upload(csv.content, "rig.csv").json()
    again = {"posts": {"measurement": kept["id"]}, "vehicle": PAPER, "channels": ["chassis.z"]}
    recorded = driver.post("/simulations", json=again).json()
    assert direct["mode"] == recorded["mode"] == "posts"
    # A spline through the samples stands for the sine sweep: a few micrometres at 3 s.
    assert_allclose(recorded["values"]["chassis.z"], direct["values"]["chassis.z"], atol=5e-5)


def test_the_linear_model_has_no_arms(driver):
    """A channel the model lacks is left out of the head, not refused."""
    body = {"model": "7dof", "channels": ["chassis.z", "arm.fl.angle"], "max_samples": 50}
    reply = driver.post("/simulations", json=body)
    assert reply.status_code == 200
    assert [channel["name"] for channel in reply.json()["channels"]] == ["time", "chassis.z"]


def test_a_road_of_ones_own_replaces_the_manoeuvres(driver):
    bump = {"kind": "bump", "begin": 20.0, "length": 2.0, "height": 0.03}
    body = {"manoeuvre": "constant-speed-c", "road": bump, "channels": ["road.fl.z"]}
    values = driver.post("/simulations", json=body).json()["values"]["road.fl.z"]
    assert max(values) == pytest.approx(0.03, rel=1e-2)
    assert min(values) == 0.0


def test_a_manoeuvre_lasts_as_long_as_asked(driver):
    body = {"manoeuvre": "bump", "duration": 1.5, "channels": ["chassis.z"]}
    assert driver.post("/simulations", json=body).json()["duration"] == pytest.approx(1.5)


REFUSED = {
    "no duration": ({"manoeuvre": "bump", "duration": 0}, 422, "A duration of 0 s is asked for"),
    "duration of a recording": (
        {"rims": {"measurement": "x"}, "duration": 2.0},
        422,
        "duration means nothing with rims",
    ),
    "unknown manoeuvre": ({"manoeuvre": "3"}, 404, "constant-speed-c"),
    "two modes": ({"manoeuvre": "2", "rims": {"measurement": "x"}}, 422, "leave one"),
    "manoeuvre by number": ({"manoeuvre": 2}, 422, "manoeuvre is refused: give a known"),
    "unknown measurement": ({"rims": {"measurement": "x"}}, 404, "measurement"),
    "unknown channel": ({"channels": ["chassis.y"]}, 422, "chassis.y"),
    "unknown parameter": ({"values": {"front.suspension.stifness": 1}}, 422, "stiffness"),
    "value out of range": ({"values": {"front.suspension.stiffness": -1}}, 422, "stiffness"),
    "zero step": ({"step": 0}, 422, "field step"),
    "too long": ({"manoeuvre": {"name": "x", "kind": "road", "duration": 1e9}}, 422, "duration"),
    "too fine": (
        {"manoeuvre": {"name": "x", "kind": "road", "duration": 600}, "step": 1e-4},
        422,
        "6000000 steps",
    ),
    "too long with bent dampers": (
        {
            "manoeuvre": {"name": "x", "kind": "road", "duration": 600},
            "vehicle": PAPER,
            "values": {"rear.suspension.knee_speed": 0.4},
        },
        422,
        "480000 steps",
    ),
    "road under a rig": ({"manoeuvre": "heave", "road": {"kind": "flat"}}, 422, "rig"),
    "road without kind": ({"road": {"sections": []}}, 422, "kind"),
    "misspelt vehicle": ({"vehicle": {**PAPER, "chasis": {}}}, 422, "chassis"),
    "negative mass": (
        {"vehicle": {**PAPER, "chassis": {**PAPER["chassis"], "mass": -1}}},
        422,
        "chassis.mass",
    ),
    "no frequency": (
        {"rims": {"measurement": "x", "settings": {"rim_cutoff_hz": 0}}},
        422,
        "rims.settings.rim_cutoff_hz",
    ),
    "one sample": ({"max_samples": 1}, 422, "max_samples"),
    "unknown model": ({"model": "14dof"}, 422, "model"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_simulated_is_refused_with_a_sentence(driver, name):
    body, status, said = REFUSED[name]
    reply = driver.post("/simulations", json=body)
    assert reply.status_code == status, reply.text
    assert said in reply.json()["detail"]
    assert reply.json()["detail"][-1] in ".?"


@pytest.mark.parametrize(
    ("steps", "taken"),
    [
        ({"step": 1e-5}, True),
        ({"step": 0.9e-5}, False),
        ({"step": 0.02, "sample_step": 0.02}, True),
        ({"step": 0.021, "sample_step": 0.02}, False),
        ({"sample_step": 1.0}, True),
        ({"sample_step": 1.1}, False),
        ({"sample_step": 0.9e-5}, False),
    ],
)
def test_the_service_takes_the_steps_that_the_engine_takes(driver, steps, taken):
    """Oracle: the engine called directly."""
    still = {"name": "still", "kind": "road", "duration": 1.5}
    reply = driver.post("/simulations", json={"manoeuvre": still, "max_samples": 2, **steps})
    assert reply.status_code == (200 if taken else 422), reply.text
    with nullcontext() if taken else pytest.raises(SimulationError, match="s; give one between"):
        simulate_road(reference_vehicles()["paper"], manoeuvre_from_json(still), **steps)


MEANS_NOTHING = {
    "road": ({"kind": "flat"}, "has its road in it"),
    "lift_off": (True, "tyres play no part"),
    "step": (0.002, "rims.settings.step"),
    "sample_step": (0.01, "own times"),
}


@pytest.mark.parametrize("name", MEANS_NOTHING)
def test_what_would_be_ignored_on_rims_is_refused_with_the_remedy(driver, recording, name):
    value, remedy = MEANS_NOTHING[name]
    reply = driver.post("/simulations", json={"rims": {"measurement": recording}, name: value})
    assert (reply.status_code, reply.json()["field"]) == (422, name)
    assert remedy in reply.json()["detail"]


def test_a_rig_test_takes_a_step_of_its_own_and_no_road(driver):
    heave = {**driver.client.get("/api/manoeuvres/heave").json(), "duration": 1.0}
    csv = driver.post("/simulations", json={"manoeuvre": heave}, headers={"Accept": "text/csv"})
    posts = {"posts": {"measurement": driver.upload(csv.content, "short.csv").json()["id"]}}
    found = driver.post("/simulations", json={**posts, "step": 0.001, "sample_step": 0.01}).json()
    assert (found["steps"], found["samples"]) == (1000, 101)
    reply = driver.post("/simulations", json={**posts, "road": {"kind": "flat"}})
    assert (reply.status_code, reply.json()["field"]) == (422, "road")


def test_the_step_of_rims_counts_in_the_budget(small_limits):
    """Oracle: a recording of 20 s with 4001 samples, under a limit of 20 000 steps."""
    with open_client(small_limits) as client:
        visitor = Visitor(client)
        recording = visitor.get("/measurements").json()[0]["id"]
        for step, status in ((0.001, 200), (0.0009, 422)):
            rims = {"measurement": recording, "settings": {"step": step}}
            reply = visitor.post("/simulations", json={"rims": rims, "max_samples": 2})
            assert reply.status_code == status, reply.text
        assert (reply.json()["code"], "22223 steps" in reply.text) == ("over-budget", True)
        fit = visitor.post(
            "/identifications", json={"runs": [recording], "settings": {"step": step}}
        )
        assert (fit.json()["code"], "22222 samples or steps" in fit.text) == ("over-budget", True)


def test_a_recording_that_spans_too_long_is_refused(driver):
    """Few samples, but hours of integration."""
    rows = b"".join(b"%d,0,0,0,0,0,0\n" % (10 * k) for k in range(1000))
    names = [b"chassis.z [m]", b"chassis.a_x [m/s^2]"]
    names += [b"wheel.%s.z [m]" % corner for corner in (b"fl", b"fr", b"rl", b"rr")]
    kept = driver.upload(b"time [s]," + b",".join(names) + b"\n" + rows, "days.csv").json()
    rims = driver.post("/simulations", json={"rims": {"measurement": kept["id"]}})
    assert (rims.status_code, rims.json()["code"]) == (422, "over-budget")
    fit = driver.post("/identifications", json={"runs": [kept["id"]]})
    assert (fit.status_code, fit.json()["code"]) == (422, "over-budget")


def test_a_form_that_does_not_exist_is_not_acceptable(driver):
    reply = driver.post("/simulations", json={}, headers={"Accept": "image/png"})
    assert reply.status_code == 406
    assert "text/csv" in reply.json()["detail"]


def test_while_the_kernels_compile_simulations_wait_and_the_rest_works(settings):
    """503 with Retry-After, told by /readyz too; afterwards both answer."""
    compiled = threading.Event()
    app = create_app(replace(settings, login=False), warm_up=lambda *_: compiled.wait(20))
    with TestClient(app, base_url=ADDRESS) as client:
        visitor = Visitor(client)
        waiting = visitor.post("/simulations", json={})
        assert (waiting.status_code, waiting.json()["code"]) == (503, "compiling")
        assert waiting.headers["retry-after"] == "1"
        runs = [one["id"] for one in visitor.get("/measurements").json()]
        waiting = visitor.post("/identifications", json={"runs": runs})
        assert (waiting.status_code, waiting.json()["code"]) == (503, "compiling")
        ready = client.get("/readyz")
        assert (ready.status_code, ready.json()["state"]) == (503, "compiling")
        assert client.get("/healthz").status_code == 200
        assert visitor.get("/vehicle").status_code == 200
        compiled.set()
        until = time.monotonic() + 10
        while client.get("/readyz").status_code != 200:
            assert time.monotonic() < until
        assert visitor.post("/simulations", json={"max_samples": 2}).status_code == 200


def test_a_failed_compilation_is_told(settings):
    def broken(*_) -> None:
        raise RuntimeError("no compiler")

    with TestClient(create_app(settings, warm_up=broken), base_url=ADDRESS) as client:
        until = time.monotonic() + 10
        while client.get("/readyz").json()["state"] == "compiling":
            assert time.monotonic() < until
        ready = client.get("/readyz")
        assert (ready.status_code, ready.json()["state"]) == (503, "failed")
