"""Error bars of a fit in simulations, by command line and REST."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.app.cli import main
from ridetune.app.limits import Limits
from ridetune.app.settings import Settings
from ridetune.engine.identification.bands import bands
from ridetune.engine.identification.kept_fit import read_fit
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.measurement import read_run
from ridetune.engine.simulation.excitation import FreeExcitation
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_to_json

from ..command_line import refused
from ..conftest import SAMPLES, Visitor, open_client
from ..test_frames import read_binary

PAPER = vehicle_to_json(reference_vehicles()["paper"])
RUN = SAMPLES / "twin/manoeuvre_1.csv"
BUMP = FreeExcitation(reference_manoeuvres()["bump"].lasting(2.0))


def test_a_fits_file_gives_bands_beside_the_run(folder, capsys):
    """Oracle: the engine called directly, through a text file of 9 digits or more."""
    assert main(f"identify {RUN} --vehicle paper --free K_F K_R -o fit.json".split()) == 0
    how = "--manoeuvre bump --duration 2 --bands linear -o run.csv"
    assert main(f"simulate --vehicle fit.json {how}".split()) == 0
    printed = capsys.readouterr().out
    assert "Weighted acceleration, driver seat, along z" in printed
    fit = read_fit(folder / "fit.json")
    found = bands(fit, fit.vehicle, BUMP)
    for side in ("lower", "upper"):
        written = read_run(folder / f"run.{side}.csv")
        expected = getattr(found, side)
        assert_allclose(written["tyre.fl.load"], expected["tyre.fl.load"], rtol=1e-8)
    assert "no errors" not in printed
    sentence = refused(capsys, *f"simulate --vehicle paper {how}".split())
    assert "--bands needs the errors of a fit, and paper has none" in sentence


@pytest.fixture(scope="module")
def engineer(tmp_path_factory, workers):
    """A session on a service with workers."""
    settings = Settings(
        data=tmp_path_factory.mktemp("bands"), cluster=workers, limits=Limits(banded_steps=100_000)
    )
    with open_client(settings) as client:
        yield Visitor(client)


@pytest.fixture(scope="module")
def fitted(engineer):
    """An identification of both springs that is done."""
    run = engineer.upload(RUN.read_bytes(), RUN.name).json()["id"]
    asked = {"runs": [run], "vehicle": PAPER, "free": ["K_F", "K_R"]}
    job = engineer.post("/identifications", json=asked).json()
    return engineer.wait_for("identifications", job["id"])


@pytest.mark.parametrize("method", ["linear", "sampled"])
def test_frames_carry_both_ends_of_every_band(engineer, fitted, method):
    """Oracle: the curve lies between them, and the figure within its interval."""
    body = {
        "vehicle": fitted["result"]["vehicle"],
        "manoeuvre": "bump",
        "duration": 2,
        "channels": ["chassis.z"],
        "bands": {"identification": fitted["id"], "method": method, "cars": 39},
    }
    reply = engineer.post("/simulations", json=body)
    assert reply.status_code == 200, reply.text
    told = reply.json()
    names = ["time", "chassis.z", "chassis.z.lower", "chassis.z.upper"]
    assert [one["name"] for one in told["channels"]] == names
    assert {one["unit"] for one in told["channels"][1:]} == {"m"}
    middle, low, high = (np.array(told["values"][name]) for name in names[1:])
    assert np.all(low <= high)
    if method == "linear":
        assert_allclose(0.5 * (low + high), middle, atol=1e-12)
    rms = next(one for one in told["metrics"] if one["name"] == "chassis.z.rms")
    assert rms["interval"][0] < rms["value"] < rms["interval"][1]
    accept = {"Accept": "application/vnd.ridetune.frames"}
    _, values = read_binary(engineer.post("/simulations", json=body, headers=accept).content)
    assert_allclose(values["chassis.z.upper"], high, atol=1e-8)


def test_bands_that_cost_too_much_or_mean_nothing_are_refused(engineer, fitted):
    asked = {"vehicle": PAPER, "manoeuvre": "2", "bands": {"identification": fitted["id"]}}
    asked["bands"]["method"] = "sampled"
    reply = engineer.post("/simulations", json=asked)
    assert "Bands by 64 cars take 520000 steps" in reply.json()["detail"]
    asked["bands"] = {"identification": "gone"}
    assert engineer.post("/simulations", json=asked).status_code == 404
    asked = {"vehicle": PAPER, "manoeuvre": "bump", "bands": {"identification": fitted["id"]}}
    asked["values"] = {"front.suspension.stiffness": 1e6}
    reply = engineer.post("/simulations", json=asked)
    assert reply.status_code == 422
    asked["values"] = {"front.suspension.stiffness": 300000}
    assert "was fitted between" in engineer.post("/simulations", json=asked).json()["detail"]
    csv = engineer.post("/simulations", json=asked, headers={"Accept": "text/csv"})
    assert csv.json()["field"] == "bands"
    assert json.loads(csv.text)["status"] == 422
