"""The shipped recordings: they read cleanly, suffice to identify a car, and can be made again."""

import json
import re
import shlex
from pathlib import Path

import pytest
from numpy.testing import assert_allclose
from ridetune.app.cli import main
from ridetune.engine.campaign import Campaign
from ridetune.engine.detailed.builder import Model
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.plant import DetailedPlant
from ridetune.engine.detailed.side_view import instant_centres
from ridetune.engine.manoeuvre import read_manoeuvre
from ridetune.engine.measurement import missing_for_identification, read_run
from ridetune.engine.run_notes import manoeuvre_beside
from ridetune.engine.sensor_file import read_sensors
from ridetune.engine.validation.geometry import geometry_from_json
from ridetune.engine.vehicle_file import read_vehicle, reference_vehicles, vehicle_to_json

FOLDER = Path(__file__).parents[1] / "sample_runs"
RUNS = sorted(FOLDER.glob("*/*.csv"))
TEXT = (FOLDER / "README.md").read_text()
KEPT = 2.0
"""Multiple of a sensor's resolution by which two processors may differ."""

ROUNDED = 1e-8
"""Relative difference of the condensed car between processors: 2e-10 was seen, of an inertia."""


def commands(name: str) -> list[list[str]]:
    """Arguments of the commands so called in the folder's README."""
    found = re.findall(r"^    \.venv/bin/ridetune (.*)$", TEXT.replace("\\\n", ""), re.MULTILINE)
    return [shlex.split(one) for one in found if one.startswith(name)]


@pytest.mark.parametrize("path", RUNS, ids=lambda path: f"{path.parent.name} {path.stem}")
def test_sample_reads_without_a_warning_and_suffices_for_an_identification(path):
    """Oracle: what was driven."""
    run = read_run(path)
    assert run.warnings == ()
    assert missing_for_identification(run) == ()
    assert run.duration == pytest.approx(read_manoeuvre(manoeuvre_beside(path)).duration)
    assert run.noise


def test_detailed_car_is_read_from_millimetres_degrees_and_kilometres_per_hour():
    """Oracle: both manoeuvres reach 15 m/s; a ride motion is millimetres and tenths of degrees."""
    for number in (1, 2):
        path = FOLDER / f"detailed/manoeuvre_{number}.csv"
        head = path.read_text().splitlines()[0]
        assert {"chassis.z [mm]", "chassis.pitch [deg]", "chassis.v_x [km/h]"} < set(
            head.split(",")
        )
        run = read_run(path)
        assert run["chassis.v_x"].max() == pytest.approx(15.0, rel=0.03)
        assert 1e-3 < abs(run["chassis.z"]).max() < 0.05
        assert 1e-3 < abs(run["chassis.pitch"]).max() < 0.05


def test_vehicles_beside_the_runs_are_usable():
    assert read_vehicle(FOLDER / "detailed/vehicle.json").total_mass == pytest.approx(1240.0)
    assert read_vehicle(FOLDER / "twin/vehicle.json") == reference_vehicles()["paper"]


def test_geometry_beside_the_detailed_runs_is_that_of_the_car():
    """Oracle: the instant centres at rest, to the digits written."""
    written = geometry_from_json(json.loads((FOLDER / "detailed/geometry.json").read_text()))
    for axle in ("front", "rear"):
        (centre,) = instant_centres(Model(reference_car()), axle, (0.0,))
        pivot = getattr(written, axle)
        assert pivot.distance == pytest.approx(centre.distance, abs=1e-3)
        assert pivot.angle == pytest.approx(centre.angle, abs=1e-4)


def test_readme_tells_what_every_file_is():
    for path in (path for path in FOLDER.glob("*/*") if path.is_file()):
        key = re.match(r"manoeuvre_([\w-]+)", path.name)
        name = path.name.replace(key[1], "KEY") if key else path.name
        assert f"`{name}`" in TEXT
        assert key is None or f"`{key[1]}`" in TEXT


def test_command_in_the_readme_finds_the_car_that_drove(monkeypatch, capsys):
    """Oracle: the car beside the runs; twice the printed half-width, four standard errors."""
    monkeypatch.chdir(FOLDER.parent)
    (command,) = commands("identify")
    assert main(command) == 0
    printed = capsys.readouterr().out
    assert "The fit converged" in printed
    truth = read_vehicle(FOLDER / "twin/vehicle.json")
    for name in ("front.suspension.stiffness", "rear.pivot.angle"):
        value, half_width = re.search(rf"^{name} +(\S+) +(\S+)", printed, re.MULTILINE).groups()
        assert abs(float(value) - truth.value(name)) < 2.0 * float(half_width)


def test_command_in_the_readme_makes_the_twin_again(monkeypatch, tmp_path):
    monkeypatch.chdir(FOLDER.parent)
    command = commands("campaign")[1]
    assert command[command.index("-o") + 1] == "sample_runs/twin"
    command[command.index("-o") + 1] = str(tmp_path)
    assert main(command) == 0
    shipped = sorted(path for path in (FOLDER / "twin").iterdir() if path.name != "sensors.toml")
    assert [path.name for path in shipped] == sorted(path.name for path in tmp_path.iterdir())
    for path in shipped:
        if path.suffix != ".csv":
            assert (tmp_path / path.name).read_text() == path.read_text()
        else:
            same(read_run(tmp_path / path.name), read_run(path), FOLDER / "twin/sensors.toml")


def test_the_detailed_car_drives_its_recording_again():
    """Over the bump, with the sensors, noise and seed of the command in the README."""
    plant, sensors = DetailedPlant.of(reference_car()), FOLDER / "detailed/sensors.toml"
    made, kept = (
        dict(leaves(vehicle_to_json(car)))
        for car in (plant.vehicle, read_vehicle(FOLDER / "detailed/vehicle.json"))
    )
    assert made.keys() == kept.keys()
    for path, value in kept.items():
        near = pytest.approx(value, rel=ROUNDED) if isinstance(value, float) else value
        assert made[path] == near, path
    shipped = FOLDER / "detailed/manoeuvre_bump.csv"
    bump = read_manoeuvre(manoeuvre_beside(shipped)).lasting(1.5)
    (command,) = (one for one in commands("campaign") if "detailed" in one)
    seed = int(command[command.index("--seed") + 1])
    campaign = Campaign.plan(plant, read_sensors(sensors), {"bump": bump}, seed)
    recording = campaign.record("manoeuvre_bump", lambda seconds: None, lambda: False)
    assert recording.run is not None, recording.failure
    # Where it is cut off, the spline through the truth has an end that the shipped one has not.
    same(recording.run, read_run(shipped), sensors, samples=len(recording.run.time) - 5)


def leaves(value, path=()):
    """(path, value) of whatever is no dict and no list in a JSON value."""
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from leaves(inner, (*path, key))
    else:
        yield path, value


def same(made, shipped, sensors: Path, samples: int | None = None) -> None:
    """Whether two recordings are equal to KEPT steps of the sensors."""
    assert made.noise == shipped.noise
    assert made.columns == shipped.columns
    for name, sensor in read_sensors(sensors).sensors.items():
        step = KEPT * sensor.resolution * sensor.si_factor(name)
        assert_allclose(made[name][:samples], shipped[name][:samples], rtol=0, atol=step)
