"""Steps over REST: suggested, applied, recorded, and what jobs make of them."""

import json

import numpy as np
import pytest
from ridetune.app.recordings.recordings import as_stated
from ridetune.app.storage.measurement import stated
from ridetune.engine.conditioning.chain import condition, steps_from_json
from ridetune.engine.conditioning.kinds import steps_to_add
from ridetune.engine.measurement import parse_run, read_run, run_to_csv
from ridetune.engine.run_notes import notes_of
from ridetune.engine.step_record import step_record_to_json
from ridetune.engine.vehicle_file import vehicle_from_json, vehicle_to_json

from ...factories import paper_vehicle
from ...raw_sensors import drive, recorded
from ..conftest import Visitor, open_client, short_recording

CAR = paper_vehicle()
CAR_JSON = vehicle_to_json(CAR)


@pytest.fixture(scope="module")
def raw():
    """What raw sensors record of Manoeuvre 2, 200 times a second."""
    return recorded(CAR, drive(CAR, sample_step=0.005), seed=2)


@pytest.fixture
def kept(visitor, raw):
    return visitor.upload(run_to_csv(raw).encode(), "raw.csv").json()


def address(kept):
    return f"/measurements/{kept['id']}/conditioning"


def test_a_raw_recording_becomes_one_to_identify_from(visitor, kept, raw):
    assert kept["conditioning"] is None
    assert kept["usable_for_identification"] is False
    shown = visitor.get(address(kept)).json()
    assert (shown["steps"], shown["record"], shown["vehicle"]) == ([], [], None)
    assert shown["kinds"] == steps_to_add(raw)
    suggestion = shown["suggestion"]
    assert suggestion["lacks"] == []
    assert suggestion["output_highpass_hz"] == pytest.approx(0.6)

    reply = visitor.put(address(kept), json={"steps": suggestion["steps"]})
    assert reply.status_code == 200, reply.text
    done = reply.json()
    assert done["steps"] == suggestion["steps"]
    assert [one["step"] for one in done["record"]] == suggestion["steps"]
    assert all(one["sentences"] for one in done["record"])
    assert done["suggestion"] == suggestion
    assert shown["output_highpass_hz"] is None
    assert done["output_highpass_hz"] == suggestion["output_highpass_hz"]
    measurement = done["measurement"]
    assert measurement["usable_for_identification"] is True
    assert measurement["conditioning"] == suggestion["steps"]
    assert visitor.get(f"/measurements/{kept['id']}").json() == measurement
    # The vehicle is the session's at that time, and stays.
    assert done["vehicle"] == visitor.get().json()["vehicle"]


def test_a_conditioned_recording_is_saved_with_the_record_of_its_steps(
    visitor, kept, raw, tmp_path
):
    """Oracle: the same steps done by the engine."""
    suggestion = visitor.get(address(kept)).json()["suggestion"]
    visitor.put(address(kept), json={"steps": suggestion["steps"]})
    for name in ("run.csv", "run.toml"):
        saved = visitor.get(f"/measurements/{kept['id']}/{name}")
        (tmp_path / name).write_bytes(saved.content)
    vehicle = vehicle_from_json(visitor.get("/vehicle").json())
    steps = steps_from_json(suggestion["steps"])
    sent = parse_run(run_to_csv(raw).encode(), "raw.csv")
    expected, found = condition(sent, steps, vehicle), read_run(tmp_path / "run.csv")
    assert list(found.columns) == list(expected.columns)
    for name in found.columns:
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-11)
    assert [one.step for one in found.conditioning] == [one.step for one in expected.conditioning]


def test_the_original_and_its_histories_can_still_be_had(visitor, kept, raw):
    turned = {"steps": [{"kind": "scale", "channel": "chassis.v_x", "gain": -1}]}
    assert visitor.put(address(kept), json=turned).status_code == 200
    path = f"/measurements/{kept['id']}"
    assert visitor.get(f"{path}/original").content == run_to_csv(raw).encode()
    frames = f"{path}/frames?channels=chassis.v_x"
    after = visitor.get(frames).json()["values"]["chassis.v_x"]
    before = visitor.get(f"{frames}&conditioned=false").json()["values"]["chassis.v_x"]
    np.testing.assert_allclose(after, -np.array(before))
    # No steps: as it was.
    undone = visitor.put(address(kept), json={"steps": []}).json()
    assert undone["measurement"] == kept
    assert visitor.get(frames).json()["values"]["chassis.v_x"] == before


def test_a_job_keeps_the_steps_that_it_was_given(visitor, kept, client):
    """What its worker gets is what `as_stated` makes of what the job states."""
    steps = visitor.get(address(kept)).json()["suggestion"]["steps"]
    visitor.put(address(kept), json={"steps": steps})
    services = client.app.state.services
    told = json.loads(json.dumps(stated(services.store.measurements.get(visitor.id, kept["id"]))))
    visitor.put(address(kept), json={"steps": []})
    now = services.store.measurements.get(visitor.id, kept["id"])
    assert services.recordings.run(now).conditioning == ()
    then = services.recordings.run(as_stated(services.store, visitor.id, told))
    assert [record.step for record in then.conditioning] == steps
    refused = visitor.post("/identifications", json={"runs": [kept["id"]]})
    assert "has none of chassis.z, chassis.pitch, chassis.roll" in refused.json()["detail"]


def test_a_simulation_follows_the_wheels_that_the_steps_made(visitor, kept):
    steps = visitor.get(address(kept)).json()["suggestion"]["steps"]
    visitor.put(address(kept), json={"steps": steps})
    settings = {"output_highpass_hz": 0.6}
    asked = {"rims": {"measurement": kept["id"], "settings": settings}, "vehicle": CAR_JSON}
    shown = visitor.post("/simulations", json=asked)
    assert shown.status_code == 200, shown.text
    assert shown.json()["fit_percent"]["chassis.z"] > 90.0


def test_steps_survive_a_restart(settings, raw):
    with open_client(settings) as client:
        visitor = Visitor(client)
        kept = visitor.upload(short_recording()).json()
        asked = {"steps": [{"kind": "cut", "begin": 0.2}]}
        assert visitor.put(address(kept), json=asked).status_code == 200
        held = visitor.id, visitor.token
    with open_client(settings) as client:
        visitor.client = client
        assert (visitor.id, visitor.token) == held
        shown = visitor.get(address(kept)).json()
        assert shown["steps"] == asked["steps"]
        assert shown["measurement"]["samples"] == 81


def test_notes_are_those_of_the_recording(visitor, kept):
    """Noise is stated of what the sensors read; a gain of 2 halves it."""
    asked = {"steps": [{"kind": "scale", "channel": "chassis.roll_rate", "gain": 2}]}
    visitor.put(address(kept), json=asked)
    notes = b'[noise]\n"chassis.z" = 0.001\n"chassis.roll_rate" = 0.01\n'
    noted = visitor.put(f"/measurements/{kept['id']}/notes", content=notes)
    assert noted.status_code == 200, noted.text
    assert noted.json()["noise"] == {"chassis.z": 0.001, "chassis.roll_rate": 0.01}
    assert noted.json()["conditioning"] is not None


def test_what_was_done_before_is_told_by_the_notes_and_stays(visitor):
    """Oracle: the record that conditioning left with the run whose CSV and TOML are sent."""
    run = parse_run(short_recording(), "lap.csv")
    done = condition(run, steps_from_json([{"kind": "scale", "channel": "chassis.z", "gain": 2}]))
    [before] = [step_record_to_json(one) for one in done.conditioning]
    kept = visitor.upload(run_to_csv(done).encode(), "lap.csv").json()
    assert kept["conditioned"] is None
    notes = visitor.put(f"/measurements/{kept['id']}/notes", content=notes_of(done).encode())
    assert notes.status_code == 200, notes.text
    assert notes.json()["conditioned"] == [before]
    assert visitor.get(address(kept)).json()["record"] == [before]
    again = {"steps": [{"kind": "scale", "channel": "chassis.z", "gain": 0.5}]}
    record = visitor.put(address(kept), json=again).json()["record"]
    assert record[0] == before
    assert [one["step"]["gain"] for one in record[1:]] == [0.5]


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ({"steps": [{"kind": "rset"}]}, 'steps: step[0].kind "rset" is not known; did you mean'),
        (
            {"steps": [{"kind": "gravity"}]},
            "Run raw.csv, step 1, gravity: the run lacks chassis.pitch",
        ),
        (
            {"steps": [{"kind": "resample", "rate_hz": 1e5}]},
            "samples of 14 channels would be made",
        ),
        ({"steps": [{"kind": "rim-from-travel"}], "vehicle": {}}, "vehicle: name is missing"),
        ({"steps": {"kind": "rest"}}, "The field steps is refused: input should be a valid list"),
        ({}, "The field steps is missing"),
    ],
)
def test_steps_that_cannot_be_done_change_nothing(visitor, kept, body, sentence):
    reply = visitor.put(address(kept), json=body)
    assert reply.status_code == 422
    assert sentence in reply.json()["detail"]
    assert visitor.get(f"/measurements/{kept['id']}").json() == kept


def test_a_measurement_that_is_not_there_has_no_steps(visitor):
    assert visitor.get("/measurements/abc/conditioning").status_code == 404
    assert visitor.put("/measurements/abc/conditioning", json={"steps": []}).status_code == 404
