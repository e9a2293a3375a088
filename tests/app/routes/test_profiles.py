"""Profiles over REST: of a parameter of a finished identification, by real workers."""

import pytest
from ridetune.app.settings import Settings
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_to_json

from ..conftest import SAMPLES, Visitor, open_client

PAPER = vehicle_to_json(reference_vehicles()["paper"])


@pytest.fixture(scope="module")
def engineer(tmp_path_factory, workers):
    """A session on a service with workers."""
    with open_client(Settings(data=tmp_path_factory.mktemp("profiles"), cluster=workers)) as client:
        yield Visitor(client)


@pytest.fixture(scope="module")
def fitted(engineer) -> dict:
    """A fit of the springs to the twin's first run; all else is the twin's own."""
    file = SAMPLES / "twin/manoeuvre_1.csv"
    run = engineer.upload(file.read_bytes(), file.name).json()["id"]
    asked = {"runs": [run], "vehicle": PAPER, "free": ["K_F", "K_R"]}
    job = engineer.post("/identifications", json=asked).json()
    return engineer.wait_for("identifications", job["id"])


def test_a_spring_s_profile_is_the_interval_of_its_fit(engineer, fitted):
    """Oracle: the fit. Springs known to 0.2 % move the model in proportion."""
    asked = {"identification": fitted["id"], "parameter": "K_F"}
    reply = engineer.post("/profiles", json=asked)
    assert reply.status_code == 202, reply.text
    done = engineer.wait_for("profiles", reply.json()["id"])
    assert done["state"] == "done", done["error"]
    assert done["parameter"] == "front.suspension.stiffness"
    [estimate] = [one for one in fitted["result"]["parameters"] if one["name"] == done["parameter"]]
    found = done["result"]
    width = estimate["confidence_interval"][1] - estimate["confidence_interval"][0]
    assert found["confidence_interval"] == pytest.approx(
        estimate["confidence_interval"], abs=0.02 * width
    )
    assert done["progress"]["points"] > 0
    assert {*found["points"][0]["others"]} == {"rear.suspension.stiffness"}


@pytest.mark.parametrize(
    ("parameter", "sentence"),
    [
        ("d_F", "front.pivot.distance was not free in this fit"),
        ("K_X", "No parameter is called 'K_X'"),
    ],
)
def test_only_a_parameter_of_the_fit_has_a_profile(engineer, fitted, parameter, sentence):
    asked = {"identification": fitted["id"], "parameter": parameter}
    reply = engineer.post("/profiles", json=asked)
    assert reply.status_code == 422
    assert sentence in reply.json()["detail"]


def test_an_unknown_identification_has_none(engineer):
    reply = engineer.post("/profiles", json={"identification": "none", "parameter": "K_F"})
    assert reply.status_code == 404
