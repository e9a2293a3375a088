"""`ridetune campaign`: what it drives, prints, writes and refuses."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from ridetune.app.cli import main
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.plant import DetailedPlant
from ridetune.engine.extras import how_to_install
from ridetune.engine.measurement import read_run
from ridetune.engine.vehicle_file import read_vehicle, reference_vehicles

from ..command_line import PROGRAM, RECORDED, SHORT, refused


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("noise = 1", "[noise]"),
        ('description = "wet"', "[noise]"),
        ("[noise", "TOML"),
        ('[noise]\n"tyre.fl.load" = 10', "tyre.fl.load"),
        ('[noise]\n"chassis.zz" = 0.001', "chassis.z"),
        ('[noise]\n"chassis.z" = -0.001', "chassis.z"),
    ],
)
def test_bad_noise_file_is_refused(folder, capsys, text, told):
    (folder / "noise.toml").write_text(text)
    assert told in refused(capsys, "campaign", "--noise", "noise.toml", "-o", "runs")


def test_campaign_records_both_manoeuvres_with_the_noise_asked_for(folder, capsys):
    """Oracle: the standard deviation of 4001 samples scatters by 1.1 %; 5 % is far outside."""
    noise = {"chassis.z": 5e-4, "chassis.roll": 3.5e-4}
    stated = "".join(f'"{name}" = {value}\n' for name, value in noise.items())
    (folder / "noise.toml").write_text(f"[noise]\n{stated}")
    assert main(["campaign", "-o", "clean"]) == 0
    assert main(["campaign", "-o", "noisy", "--noise", "noise.toml", "--seed", "3"]) == 0
    assert main(["campaign", "-o", "again", "--noise", "noise.toml", "--seed", "3"]) == 0
    for name in ("manoeuvre_1.csv", "manoeuvre_2.csv"):
        clean, noisy = read_run(folder / "clean" / name), read_run(folder / "noisy" / name)
        assert clean.columns == RECORDED
        assert noisy.noise == noise
        error = {channel: np.std(noisy[channel] - clean[channel]) for channel in RECORDED}
        assert error["chassis.z"] == pytest.approx(5e-4, rel=0.05)
        assert error["chassis.roll"] == pytest.approx(3.5e-4, rel=0.05)
        assert error["chassis.pitch"] == 0.0
        assert (folder / "noisy" / name).read_bytes() == (folder / "again" / name).read_bytes()
    assert read_vehicle("noisy/vehicle.json") == reference_vehicles()["paper"]


WALL = {
    "name": "Over a wall",
    "kind": "road",
    "duration": 4,
    "initial_speed": 20,
    "road": {"kind": "bump", "begin": 30, "length": 1.0, "height": 0.5},
}


def test_a_campaign_of_a_file_with_sensors_and_road_options(folder, capsys):
    (folder / "short.json").write_text(json.dumps(SHORT))
    (folder / "s.toml").write_text('rate_hz = 100\n[sensors."chassis.z"]\nnoise = 0.001\n')
    options = "--class-factor 0.5 --band 0.03:2.83 --road-seed 9 --date 2026-05-04 --processes 2"
    command = ["campaign", "--manoeuvre", "short.json", "bump", "--sensors", "s.toml", "-o", "runs"]
    assert main([*command, *options.split()]) == 0
    driven = json.loads((folder / "runs" / "manoeuvre_short.manoeuvre.json").read_text())
    assert driven["road"]["class_factor"] == 0.5
    assert (driven["road"]["band"], driven["seed"]) == ([0.03, 2.83], 9)
    run = read_run("runs/manoeuvre_short.csv")
    assert (run.columns, run.noise) == (["chassis.z"], {"chassis.z": 0.001})
    assert run.sample_step == pytest.approx(0.01)
    assert "date = 2026-05-04T00:00:00+00:00" in (folder / "runs/manoeuvre_bump.toml").read_text()


def test_a_drive_that_breaks_off_is_named_and_leaves_a_part_beside_the_others(folder, capsys):
    (folder / "wall.json").write_text(json.dumps(WALL))
    (folder / "runs").mkdir()
    (folder / "runs" / "manoeuvre_wall.csv").write_text("an earlier whole one")
    command = ["campaign", "--manoeuvre", "wall.json", "bump", "-o", "runs", "--force"]
    message = refused(capsys, *command)
    assert message.startswith("ridetune: manoeuvre_wall: The simulation diverged at t = 1.4")
    assert message.endswith("the part before it is kept.")
    assert not (folder / "runs" / "manoeuvre_wall.csv").exists()
    assert read_run("runs/manoeuvre_wall.partial.csv").duration < 1.5
    assert read_run("runs/manoeuvre_bump.csv").duration == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("--manoeuvre bumb", "did you mean bump?"),
        ("--manoeuvre bump bump", "bump is named twice"),
        ("--manoeuvre bump --class-factor 0.5", "None of the manoeuvres has a random road"),
        ("--class-factor -1", "road.class_factor is -1.0, but must lie between"),
        ("--band 0.03", "--band 0.03 lacks a colon"),
        ("--band 3:0.03", "band must rise"),
        ("--noise n.toml --sensors s.toml", "leave out --noise"),
        ("--sensors s.toml", "s.toml: sensors.chassis.zz is not known"),
        ("--sensors gone.toml", "gone.toml: cannot be read"),
        ("--date yesterday", "--date yesterday: this is no date"),
        ("--processes 0", "0 processes are asked for"),
        ("--manoeuvre heave", "heave moves the posts of a rig"),
    ],
)
def test_a_campaign_that_cannot_be_driven_is_refused(folder, capsys, arguments, told):
    (folder / "n.toml").write_text('[noise]\n"chassis.z" = 0.001\n')
    (folder / "s.toml").write_text('[sensors."chassis.zz"]\n')
    assert told in refused(capsys, "campaign", *arguments.split(), "-o", "runs")
    assert not list(folder.glob("runs/*"))


def test_mdf4_without_its_package_says_what_to_install(folder, capsys, monkeypatch):
    monkeypatch.setattr("ridetune.engine.formats.readers.find_spec", lambda name: None)
    message = refused(capsys, "campaign", "--format", "mf4", "-o", "runs")
    assert message.endswith(f"not installed; {how_to_install('formats')}, or take CSV.")
    assert not list(folder.iterdir())


def test_the_detailed_car_drives_and_leaves_what_is_known_of_it(folder, capsys):
    """Oracle: the plant of the engine."""
    (folder / "wait.json").write_text('{"name": "wait", "kind": "road", "duration": 0.2}')
    command = ["campaign", "--plant", "detailed", "--manoeuvre", "wait.json", "-o", "runs"]
    assert main(command) == 0
    known = read_vehicle(folder / "runs" / "vehicle.json")
    assert known == DetailedPlant.of(reference_car()).vehicle
    assert read_run(folder / "runs" / "manoeuvre_wait.csv").duration == pytest.approx(0.2)


def test_the_detailed_car_without_its_package_says_what_to_install(folder, capsys, monkeypatch):
    monkeypatch.setattr("ridetune.engine.detailed.exudyn_module.find_spec", lambda name: None)
    message = refused(capsys, "campaign", "--plant", "detailed", "-o", "runs")
    how = how_to_install("detailed")
    assert message.endswith(f"not installed; {how}, and start a running service again.")
    assert not list(folder.iterdir())


def test_campaign_does_not_write_over_its_noise_even_if_forced(folder, capsys):
    """Oracle: the file as it was."""
    (folder / "manoeuvre_1.toml").write_text('[noise]\n"chassis.z" = 0.001 # my sensor\n')
    command = ["campaign", "--noise", "manoeuvre_1.toml", "--force", "-o", "."]
    assert "this is manoeuvre_1.toml itself" in refused(capsys, *command)
    assert "my sensor" in (folder / "manoeuvre_1.toml").read_text()
    assert [path.name for path in folder.iterdir()] == ["manoeuvre_1.toml"]


def test_campaign_writes_over_nothing_unless_forced(folder, capsys):
    (folder / "runs").mkdir()
    (folder / "runs" / "manoeuvre_2.csv").write_text("mine")
    message = refused(capsys, "campaign", "-o", "runs")
    assert message.startswith("ridetune: runs/manoeuvre_2.csv: the file is there already")
    assert [path.name for path in (folder / "runs").iterdir()] == ["manoeuvre_2.csv"]
    assert (folder / "runs" / "manoeuvre_2.csv").read_text() == "mine"
    assert main(["campaign", "-o", "runs", "--force"]) == 0
    assert read_run("runs/manoeuvre_2.csv").columns == RECORDED


@pytest.mark.parametrize(
    ("stop", "status"),
    [
        (lambda command: os.killpg(command, signal.SIGINT), 130),
        (lambda command: os.kill(command, signal.SIGTERM), 143),
    ],
    ids=["interrupted with its processes", "terminated alone"],
)
def test_a_stopped_campaign_says_what_is_written_and_leaves_no_process(folder, stop, status):
    """As a terminal and as a service manager does, while the processes are still starting."""
    listening = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    program = [sys.executable, "-c", listening + PROGRAM]
    options = ["--manoeuvre", "1", "bump", "--processes", "2", "-o", "runs"]
    command = [*program, "campaign", *options]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as running:
        for _ in ("vehicle.json", "truth.json"):
            running.stdout.readline()
        children = Path(f"/proc/{running.pid}/task/{running.pid}/children")
        while len(children.read_text().split()) < 3:  # the drives' and the resource tracker
            time.sleep(0.01)
        stop(running.pid)
        assert running.wait(timeout=60) == status
        told = "Interrupted: nothing written whole, manoeuvre_1, manoeuvre_bump not.\n"
        assert running.stderr.read() == told
    assert sorted(os.listdir("runs")) == ["truth.json", "vehicle.json"]
    assert any(gone(running.pid) for _ in range(100))


def gone(group: int) -> bool:
    """Whether a process group has ended; Python's resource tracker does so just after a command."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return True
    time.sleep(0.1)
    return False
