"""Sweeps over REST: from the request to the rows, by the real engine on real workers."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pyarrow import feather, parquet
from ridetune.app.jobs.worker import Attempt
from ridetune.app.limits import Limits
from ridetune.app.schemas import SweepRequest
from ridetune.app.settings import Settings
from ridetune.app.work.sweep import design_of, join_shares, most_bytes, sweep
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.simulation.excitation import FreeExcitation
from ridetune.engine.sweeps.designs import Sobol
from ridetune.engine.sweeps.figures import OK, figures
from ridetune.engine.sweeps.sweep import columns
from ridetune.engine.sweeps.sweep import sweep as sweep_through
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_to_json

from ..conftest import Visitor, open_client
from ..live import LiveService
from ..waiting import until

RANGES = {"K_F": [1e4, 4e4], "chassis.mass": [900.0, 1300.0]}
BOX = {"kind": "sobol", "ranges": RANGES, "cars": 12, "seed": 3}
PAPER = vehicle_to_json(reference_vehicles()["paper"])
BUMP = {"manoeuvre": "bump", "duration": 1.5, "vehicle": PAPER}


@pytest.fixture(scope="module")
def engineer(tmp_path_factory, workers):
    """A session on a service with workers."""
    with open_client(Settings(data=tmp_path_factory.mktemp("sweeps"), cluster=workers)) as client:
        yield Visitor(client)


def submit(visitor: Visitor, **asked) -> dict:
    return visitor.submit("sweeps", {"design": BOX, **BUMP, **asked})


@pytest.fixture(scope="module")
def done(engineer) -> dict:
    """A sweep that is done."""
    return engineer.wait_for("sweeps", submit(engineer)["id"])


def rows(visitor: Visitor, job: dict):
    reply = visitor.get(f"/sweeps/{job['id']}/cars.parquet")
    assert reply.status_code == 200, reply.text
    return parquet.read_table(io.BytesIO(reply.content))


def assert_same(table, other):
    """The same columns with the same values; not a number is itself."""
    assert table.schema.equals(other.schema, check_metadata=True)
    for name in table.column_names:
        assert_array_equal(table[name].to_numpy(), other[name].to_numpy())


def test_the_rows_are_those_of_the_engine(engineer, done):
    """Oracle: the engine called directly."""
    assert done["state"] == "done", done["error"]
    design = Sobol({name: tuple(ends) for name, ends in RANGES.items()}, 12, seed=3)
    bump = FreeExcitation(reference_manoeuvres()["bump"].lasting(1.5))
    [block] = sweep_through(reference_vehicles()["paper"], design, bump)
    table = rows(engineer, done)
    assert table.column_names == list(block)
    for name, values in block.items():
        assert_array_equal(table[name].to_numpy(), values)
    told = json.loads(table.schema.metadata[b"ridetune"])
    assert told["design"] == design.to_json() == done["design"]
    assert told["vehicle"] == PAPER == done["vehicle"]
    assert told["columns"] == done["result"]["columns"]
    assert [one["name"] for one in told["columns"]] == [one.name for one in columns(design)]
    assert (done["result"]["cars"], done["result"]["failed"]) == (12, 0)


def test_progress_counts_cars_and_events_end_with_the_last_state(engineer, done):
    assert (done["progress"]["cars"], done["progress"]["of"]) == (12, 12)
    events = engineer.get(f"/sweeps/{done['id']}/events").text
    assert events.startswith("event: state")
    assert '"state":"done"' in events.replace(" ", "")


def test_the_rows_come_in_every_form(engineer, done):
    """Oracle: the Parquet file."""
    table = rows(engineer, done)
    place = f"/sweeps/{done['id']}/cars"
    arrow = feather.read_table(io.BytesIO(engineer.get(f"{place}.arrow").content))
    assert_same(arrow, table)
    reply = engineer.get(f"{place}.csv")
    assert reply.headers["content-type"] == "text/csv; charset=utf-8"
    lines = reply.text.splitlines()
    assert len(lines) == 13
    assert lines[0].startswith("car,front.suspension.stiffness [N/m],chassis.mass [kg],")
    read = np.array([float(line.split(",")[2]) for line in lines[1:]])
    assert_array_equal(read, table["chassis.mass"].to_numpy())
    assert engineer.get(f"{place}.xlsx").status_code == 422


def test_a_file_is_no_larger_than_was_held_against_the_session_s_room(engineer, done):
    """Of few cars it is hardly more than what it says of itself."""
    written = len(engineer.get(f"/sweeps/{done['id']}/cars.parquet").content)
    assert written <= most_bytes(design_of(SweepRequest.model_validate({"design": BOX}).design))


def test_what_a_sweep_shows_repeats_it(engineer, done):
    """Oracle: the rows of the first. The session's car has changed in between."""
    assert engineer.put("/vehicle", json={**PAPER, "name": "another"}).status_code == 200
    again = {name: done[name] for name in SweepRequest.model_fields if name != "key"}
    again = engineer.wait_for("sweeps", submit(engineer, **again)["id"])
    assert_same(rows(engineer, again), rows(engineer, done))


@pytest.mark.parametrize("mode", ["rims", "posts"])
def test_a_recording_moves_the_cars_and_stays_while_it_does(engineer, mode):
    run = engineer.get("/measurements").json()[0]["id"]
    if mode == "posts":
        history = engineer.post(
            "/simulations",
            json={"manoeuvre": "heave", "duration": 2.0},
            headers={"Accept": "text/csv"},
        )
        run = engineer.upload(history.content, "rig.csv").json()["id"]
    asked = {"manoeuvre": None, "duration": None, mode: {"measurement": run}}
    levels = {"K_F": [2e4, 2.5e4], "front.tyre.stiffness": {"low": 1e5, "high": 2e5, "count": 2}}
    job = submit(engineer, **asked, design={"kind": "full-factorial", "levels": levels})
    assert job["runs"][0]["id"] == run
    ended = engineer.wait_for("sweeps", job["id"])
    assert ended["state"] == "done", ended["error"]
    assert set(rows(engineer, ended)["status"].to_pylist()) == {OK}


def test_failed_cars_are_counted_and_say_why(engineer):
    design = {"kind": "full-factorial", "levels": {"phi_F": [0.07, 1.48]}}
    ended = engineer.wait_for("sweeps", submit(engineer, design=design)["id"])
    assert (ended["result"]["cars"], ended["result"]["failed"]) == (2, 1)
    table = rows(engineer, ended)
    assert table["status"].to_pylist()[1].startswith("Front.pivot lies")
    assert np.isnan(table[figures()[0].name].to_numpy()[1])


def test_a_running_sweep_is_cancelled_and_has_no_rows(engineer):
    job = submit(engineer, design={**BOX, "cars": 20_000})["id"]
    engineer.wait_for("sweeps", job, "running")
    early = engineer.get(f"/sweeps/{job}/cars.parquet")
    assert (early.status_code, "wait until it is done" in early.text) == (409, True)
    assert engineer.post(f"/sweeps/{job}/cancel").status_code == 202
    ended = engineer.wait_for("sweeps", job)
    assert (ended["state"], ended["error"], ended["result"]) == ("cancelled", None, None)
    refused = engineer.get(f"/sweeps/{job}/cars.csv")
    assert (refused.status_code, "ask for it again" in refused.text) == (409, True)


def test_sweeps_and_identifications_are_kept_apart(engineer, done):
    assert done["id"] in [job["id"] for job in engineer.get("/sweeps").json()]
    assert engineer.get("/identifications").json() == []
    session = engineer.get().json()
    assert session["identifications"] == []
    assert session["sweeps"] == engineer.get("/sweeps").json()
    for method, path in (("GET", ""), ("GET", "/events"), ("POST", "/cancel"), ("DELETE", "")):
        reply = engineer.request(method, f"/identifications/{done['id']}{path}")
        assert (reply.status_code, "no identification with" in reply.text) == (404, True)
    stranger = Visitor(engineer.client)
    assert stranger.get(f"/sweeps/{done['id']}/cars.parquet").status_code == 404


def test_a_deleted_sweep_takes_its_file_along(engineer):
    job = engineer.wait_for("sweeps", submit(engineer, design={**BOX, "cars": 2})["id"])
    store = engineer.client.app.state.services.store
    file = store.directory.original(store.jobs.get(engineer.id, job["id"]).file)
    assert file.exists()
    assert engineer.delete(f"/sweeps/{job['id']}").status_code == 204
    assert engineer.get(f"/sweeps/{job['id']}").status_code == 404
    assert not file.exists()


REFUSED = {
    "unknown parameter": ({"design": {**BOX, "ranges": {"chassis.mas": [1, 2]}}}, "chassis.mass?"),
    "crossed bounds": ({"design": {**BOX, "ranges": {"K_F": [2e4, 1e4]}}}, "crossed"),
    "no parameter": ({"design": {**BOX, "ranges": {}}}, "varies nothing"),
    "too many cars": ({"design": {**BOX, "cars": 10**12}}, "at most 100000"),
    "too many steps": ({"design": {**BOX, "cars": 100_000}, "step": 2e-5}, "steps together"),
    "too long a car": ({"duration": 10, "step": 1e-5}, "1000000 steps a car are asked for"),
    "no cars": ({"design": {**BOX, "cars": 0}}, "cars is 0"),
    "unstable step": (
        {"design": {**BOX, "ranges": {"C_F": [1e3, 2e5]}}},
        "take a step of at most",
    ),
    "zero duration": ({"duration": 0}, "A duration of 0 s"),
    "unknown design": ({"design": {"kind": "grid"}}, "field design.kind is refused"),
    "no kind of design": ({"design": {"cars": 4}}, "field design.kind is missing"),
    "a text for a design": ({"design": "sobol"}, "field design is refused: input should be an obj"),
    "misspelt key": ({"design": {**BOX, "sed": 3}}, "field design.sed is not known"),
    "one bound": ({"design": {**BOX, "ranges": {"K_F": [1e4]}}}, "design.ranges.K_F.1 is missing"),
    "a text for a number": (
        {"design": {**BOX, "ranges": {"K_F": ["1e4", 2e4]}}},
        "field design.ranges.K_F.0 is refused: input should be a valid number",
    ),
    "a truth for a number": ({"design": {**BOX, "cars": True}}, "field design.cars is refused"),
    "a fraction of a car": ({"design": {**BOX, "cars": 2.5}}, "field design.cars is refused"),
    "a text for a truth": ({"lift_off": "no"}, "field lift_off is refused"),
    "no count of levels": (
        {"design": {"kind": "full-factorial", "levels": {"K_F": {"low": 1e4, "high": 2e4}}}},
        "field design.levels.K_F.count is missing",
    ),
    "no levels": ({"design": {"kind": "full-factorial"}}, "field design.levels is missing"),
    "bad levels": (
        {"design": {"kind": "full-factorial", "levels": {"K_F": "all"}}},
        "field design.levels.K_F is refused: give a list of numbers, or low, high and count",
    ),
    "two drives": ({"rims": {"measurement": "x"}}, "manoeuvre and rims"),
    "unknown recording": (
        {"manoeuvre": None, "duration": None, "posts": {"measurement": "x"}},
        "no measurement",
    ),
    "duration of a recording": (
        {"manoeuvre": None, "posts": {"measurement": "x"}},
        "duration means nothing with posts",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_sweep_that_cannot_be_is_refused_before_it_is_queued(engineer, name):
    more, told = REFUSED[name]
    before = engineer.get("/sweeps").json()
    reply = engineer.post("/sweeps", json={"design": BOX, **BUMP, **more})
    assert reply.status_code in (404, 422), reply.text
    assert told in reply.json()["detail"]
    assert engineer.get("/sweeps").json() == before


def test_the_same_key_sweeps_once_however_the_parameters_are_called(engineer):
    first = submit(engineer, key="click-1", design={**BOX, "cars": 2})
    named = {"front.suspension.stiffness": RANGES["K_F"], "chassis.mass": RANGES["chassis.mass"]}
    again = submit(engineer, key="click-1", design={**BOX, "cars": 2, "ranges": named})
    assert again["id"] == first["id"]
    other = engineer.post("/sweeps", json={"design": BOX, **BUMP, "key": "click-1"})
    assert (other.status_code, other.json()["field"]) == (422, "key")


def test_a_file_that_would_not_fit_into_the_session_is_refused_at_once(tmp_path, clusters):
    limits = Limits(session_bytes=3_000_000)
    with open_client(Settings(data=tmp_path, limits=limits)) as client:
        visitor = Visitor(client)
        for kept in visitor.get("/measurements").json():
            visitor.delete(f"/measurements/{kept['id']}")
        refused = visitor.post("/sweeps", json={"design": {**BOX, "cars": 20_000}, **BUMP})
        assert (refused.status_code, "3 MB together" in refused.text) == (429, True)


def test_what_goes_to_the_worker_is_everything_it_needs(tmp_path, clusters):
    """The same payload after a restart, though the session's car has changed."""
    settings = Settings(data=tmp_path)
    with open_client(settings) as client:
        visitor = Visitor(client)
        run = visitor.get("/measurements").json()[0]["id"]
        asked = {"manoeuvre": None, "duration": None, "rims": {"measurement": run}}
        job = submit(visitor, **asked)["id"]
        until(lambda: f"{job}/0-11" in clusters[-1].tasks)
        _, first, _ = clusters[-1].tasks[f"{job}/0-11"]
        assert first["vehicle"] == PAPER
        assert "wheel.fl.z" in first["run"]
        assert visitor.delete(f"/measurements/{run}").status_code == 409
        visitor.put("/vehicle", json={**PAPER, "name": "another"})
    with open_client(settings):
        until(lambda: f"{job}/0-11" in clusters[-1].tasks)
        _, again, _ = clusters[-1].tasks[f"{job}/0-11"]
        assert again["vehicle"] == PAPER
        assert_array_equal(again["run"]["chassis.a_x"], first["run"]["chassis.a_x"])
        assert {name: again[name] for name in again if name != "run"} == {
            name: first[name] for name in first if name != "run"
        }


def test_a_sweep_kept_from_before_there_were_shares_is_one(done):
    """Oracle: the same sweep's result. Its spec told neither cars nor share."""
    told: list = []
    spec = {name: done[name] for name in SweepRequest.model_fields if name in done} | {"run": None}
    division = sweep(None, None).division
    [share] = division.names(spec)
    assert share == "0-11"
    attempt = Attempt(told.append, lambda: False, lambda part, data: None, {})
    part = division.unit({**spec, "unit": share}, attempt)
    assert division.progress(spec, {share: told[-1]}, 1) == {**part.result, "of": 12}
    whole = join_shares(spec, replace(attempt, kept={share: part.file}))
    assert whole.result == done["result"]


def test_a_sweep_outlives_a_kill_of_the_service_and_so_do_the_rows_of_another(tmp_path, workers):
    with LiveService(tmp_path) as service:
        visitor = Visitor(service.ready().client)
        done = visitor.wait_for("sweeps", submit(visitor)["id"])
        before = rows(visitor, done)
        job = submit(visitor, design={**BOX, "cars": 100})["id"]
        assert visitor.wait_for("sweeps", job, "running")["state"] == "running"
        service.kill()
    with open_client(Settings(data=tmp_path, cluster=workers)) as visitor.client:
        assert_same(rows(visitor, done), before)
        ended = visitor.wait_for("sweeps", job)
        assert ended["state"] == "done", ended["error"]
        assert rows(visitor, ended).num_rows == 100
