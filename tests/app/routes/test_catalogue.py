"""What comes with the service: tables, cars, manoeuvres, roads, and the description of it all."""

import json
import math
import tomllib

import pytest
from ridetune.engine.channels import CHANNELS
from ridetune.engine.manoeuvre import manoeuvre_from_json, reference_manoeuvres
from ridetune.engine.parameters import ALL_NAMES
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.sensor_file import sensors_from_json
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_from_json


def test_the_tables_are_the_engines(client):
    parameters = client.get("/api/parameters").json()
    assert [row["name"] for row in parameters] == list(ALL_NAMES)
    assert all(row["slider_lower"] < row["slider_upper"] for row in parameters)
    assert all(row["lower"] <= row["slider_lower"] for row in parameters)
    assert all(row["slider_upper"] <= row["upper"] for row in parameters)
    apart = {row["name"]: row["apart"] for row in parameters if row["apart"]}
    assert apart == dict.fromkeys(("front.pivot.distance", "rear.pivot.distance"), 0.1)
    channels = client.get("/api/channels").json()
    assert [row["name"] for row in channels] == list(CHANNELS)
    pitch = next(row for row in channels if row["name"] == "chassis.pitch")
    assert (pitch["unit"], pitch["display_unit"]) == ("rad", "deg")
    assert pitch["display_factor"] == pytest.approx(180.0 / math.pi)
    noise = {row["name"]: row["default_noise"] for row in channels if row["default_noise"]}
    assert noise == DEFAULT_NOISE


def test_default_bounds_follow_from_start_values(client):
    """Oracle: the rule of docs/identification.md; no positive start, no stiffness to multiply."""
    start = {"front.suspension.stiffness": 2e4, "rear.pivot.distance": -1.2, "Ktor_F": 0.0}
    reply = client.post("/api/parameters/bounds", json={"start": start})
    assert reply.json() == {
        "front.suspension.stiffness": [1e3, 1.6e5],
        "rear.pivot.distance": [-10.0, -0.1],
        "front.stabilizer_bar.stiffness": None,
    }
    reply = client.post("/api/parameters/bounds", json={"start": {"front.suspension": 1.0}})
    assert (reply.status_code, reply.json()["code"]) == (422, "parameter")
    rules = {row["name"]: row["bounds_rule"] for row in client.get("/api/parameters").json()}
    assert rules["front.suspension.stiffness"] == "0.05 to 8 times the start"
    assert rules["rear.pivot.angle"] == "the same for every car"


def test_the_settings_of_the_rims_mode_are_the_engines(client):
    settings = client.get("/api/rims-settings").json()
    assert RimsSettings(**settings) == RimsSettings()


def test_every_listed_car_reads_back_as_itself(client):
    listed = client.get("/api/vehicles").json()
    assert [row["key"] for row in listed] == list(reference_vehicles())
    for row in listed:
        data = client.get(f"/api/vehicles/{row['key']}").json()
        assert vehicle_from_json(data) == reference_vehicles()[row["key"]]


def test_every_listed_manoeuvre_reads_back_as_itself(client):
    listed = client.get("/api/manoeuvres").json()
    assert [row["key"] for row in listed] == list(reference_manoeuvres())
    for row in listed:
        data = client.get(f"/api/manoeuvres/{row['key']}").json()
        assert manoeuvre_from_json(data) == reference_manoeuvres()[row["key"]]


def test_an_unknown_key_lists_the_known_ones(client):
    for path, known in (("vehicles/lada", "paper"), ("manoeuvres/slalom", "constant-speed-c")):
        reply = client.get(f"/api/{path}")
        assert reply.status_code == 404
        assert known in reply.json()["detail"]


def test_a_road_is_previewed_as_it_will_be_driven(client):
    asked = {"road": {"kind": "bump", "begin": 10.0, "length": 2.0, "height": 0.05}, "length": 20.0}
    road = client.post("/api/roads/preview", json={**asked, "points": 201}).json()
    assert (road["x"][0], road["x"][-1], len(road["x"])) == (0.0, 20.0, 201)
    assert max(road["left"]) == pytest.approx(0.05, rel=1e-3)
    assert road["left"] == road["right"]
    assert road["left"][0] == road["left"][-1] == 0.0


def test_a_random_road_follows_its_seed(client):
    def left(seed: int) -> list[float]:
        road = {"kind": "iso8608", "sections": [{"class": "C"}]}
        asked = {"road": road, "length": 50.0, "seed": seed, "points": 100}
        return client.post("/api/roads/preview", json=asked).json()["left"]

    assert left(1) == left(1)
    assert left(1) != left(2)


def test_what_a_road_can_be_made_of(client):
    offered = client.get("/api/roads").json()
    assert offered["classes"] == list("ABCDEFGH")
    assert {"flat", "iso8608", "bump", "pothole", "sine-sweep"} == set(offered["kinds"])
    assert {"exponential", "isotropic"} <= set(offered["coherence"])


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"road": {"kind": "cobbles"}}, "kind"),
        ({"road": {"kind": "bump", "begin": 1, "length": 1, "heigth": 0.1}}, "height"),
        ({"road": {"kind": "flat"}, "length": 1e9}, "length"),
        ({}, "road"),
    ],
)
def test_a_road_that_cannot_be_built_is_refused(client, asked, said):
    reply = client.post("/api/roads/preview", json=asked)
    assert reply.status_code == 422
    assert said in reply.json()["detail"]


TOML = b"""rate_hz = 100
[sensors."wheel.{corner}.z"]
noise = 0.5
unit = "mm"
[sensors.chassis.z]
"""


def test_a_file_of_sensors_is_read_for_a_campaign(visitor):
    """Oracle: the engine's reading of the file. What is answered is what a campaign takes."""
    expected = sensors_from_json(tomllib.loads(TOML.decode()))
    read = visitor.client.post("/api/sensors?name=s.toml", content=TOML).json()
    assert read["channels"] == list(expected.sensors)
    assert read["rate_hz"] == 100.0
    assert sensors_from_json(read["sensors"]) == expected
    data = json.dumps(read["sensors"]).encode()
    again = visitor.client.post("/api/sensors", files={"file": ("s.json", data)})
    assert again.json() == read
    taken = visitor.submit("campaigns", {"manoeuvres": ["bump"], "sensors": read["sensors"]})
    assert taken["sensors"] == read["sensors"]


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"[sensors", "s.toml: not valid TOML"),
        (b"a." * 100_000, "s.toml: line 1 has more than 200 dots"),
        (b'[sensors."chassis.zz"]', "s.toml: sensors.chassis.zz is not known"),
        (b"rate_hz = nan", "s.toml: rate_hz is nan, but must lie"),
        (b"#" * 1_000_001, "s.toml: larger than 1 MB"),
    ],
)
def test_a_file_of_sensors_that_cannot_be_used_is_refused(client, data, said):
    reply = client.post("/api/sensors", files={"file": ("s.toml", data)})
    assert (reply.status_code, reply.json()["code"]) == (422, "measurement")
    assert reply.json()["detail"].startswith(said)


def test_the_formats_of_recordings_are_listed(client, monkeypatch):
    listed = client.get("/api/formats").json()
    assert [(one["key"], one["missing"]) for one in listed] == [("csv", ""), ("mf4", "")]
    monkeypatch.setattr("ridetune.engine.formats.readers.find_spec", lambda name: None)
    assert client.get("/api/formats").json()[1]["missing"].endswith("or take CSV.")


def test_the_interface_describes_itself(client):
    """Every resource of the interface is in the OpenAPI document, the page's own routes are not."""
    paths = client.get("/api/openapi.json").json()["paths"]
    session = "/api/sessions/{sid}"
    for path in (
        "/api/parameters",
        "/api/sessions",
        f"{session}/simulations",
        f"{session}/measurements/{{mid}}/original",
        f"{session}/identifications/{{jid}}/events",
    ):
        assert path in paths
    assert "/" not in paths
    form = paths[f"{session}/measurements"]["post"]["requestBody"]["content"]
    assert "multipart/form-data" in form
