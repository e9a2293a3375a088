"""The shipped recordings: they read cleanly, suffice to identify a car, and can be made again."""

import re
import runpy
import shlex
from pathlib import Path

import pytest
from numpy.testing import assert_allclose
from ridetune.app.cli import main
from ridetune.engine.measurement import missing_for_identification, read_run
from ridetune.engine.vehicle_file import read_vehicle, reference_vehicles

FOLDER = Path(__file__).parents[1] / "sample_runs"
RUNS = sorted(FOLDER.glob("*.csv"))


@pytest.mark.parametrize("path", RUNS, ids=lambda path: path.stem)
def test_sample_reads_without_a_warning_and_suffices_for_an_identification(path):
    run = read_run(path)
    assert run.warnings == ()
    assert missing_for_identification(run) == ()
    assert run.duration == pytest.approx(20.0)


def test_detailed_car_is_read_from_millimetres_degrees_and_kilometres_per_hour():
    """Oracle: both manoeuvres reach 15 m/s; a ride motion is millimetres and tenths of degrees."""
    for number in (1, 2):
        run = read_run(FOLDER / f"detailed_manoeuvre_{number}.csv")
        assert run["chassis.v_x"].max() == pytest.approx(15.0, rel=0.03)
        assert 1e-3 < abs(run["chassis.z"]).max() < 0.05
        assert 1e-3 < abs(run["chassis.pitch"]).max() < 0.05


def test_vehicles_beside_the_runs_are_usable():
    assert read_vehicle(FOLDER / "detailed_vehicle.json").total_mass == pytest.approx(1240.0)
    assert read_vehicle(FOLDER / "paper_vehicle.json") == reference_vehicles()["paper"]


def test_readme_tells_what_every_file_is():
    text = (FOLDER / "README.md").read_text()
    for path in [*RUNS, *FOLDER.glob("*.json"), *FOLDER.glob("*.toml"), *FOLDER.glob("*.py")]:
        assert f"`{path.name}`" in text


def test_command_in_the_readme_finds_the_car_that_drove(monkeypatch, capsys):
    """Oracle: the car beside the runs; twice the printed half-width, four standard errors."""
    monkeypatch.chdir(FOLDER.parent)
    text = (FOLDER / "README.md").read_text().replace("\\\n", "")
    (command,) = re.findall(r"^    (\.venv/bin/ridetune .*)$", text, re.MULTILINE)
    assert main(shlex.split(command)[1:]) == 0
    printed = capsys.readouterr().out
    assert "The fit converged" in printed
    truth = read_vehicle(FOLDER / "paper_vehicle.json")
    for name in ("front.suspension.stiffness", "rear.pivot.angle"):
        value, half_width = re.search(rf"^{name} +(\S+) +(\S+)", printed, re.MULTILINE).groups()
        assert abs(float(value) - truth.value(name)) < 2.0 * float(half_width)


def test_twin_can_be_made_again(tmp_path):
    """Equal to two units of the last digit kept: another processor rounds differently."""
    made = runpy.run_path(str(FOLDER / "make.py"))
    made["make"](tmp_path)
    for number in (1, 2):
        name = f"paper_twin_{number}"
        shipped, again = read_run(FOLDER / f"{name}.csv"), read_run(tmp_path / f"{name}.csv")
        assert shipped.noise == again.noise == made["NOISE"]
        assert shipped.columns == again.columns
        for channel in shipped.columns:
            assert_allclose(again[channel], shipped[channel], rtol=0, atol=2e-7)
