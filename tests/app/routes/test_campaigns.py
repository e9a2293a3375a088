"""Campaigns over REST: from the request to the recordings, by the real engine on real workers."""

import io
import json
import time
import zipfile

import pytest
from ridetune.app.jobs.worker import Attempt, CutShort
from ridetune.app.limits import Limits
from ridetune.app.schemas import CampaignRequest
from ridetune.app.settings import Settings
from ridetune.app.work.campaign import campaign, check_and_fill, drive_one, join_drives
from ridetune.engine.campaign import CAMPAIGN, Campaign, chosen, roughened
from ridetune.engine.campaign_run import drive
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.plant import DetailedPlant
from ridetune.engine.errors import RideError
from ridetune.engine.extras import how_to_install
from ridetune.engine.manoeuvre import manoeuvre_from_json, manoeuvre_to_json, reference_manoeuvres
from ridetune.engine.measurement import run_to_csv
from ridetune.engine.plant import ConceptPlant
from ridetune.engine.sensor_file import noisy
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_to_json

from ..conftest import PATIENCE, Visitor, open_client

CAR = reference_vehicles()["paper"]
PAPER = vehicle_to_json(CAR)
NOISE = {"chassis.z": 1e-3, "wheel.fl.z": 2e-4}
SHORT = {"vehicle": PAPER, "manoeuvres": ["bump", "brake-54"], "noise": NOISE, "seed": 5}
BUMP = manoeuvre_to_json(reference_manoeuvres()["bump"])


@pytest.fixture(scope="module")
def engineer(tmp_path_factory, workers):
    """A session on a service with workers."""
    with open_client(
        Settings(data=tmp_path_factory.mktemp("campaigns"), cluster=workers)
    ) as client:
        yield Visitor(client)


def submit(visitor: Visitor, **asked) -> dict:
    return visitor.submit("campaigns", {**SHORT, **asked})


@pytest.fixture(scope="module")
def done(engineer) -> dict:
    """A campaign that is done."""
    ended = engineer.wait_for("campaigns", submit(engineer)["id"])
    assert ended["state"] == "done", ended["error"]
    return ended


def text(visitor: Visitor, job: dict, name: str) -> str:
    reply = visitor.get(f"/campaigns/{job['id']}/files/{name}")
    assert reply.status_code == 200, reply.text
    return reply.text


def by_engine(**told) -> dict[str, str]:
    """CSV by recording, of the engine called directly."""
    driven = roughened(chosen(["bump", "brake-54"]), **told)
    campaign = Campaign.plan(ConceptPlant(CAR), noisy(NOISE, "noise"), driven, 5)
    return {one.name: run_to_csv(one.run) for one in drive(campaign, processes=1) if one.run}


def test_the_recordings_are_those_of_the_engine(engineer, done):
    """Oracle: the engine called directly, with the same seed."""
    assert [one["state"] for one in done["result"]["recordings"]] == ["whole", "whole"]
    for name, recording in by_engine().items():
        assert text(engineer, done, f"{name}.csv") == recording
    assert json.loads(text(engineer, done, "truth.json"))["vehicle"] == PAPER == done["vehicle"]


def test_the_random_roads_are_those_that_are_asked_for(engineer, done):
    """Oracle: the engine called directly. The bump is no random road."""
    told = {"class_factor": 0.5, "band": [0.05, 2.0], "road_seed": 9}
    ended = engineer.wait_for("campaigns", submit(engineer, **told)["id"])
    expected = by_engine(class_factor=0.5, band=(0.05, 2.0), seed=9)
    for name, recording in expected.items():
        assert text(engineer, ended, f"{name}.csv") == recording
    same = [text(engineer, ended, f"{n}.csv") == text(engineer, done, f"{n}.csv") for n in expected]
    assert same == [True, False]


def test_what_a_campaign_shows_repeats_it(engineer, done):
    """Oracle: the recordings of the first. The session's car has changed in between."""
    assert engineer.put("/vehicle", json={**PAPER, "name": "another"}).status_code == 200
    fields = ("plant", "vehicle", "manoeuvres", "class_factor", "band", "road_seed")
    fields += ("noise", "sensors", "seed", "format")
    again = submit(engineer, **{name: done[name] for name in fields})
    again = engineer.wait_for("campaigns", again["id"])
    assert again["result"]["recordings"] == done["result"]["recordings"]


def test_untold_the_session_s_car_drives_the_usual_manoeuvres_on_ideal_sensors(engineer):
    """The request is not driven here; what it stands for is shown at once."""
    visitor = Visitor(engineer.client)
    job = visitor.post("/campaigns", json={}).json()
    assert list(job["manoeuvres"]) == list(CAMPAIGN)
    assert (job["plant"], job["noise"], job["sensors"], job["format"]) == (
        "concept",
        {},
        None,
        "csv",
    )
    car = visitor.get(f"/campaigns/{job['id']}").json()["vehicle"]
    assert car == visitor.get("/vehicle").json()
    assert visitor.post(f"/campaigns/{job['id']}/cancel").status_code == 202


def test_progress_counts_drives_and_events_end_with_the_last_state(engineer, done):
    progress = done["progress"]
    assert [progress[name] for name in ("runs", "of", "failed")] == [2, 2, 0]
    assert progress["driven"] == progress["duration"] == 16.0
    events = engineer.get(f"/campaigns/{done['id']}/events").text
    assert '"state":"done"' in events.replace(" ", "")


def test_the_archive_holds_the_files_that_are_listed(engineer, done):
    listed = engineer.get(f"/campaigns/{done['id']}/files").json()
    reply = engineer.get(f"/campaigns/{done['id']}/campaign.zip")
    with zipfile.ZipFile(io.BytesIO(reply.content)) as archive:
        assert archive.namelist() == [one["name"] for one in listed]
        assert {one["name"]: one["bytes"] for one in listed} == {
            one.filename: one.file_size for one in archive.infolist()
        }
        for name in archive.namelist():
            assert archive.read(name).decode() == text(engineer, done, name)
    assert {"vehicle.json", "truth.json", "manoeuvre_bump.csv", "manoeuvre_bump.toml"} <= {
        one["name"] for one in listed
    }
    strange = engineer.get(f"/campaigns/{done['id']}/files/other.csv")
    assert (strange.status_code, "no file by that name" in strange.text) == (404, True)
    stranger = Visitor(engineer.client)
    assert stranger.get(f"/campaigns/{done['id']}/campaign.zip").status_code == 404


def test_recordings_become_measurements_once(engineer, done):
    """With the noise that was put on them, and byte for byte."""
    before = engineer.get("/measurements").json()
    reply = engineer.post(f"/campaigns/{done['id']}/measurements")
    assert reply.status_code == 201, reply.text
    taken = reply.json()
    assert [one["name"] for one in taken] == ["manoeuvre_bump.csv", "manoeuvre_brake-54.csv"]
    assert all(one["noise"] == NOISE and one["usable_for_identification"] for one in taken)
    assert {(one["vehicle"], one["plant"]) for one in taken} == {(CAR.name, "concept")}
    original = engineer.get(f"/measurements/{taken[0]['id']}/original")
    assert original.text == text(engineer, done, "manoeuvre_bump.csv")
    assert engineer.post(f"/campaigns/{done['id']}/measurements").json() == taken
    assert len(engineer.get("/measurements").json()) == len(before) + 2


def test_recordings_that_do_not_all_fit_are_not_taken_over(tmp_path, workers):
    limits = Limits(session_measurements=3)
    with open_client(Settings(data=tmp_path, cluster=workers, limits=limits)) as client:
        visitor = Visitor(client)
        job = visitor.wait_for("campaigns", submit(visitor)["id"])
        refused = visitor.post(f"/campaigns/{job['id']}/measurements")
        assert (refused.status_code, "delete one first" in refused.text) == (429, True)
        assert len(visitor.get("/measurements").json()) == 2


def test_mdf4_comes_as_a_file_but_is_not_read_back(engineer):
    job = engineer.wait_for("campaigns", submit(engineer, format="mf4")["id"])
    file = engineer.get(f"/campaigns/{job['id']}/files/manoeuvre_bump.mf4")
    assert file.content.startswith(b"MDF     4.1")
    refused = engineer.post(f"/campaigns/{job['id']}/measurements")
    assert (refused.status_code, "format csv" in refused.text) == (409, True)


def test_own_manoeuvres_and_sensors(engineer):
    """Names are the caller's; what the sensors list is recorded and nothing else."""
    asked = {
        "manoeuvres": {"mine": {**BUMP, "duration": 2.0}, "known": "bump"},
        "noise": {},
        "sensors": {"rate_hz": 100, "sensors": {"chassis.z": {"noise": 1e-3}}},
    }
    job = engineer.wait_for("campaigns", submit(engineer, **asked)["id"])
    assert [one["file"] for one in job["result"]["recordings"]] == [
        "manoeuvre_mine.csv",
        "manoeuvre_known.csv",
    ]
    lines = text(engineer, job, "manoeuvre_mine.csv").splitlines()
    assert (lines[0], len(lines)) == ("time [s],chassis.z [m]", 202)


def attempt(told: list, kept=None) -> Attempt:
    """Nobody cancels it."""
    return Attempt(told.append, lambda: False, lambda part, data: None, kept or {})


def test_a_cancelled_campaign_keeps_what_had_ended(done):
    """In the workers' tasks; the second drive had not ended when it was told to stop."""
    asked, told = {**done, "noise": NOISE, "sensors": None}, []
    drive = drive_one({**asked, "unit": "manoeuvre_bump"}, attempt(told))
    assert (drive.result["runs"], drive.result["failed"]) == (1, 0)
    assert told[-1]["driven"] <= drive.result["driven"] == reference_manoeuvres()["bump"].duration
    with pytest.raises(CutShort) as stopped:
        join_drives(asked, attempt([], {"manoeuvre_bump": drive.file}))
    whole, missing = stopped.value.kept.result["recordings"]
    assert (whole["name"], whole["state"]) == ("manoeuvre_bump", "whole")
    assert (missing["state"], missing["file"]) == ("missing", None)
    assert "cancelled" in missing["failure"]
    with zipfile.ZipFile(io.BytesIO(stopped.value.kept.file)) as archive:
        assert whole["file"] in archive.namelist()


def test_a_running_campaign_has_no_files_until_it_is_cancelled(engineer):
    """Thirty drives of 20 s take seconds."""
    long = {f"drive-{k}": "1" for k in range(30)}
    job = submit(engineer, manoeuvres=long)["id"]
    engineer.wait_for("campaigns", job, "running")
    early = engineer.get(f"/campaigns/{job}/files")
    assert (early.status_code, "wait until it has ended" in early.text) == (409, True)
    deadline = time.monotonic() + PATIENCE
    while not engineer.get(f"/campaigns/{job}").json()["progress"].get("runs"):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert engineer.post(f"/campaigns/{job}/cancel").status_code == 202
    ended = engineer.wait_for("campaigns", job)
    assert ended["state"] == "cancelled", ended["error"]
    states = [one["state"] for one in ended["result"]["recordings"]]
    whole = states.count("whole")
    assert 0 < whole < 30
    assert states == ["whole"] * whole + ["missing"] * (30 - whole)
    taken = engineer.post(f"/campaigns/{job}/measurements").json()
    assert len(taken) == whole
    assert engineer.delete(f"/campaigns/{job}").status_code == 204
    assert engineer.get(f"/campaigns/{job}/files").status_code == 404


REFUSED = {
    "unknown plant": ({"plant": "concpt"}, "did you mean concept?"),
    "another plant": ({"plant": "lorry"}, "there are concept, detailed."),
    "a vehicle for a car with its own data": ({"plant": "detailed"}, "leave out vehicle"),
    "unknown manoeuvre": ({"manoeuvres": ["brake-55"]}, "did you mean brake-54?"),
    "no manoeuvre": ({"manoeuvres": []}, "has no manoeuvre"),
    "a manoeuvre twice": ({"manoeuvres": ["1", "1"]}, "names 1 twice"),
    "a rig": ({"manoeuvres": ["heave"]}, "moves the posts of a rig"),
    "a text for manoeuvres": ({"manoeuvres": "1"}, "field manoeuvres is refused: give a list"),
    "a number for a manoeuvre": ({"manoeuvres": {"a": 1}}, "field manoeuvres.a is refused: give a"),
    "a path for a name": ({"manoeuvres": {"../a": "1"}}, "1 to 60 letters, digits, - and _"),
    "misspelt key of a manoeuvre": (
        {"manoeuvres": {"a": {**BUMP, "sed": 1}}},
        'did you mean "seed"',
    ),
    "negative noise": ({"noise": {"chassis.z": -1e-3}}, "field noise.chassis.z is refused: input"),
    "noise of nothing": ({"noise": {"chassis.zz": 1e-3}}, "which is not recorded"),
    "noise twice": ({"sensors": {}}, "leave out noise"),
    "negative noise of a sensor": (
        {"noise": {}, "sensors": {"sensors": {"chassis.z": {"noise": -1}}}},
        "sensors.chassis.z.noise is -1, but must lie",
    ),
    "negative class factor": ({"class_factor": -1}, "class_factor is -1"),
    "crossed band": ({"band": [2, 1]}, "band"),
    "half a band": ({"band": [2]}, "field band.1 is missing"),
    "no random road": ({"manoeuvres": ["bump"], "class_factor": 0.5}, "has a random road"),
    "negative seed": ({"seed": -1}, "field seed is refused"),
    "a fraction of a seed": ({"road_seed": 0.5}, "field road_seed is refused"),
    "unknown format": ({"format": "mat"}, "field format is refused"),
    "a misspelt field": ({"sensor": {}}, "field sensor is not known here"),
    "no car": ({"vehicle": {}}, "name is missing"),
    "too long": ({"manoeuvres": {f"d{k}": "1" for k in range(31)}}, "620 s together"),
    "too long for a car that takes long": (
        {"plant": "detailed", "vehicle": None, "manoeuvres": {f"d{k}": "1" for k in range(11)}},
        "220 s together, a campaign of the detailed car, 2.5 s a driven second, over REST takes at"
        " most 200 s; leave some out",
    ),
    "too much": (
        {
            "noise": {},
            "manoeuvres": {f"d{k}": "1" for k in range(30)},
            "sensors": {
                "rate_hz": 400,
                "points": {f"point.p{k}": [0, 0, 0] for k in range(99)},
                "sensors": {f"point.p{k}.a_z": {} for k in range(99)},
            },
        },
        "500 MB together",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_campaign_that_cannot_be_is_refused_before_it_is_queued(engineer, name):
    more, told = REFUSED[name]
    before = engineer.get("/campaigns").json()
    reply = engineer.post("/campaigns", json={**SHORT, **more})
    assert reply.status_code in (404, 422, 429), reply.text
    assert told in reply.json()["detail"]
    assert engineer.get("/campaigns").json() == before


def test_a_drive_that_diverges_is_kept_as_far_as_it_came(engineer):
    """A tyre a hundred times too stiff for the step."""
    car = json.loads(json.dumps(PAPER))
    car["front"]["tyre"]["stiffness"] = car["rear"]["tyre"]["stiffness"] = 4e7
    job = engineer.wait_for("campaigns", submit(engineer, vehicle=car)["id"])
    for one in job["result"]["recordings"]:
        assert one["state"] != "whole"
        assert one["failure"].endswith(".")
    refused = engineer.post(f"/campaigns/{job['id']}/measurements")
    assert (refused.status_code, "no whole recording" in refused.text) == (409, True)


def test_a_campaign_kept_from_before_it_told_its_drives_has_the_same():
    """Oracle: what is told since."""
    asked = CampaignRequest.model_validate({"manoeuvres": ["bump", "2"]})
    spec, division = check_and_fill(None, asked, PAPER, Limits()), campaign().division
    earlier = {name: spec[name] for name in spec if name not in ("drives", "slow")}
    assert division.names(earlier) == division.names(spec) == ["manoeuvre_bump", "manoeuvre_2"]
    assert division.slow(earlier) is division.slow(spec) is False


def test_the_same_key_drives_once(tmp_path, clusters):
    with open_client(Settings(data=tmp_path)) as client:
        visitor = Visitor(client)
        first = submit(visitor, key="click-1")
        assert submit(visitor, key="click-1") == first
        other = visitor.post("/campaigns", json={**SHORT, "seed": 6, "key": "click-1"})
        assert (other.status_code, other.json()["field"]) == (422, "key")


def test_the_plants_are_listed(client):
    concept, detailed = client.get("/api/plants").json()
    assert (concept["key"], concept["takes_vehicle"], concept["missing"]) == ("concept", True, "")
    assert (detailed["key"], detailed["takes_vehicle"], detailed["missing"]) == (
        "detailed",
        False,
        "",
    )
    assert detailed["effort"] > 1000 * concept["effort"]


def test_a_car_whose_solver_is_not_installed_is_listed_and_refused(visitor, monkeypatch):
    """Refused by what a simulator calls, here, where the solver is hidden."""
    monkeypatch.setattr("ridetune.engine.detailed.exudyn_module.find_spec", lambda name: None)
    _, detailed = visitor.client.get("/api/plants").json()
    remedy = f"{how_to_install('detailed')}, and start a running service again."
    assert detailed["missing"].endswith(f"not installed; {remedy}")
    asked = CampaignRequest.model_validate({"plant": "detailed", "manoeuvres": ["bump"]})
    with pytest.raises(RideError) as refused:
        check_and_fill(None, asked, {}, Limits())
    assert str(refused.value) == detailed["missing"]


def test_the_detailed_car_tells_how_far_it_is_and_stops_in_the_midst_of_a_drive(engineer):
    """Oracle: the engine called directly, of the drive that ends before the campaign is cancelled.

    The second drive would take minutes; what it has reported by then lies between its ends.
    """
    pull = {"kind": "table", "time": [0.0, 0.2], "torque": [0.0, 600.0]}
    short = {"name": "pull", "kind": "road", "duration": 0.4, "drive": pull}
    asked = {"plant": "detailed", "vehicle": None, "noise": {}, "seed": 0}
    job = submit(engineer, **asked, manoeuvres={"pull": short, "rest": {**short, "duration": 60}})
    told, deadline = set(), time.monotonic() + PATIENCE
    while len([seconds for seconds in told if seconds > 0.4]) < 3:
        assert time.monotonic() < deadline, told
        time.sleep(0.02)
        told.add(engineer.get(f"/campaigns/{job['id']}").json()["progress"].get("driven", 0.0))
    engineer.post(f"/campaigns/{job['id']}/cancel")
    ended = engineer.wait_for("campaigns", job["id"])
    assert max(told) < 60.0
    assert ended["progress"]["runs"] == 1
    whole, missing = ended["result"]["recordings"]
    assert (ended["state"], whole["state"], missing["state"]) == ("cancelled", "whole", "missing")
    plant = DetailedPlant.of(reference_car())
    campaign = Campaign.plan(plant, noisy({}, "noise"), {"pull": manoeuvre_from_json(short)})
    [recording] = drive(campaign, processes=1)
    assert recording.run is not None
    assert text(engineer, ended, "manoeuvre_pull.csv") == run_to_csv(recording.run)
    known = engineer.get(f"/campaigns/{ended['id']}/files/vehicle.json").json()
    assert known == vehicle_to_json(plant.vehicle)
    assert engineer.put("/vehicle", json=known).status_code == 200
