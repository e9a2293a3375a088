"""`ridetune simulate`: what it prints and writes."""

import json
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.app.cli import main
from ridetune.engine.measurement import read_run, write_run
from ridetune.engine.run import Run
from ridetune.engine.vehicle_file import reference_vehicles, write_vehicle

from ..command_line import RECORDED, SHORT, refused


def test_a_place_that_cannot_be_written_is_named(folder, driven, capsys):
    (folder / "file").write_text("kept")
    where = str(folder / "file" / "run.csv")
    command = ["simulate", "--vehicle", "paper", "--rims", str(driven), "-o", where]
    assert where in refused(capsys, *command)
    assert (folder / "file").read_text() == "kept"
    assert "file" in refused(capsys, "campaign", "-o", str(folder / "file"))


def test_written_run_reads_back_with_every_recorded_channel(driven):
    run = read_run(driven)
    assert set(RECORDED) <= set(run.columns)
    assert run.duration == pytest.approx(SHORT["duration"])
    assert [path.name for path in driven.parent.iterdir() if "tmp" in path.name] == []


def test_seed_draws_another_road_and_the_same_one_again(folder, driven, capsys):
    manoeuvre = str(driven.parent / "short.json")
    for name, seed in (("a.csv", "5"), ("b.csv", "5"), ("c.csv", "6")):
        command = ["simulate", "--vehicle", "paper", "--manoeuvre", manoeuvre]
        assert main([*command, "--seed", seed, "-o", name]) == 0
    first, again, other = ((folder / name).read_bytes() for name in ("a.csv", "b.csv", "c.csv"))
    assert first == again
    assert first != other


def test_road_file_takes_the_place_of_the_manoeuvres_road(folder, driven):
    """Oracle: on a level road file nothing rolls."""
    (folder / "level.csv").write_text("x [m],left [m],right [m]\n-10,0,0\n50,0,0\n100,0,0\n")
    command = ["simulate", "--vehicle", "paper", "--road", "level.csv", "-o", "run.csv"]
    assert main([*command, "--manoeuvre", str(driven.parent / "short.json")]) == 0
    run = read_run(folder / "run.csv")
    assert_allclose(run["road.fl.z"], 0.0, atol=1e-15)
    assert_allclose(run["chassis.roll"], 0.0, atol=1e-12)


def test_rims_of_a_direct_run_bring_its_body_motion_back(folder, driven, capsys):
    """Oracle: the run itself; 99 % leaves room for the splines through 5 ms samples."""
    assert main(["simulate", "--vehicle", "paper", "--rims", str(driven), "-o", "r.csv"]) == 0
    head, *rows = capsys.readouterr().out.splitlines()
    assert head.split() == ["fit", "percent", "driven.csv"]
    printed = dict(row.split() for row in rows if len(row.split()) == 2)
    assert min(float(printed[name]) for name in RECORDED[:3]) > 99.0
    assert_allclose(read_run(folder / "r.csv").time, read_run(driven).time)


def test_a_step_too_long_for_the_car_is_refused_with_one_that_it_takes(folder, driven, capsys):
    """Oracle: the step that the refusal states is taken, with tyres, on rims and by a fit."""
    car = reference_vehicles()["paper"].with_values({"front.suspension.damping": 9e5})
    write_vehicle(car, "stiff.json")
    flat = {"name": "still", "kind": "road", "duration": 0.1}
    (folder / "still.json").write_text(json.dumps(flat))
    for mode in (
        ("simulate", "--manoeuvre", "still.json", "-o", "r.csv"),
        ("simulate", "--rims", str(driven)),
        ("identify", str(driven), "--free", "K_F"),
    ):
        command = (*mode, "--vehicle", "stiff.json")
        message = refused(capsys, *command)
        longest = re.search(r"take a step of at most (\S+) ms", message)[1]
        assert main([*command, "--step", str(float(longest) / 1000.0)]) == 0
        assert "0.02" in refused(capsys, *command, "--step", "0.5")


def test_both_tractions_and_both_models_follow_rims(driven, capsys):
    for option in ("--traction=paper", "--model=7dof"):
        assert main(["simulate", "--vehicle", "paper", "--rims", str(driven), option]) == 0
        assert "chassis.z" in capsys.readouterr().out


def test_still_posts_leave_the_car_at_rest(folder):
    time = np.linspace(0.0, 1.0, 101)
    posts = {f"post.{corner}.z": np.zeros(101) for corner in ("fl", "fr", "rl", "rr")}
    write_run(Run("posts", time, posts), "posts.csv")
    assert main(["simulate", "--vehicle", "paper", "--posts", "posts.csv", "-o", "r.csv"]) == 0
    assert_allclose(read_run("r.csv")["chassis.z"], 0.0, atol=1e-12)


def test_a_posts_manoeuvre_runs_on_the_rig(folder):
    heave = {
        "name": "Heave",
        "kind": "posts",
        "duration": 1,
        "posts": {
            "pattern": "heave",
            "first_frequency": 1,
            "last_frequency": 2,
            "amplitude": 0.01,
            "last_amplitude": 0.01,
        },
    }
    (folder / "heave.json").write_text(json.dumps(heave))
    command = ["simulate", "--vehicle", "paper", "--manoeuvre", "heave.json", "-o", "r.csv"]
    assert main(command) == 0
    assert np.ptp(read_run("r.csv")["post.rr.z"]) > 1e-4


def test_a_simulation_tells_when_a_tyre_pulls_on_the_road(folder, capsys):
    assert main(["simulate", "--vehicle", "paper", "--manoeuvre", "bump", "-o", "run.csv"]) == 0
    assert "tyre load at or below zero: fl" in capsys.readouterr().out
