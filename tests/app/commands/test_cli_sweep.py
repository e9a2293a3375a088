"""`ridetune sweep` as a person meets it: files, summary, refusals, an interrupt."""

import csv
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pyarrow import feather, parquet
from ridetune.app.cli import main
from ridetune.app.commands import watch as watch_module
from ridetune.app.commands.sweep import _line
from ridetune.engine.measurement import read_run, write_run
from ridetune.engine.simulation.metrics import metrics
from ridetune.engine.sweeps.designs import LatinHypercube, Sobol
from ridetune.engine.sweeps.sweep import Progress
from ridetune.engine.vehicle_file import read_vehicle, reference_vehicles

from ..command_line import PROGRAM, refused

SHORT = "sweep --vehicle paper --manoeuvre bump --duration 1.5"
BOX = "--range K_F=1e4:3e4 chassis.mass=900:1300"


def run(text):
    assert main(text.split()) == 0


def test_rows_histories_and_vehicles_belong_together(folder, capsys):
    """Oracle: the metrics of the history, and the history of the vehicle by `simulate`."""
    run(f"{SHORT} {BOX} --cars 6 --seed 4 --histories runs 5 2 -o cars.parquet")
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "Wrote cars.parquet: 6 cars." in printed.out
    table = parquet.read_table("cars.parquet")
    design = Sobol({"K_F": (1e4, 3e4), "chassis.mass": (900.0, 1300.0)}, 6, seed=4)
    assert_array_equal(table["chassis.mass"], design.block(0, 6)[:, 1])
    assert sorted(path.name for path in (folder / "runs").iterdir()) == [
        *("car-2.csv", "car-2.json", "car-5.csv", "car-5.json")
    ]
    for number in (2, 5):
        history = read_run(f"runs/car-{number}.csv")
        for metric in metrics(history):
            assert_allclose(table[metric.name].to_numpy()[number], metric.value, rtol=1e-9)
        car = read_vehicle(f"runs/car-{number}.json")
        assert car.value("chassis.mass") == table["chassis.mass"].to_numpy()[number]


def test_levels_and_latin_hypercubes_go_into_every_form(folder):
    levels = "--levels C_F=1000,2000 front.tyre.stiffness=150000:250000:3"
    run(f"{SHORT} {levels} -o cars.csv")
    with open("cars.csv", newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["front.suspension.damping [N s/m]"]) for row in rows] == [1e3] * 3 + [2e3] * 3
    stiffness = [float(row["front.tyre.stiffness [N/m]"]) for row in rows]
    assert stiffness == [150e3, 200e3, 250e3] * 2
    run(f"{SHORT} {BOX} --cars 3 --design latin-hypercube --threads 1 -o cars.feather")
    drawn = LatinHypercube({"K_F": (1e4, 3e4), "chassis.mass": (900.0, 1300.0)}, 3).block(0, 3)
    assert_array_equal(feather.read_table("cars.feather")["chassis.mass"], drawn[:, 1])


def test_a_recording_drives_every_car(folder):
    """Oracle: the cars follow the rims of a car that is among them."""
    run("simulate --vehicle paper --manoeuvre bump --duration 2 -o driven.csv")
    truth = reference_vehicles()["paper"].front.suspension.stiffness
    run(
        f"sweep --vehicle paper --rims driven.csv --levels K_F={truth},{1.5 * truth}"
        " --histories . 0 -o cars.arrow"
    )
    driven, followed = read_run("driven.csv"), read_run("car-0.csv")
    assert np.abs(followed["chassis.z"] - driven["chassis.z"]).max() < 1e-4
    told = json.loads(feather.read_table("cars.arrow").schema.metadata[b"ridetune"])
    assert told["excitation"]["recording"]["name"] == "driven.csv"
    posts = {f"post.{name[5:7]}.z": driven[name] for name in driven.columns if "road." in name}
    write_run(type(driven)("rig", driven.time, posts), "rig.csv")
    run("sweep --vehicle paper --posts rig.csv --levels K_F=20000 -o cars.csv")


def test_failed_cars_are_summed_up_by_what_they_have_in_common(folder, capsys):
    run(f"{SHORT} --levels phi_F=0.07,1.48,1.49 -o cars.csv --histories runs 0 1")
    printed = capsys.readouterr().out
    assert "2 of 3 cars failed, 2 of them like car 1: Front.pivot lies 1.6 m from" in printed
    assert "Warning: Car 1 has no history: Front.pivot lies" in printed
    row = next(line for line in printed.splitlines() if line.startswith("Bounce"))
    assert row.split()[2] == "mm"
    assert row.split()[4::2] == ["0", "0"]


def test_histories_are_written_over_only_if_forced(folder, capsys):
    (folder / "runs").mkdir()
    (folder / "runs" / "car-0.json").write_text("mine")
    asked = f"{SHORT} --levels K_F=20000 -o cars.csv --histories runs 0"
    told = refused(capsys, *asked.split())
    assert "runs/car-0.json: the file is there already" in told
    assert not (folder / "cars.csv").exists()
    assert (folder / "runs" / "car-0.json").read_text() == "mine"
    run(f"{asked} --force")
    assert read_vehicle("runs/car-0.json").front.suspension.stiffness == 20000


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ("-o c.csv", "Nothing says what is swept"),
        (f"{BOX} -o c.csv", "add --cars N"),
        (f"{BOX} --cars 4 --levels K_R=1e4 -o c.csv", "--levels and --range are two designs"),
        ("--levels K_R=1e4 --cars 4 -o c.csv", "--cars belongs to --range"),
        ("--levels K_R=1e4 --seed 4 -o c.csv", "--seed belongs to --range"),
        (f"{BOX} --cars 4.5 -o c.csv", "'4.5' is not a whole number"),
        (f"{BOX} --cars many -o c.csv", "'many' is not a finite number"),
        (f"{BOX} --cars 0 -o c.csv", "cars is 0"),
        (f"{BOX} --cars 1e12 -o c.csv", "1e+12 cars are asked for"),
        (f"{BOX} --cars 1e12 --design latin-hypercube -o c.csv", "take a Sobol sequence"),
        ("--levels K_F=1e4:2e4:1e6 K_R=1e4:2e4:1e6 -o c.csv", "1e+12 cars are asked for"),
        ("--levels K_F=1e4:2e4 -o c.csv", "lacks a count; write NAME=LOW:HIGH:COUNT"),
        ("--levels K_F=1e4,x -o c.csv", "'x' is not a finite number"),
        ("--levels K_F -o c.csv", "--levels K_F sets no parameter"),
        ("--levels K_F=1e4 front.suspension.stiffness=2e4 -o c.csv", "a second time"),
        ("--range chassis.mas=1:2 --cars 4 -o c.csv", "did you mean chassis.mass?"),
        ("--range K_F=3e4:1e4 --cars 4 -o c.csv", "crossed"),
        ("--range C_F=1e3:2e5 --cars 4 -o c.csv", "take a step of at most"),
        (f"{BOX} --cars 4 --threads 4096 -o c.csv", "4096 threads are asked for"),
        (f"{BOX} --cars 4 --duration 0 -o c.csv", "A duration of 0 s is asked for"),
        (f"{BOX} --cars 4 --step 0 -o c.csv", "step is 0.0 s"),
        (f"{BOX} --cars 4 --braking 1:2 -o c.csv", "--braking belongs to --rims"),
        (f"{BOX} --cars 4 -o c.xlsx", "ends in .parquet or .arrow or .feather or .csv"),
        (f"{BOX} --cars 4 -o none/c.csv", "there is no folder none"),
        (f"{BOX} --cars 4 --histories runs -o c.csv", "names no car; write --histories DIR N"),
        (f"{BOX} --cars 4 --histories runs 4 -o c.csv", "no car 4; they go from 0 to 3"),
        (f"{BOX} --cars 4 --histories runs x -o c.csv", "'x' is not a finite number"),
    ],
)
def test_what_cannot_be_swept_is_refused_in_one_line_and_leaves_nothing(
    folder, capsys, options, told
):
    base = SHORT.replace("--duration 1.5", "") if "--duration" in options else SHORT
    assert told in refused(capsys, *base.split(), *options.split())
    assert not list(folder.iterdir())


def test_progress_is_a_line_now_and_then_where_no_terminal_shows_it(capsys, monkeypatch):
    monkeypatch.setattr(watch_module, "TELL_EVERY", 0.0)
    with watch_module.watch(_line) as progress:
        progress(Progress(50, 1000, 2, 5.0))
    told = "50 of 1000 cars, 2 failed, 10 cars/s, 0:01:35 left\n"
    assert capsys.readouterr().err == told


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_sweep_leaves_no_file(folder, number, status):
    """Interrupted while it writes: its own file is there already, hidden under another name."""
    listening = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    program = [sys.executable, "-c", listening + PROGRAM]
    asked = f"{SHORT} {BOX} --cars 100000 -o cars.parquet".split()
    with subprocess.Popen([*program, *asked], stderr=subprocess.PIPE, text=True) as running:
        while running.poll() is None and not os.listdir():
            time.sleep(0.01)
        running.send_signal(number)
        assert running.wait(timeout=60) == status
        assert running.stderr.read() == ""
    assert os.listdir() == []
