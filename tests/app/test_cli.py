"""The command line as a person meets it: what is printed, written and returned."""

import json
import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.app.cli import main
from ridetune.engine.channels import Run
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.plant import DetailedPlant
from ridetune.engine.extras import how_to_install
from ridetune.engine.measurement import read_run, write_run
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.sensors import RECORDED as SENSED
from ridetune.engine.vehicle_file import read_vehicle, reference_vehicles, write_vehicle

SHORT = {
    "name": "A short start over a rough road",
    "kind": "road",
    "duration": 4,
    "drive": {"kind": "reach-speed", "speed": 6, "time": 2, "start": 0.5, "ramp": 0.1},
    "road": {"kind": "iso8608", "sections": [{"class": "C"}]},
    "seed": 1,
}
RECORDED = list(SENSED)
TWIN = Path(__file__).parents[2] / "sample_runs/twin/manoeuvre_1.csv"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """The path of a short noise-free run of the paper's car, with every channel."""
    folder = tmp_path_factory.mktemp("driven")
    (folder / "short.json").write_text(json.dumps(SHORT))
    path = folder / "driven.csv"
    command = ["simulate", "--vehicle", "paper", "--manoeuvre", str(folder / "short.json")]
    assert main([*command, "-o", str(path)]) == 0
    return path


def refused(capsys, *arguments):
    """Run a command that must fail on bad input; its one line on standard error."""
    try:
        status = main(arguments)
    except SystemExit as stop:
        status = stop.code
    printed = capsys.readouterr()
    assert status == 2
    assert printed.err.count("\n") == 1
    return printed.err.strip()


def test_describing_the_commands_imports_no_engine():
    check = (
        "import sys; from ridetune.app.cli import command_line; command_line().format_help();"
        "print({'numpy', 'numba', 'scipy', 'fastapi'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True)
    assert done.stdout == "set()\n", done.stderr


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("identfy run.csv", "did you mean identify?"),
        ("", "COMMAND"),
        ("simulate --vehicel paper", "did you mean --vehicle?"),
        ("simulate --vehicle= --manoeuvre 1 -o r.csv", "--vehicle is empty"),
        ("simulate --vehicle paper --rims a.csv --rims b.csv", "--rims is given twice"),
        ("simulate --vehicle paper --manoeuvre 1 -o a.csv --output b.csv", "given twice"),
        ("simulate --vehicle paper --manoeuvre 1 -oa.csv -ob.csv", "-o is given twice"),
        ("simulate --vehicle paper --rims a --model 8dof --model=7dof", "--model is given twice"),
        ("campaign --seed 0 --seed 1 -o runs", "--seed is given twice"),
        ("identify --vehicle paper --free K_F run.csv", "put the recordings first"),
        ("identify --vehicle paper --free K_F -- run.csv", "run.csv: the file cannot be read"),
        ("simulate --vehicle paper", "--manoeuvre --rims --posts"),
        ("simulate --vehicle paper --manoeuvre 1", "-o"),
        ("simulate --vehicle paper --manoeuvre 1 --model 9dof -o r.csv", "'9dof'"),
        ("simulate --vehicle papper --manoeuvre 1 -o r.csv", "did you mean paper?"),
        ("simulate --vehicle paper --manoeuvre braek -o r.csv", "did you mean brake?"),
        ("simulate --vehicle paper --manoeuvre 1 --road none.csv -o r.csv", "none.csv"),
        ("simulate --vehicle paper --manoeuvre heave --road r.csv -o r.csv", "leave out --road"),
        ("simulate --vehicle paper --manoeuvre 1 --seed -1 -o r.csv", "'-1'"),
        ("simulate --vehicle paper --manoeuvre bump --seed 3 -o r.csv", "leave out --seed"),
        ("simulate --vehicle paper --manoeuvre 1 --road r --seed 3 -o r.csv", "leave out --seed"),
        ("simulate --vehicle paper --rims run.csv --seed 3", "--seed belongs to --manoeuvre"),
        ("simulate --vehicle paper --rims run.csv --road r.csv", "--road belongs to --manoeuvre"),
        ("simulate --vehicle paper --manoeuvre 1 --traction paper -o r.csv", "--rims"),
        ("simulate --vehicle paper --manoeuvre 1 --rim-cutoff 20 -o r.csv", "--rim-cutoff belongs"),
        ("simulate --vehicle paper --posts r.csv --braking 1:2 -o r.csv", "--braking belongs"),
        ("simulate --vehicle paper --rims run.csv --lift-off", "--lift-off"),
        ("simulate --vehicle paper --rims run.csv", "run.csv"),
        ("simulate --vehicle paper --posts run.csv -o r.csv", "run.csv"),
        ("identify run.csv --vehicle paper", "run.csv"),
        ("identify run.csv --vehicle paper --noise n.toml", "n.toml"),
        ("identify run.csv --vehicle paper --colour", "--colour"),
        ("campaign --plant detailed --vehicle v.json -o runs", "leave out --vehicle"),
        ("campaign --noise n.toml -o runs", "n.toml"),
        ("bench --only raod-one", "--only raod-one: there is no row of that name; did you mean"),
        ("bench --only everything", "there are road-one, "),
        ("bench --only", "--only"),
        ("bench --quick -o none/bench.json", "there is no folder none"),
    ],
)
def test_bad_command_is_refused_in_one_line_that_names_the_place(folder, capsys, arguments, told):
    assert told in refused(capsys, *arguments.split())
    assert not list(folder.iterdir())


@pytest.mark.parametrize(
    ("option", "told"),
    [
        ("--free front.pivot.angel", "did you mean front.pivot.angle?"),
        ("--bounds front.pivot.angle=0.1", "LOW:HIGH"),
        ("--bounds front.pivot.angle=0.5:0.1", "crossed"),
        ("--bounds front.pivot.angle=a:b", "--bounds front.pivot.angle=a:b: 'a' is not a finite"),
        ("--bounds K_F=1:", "'' is not a finite number"),
        ("--bounds K_F=1:inf", "'inf' is not a finite number"),
        ("--start front.pivot.angle", "NAME=VALUE"),
        ("--start front.pivot.angle=two", "--start front.pivot.angle=two: 'two' is not a finite"),
        ("--start K_F=nan", "'nan' is not a finite number; write NAME=VALUE in SI units"),
        ("--start K_F=1 front.suspension.stiffness=2", "stiffness a second time"),
        ("--free K_F --fixed K_F", "both as free and as fixed"),
        ("--step 0.5", "step is 0.5 s"),
        ("--rim-cutoff fast", "'fast' is not a finite number; write a frequency in Hz, or none"),
        ("--a-x-cutoff -3", "a_x_cutoff_hz is -3"),
        ("--braking 2", "lacks a colon; write BEGIN:END in seconds, or none"),
        ("--braking 2:x", "'x' is not a finite number; write BEGIN:END in seconds, or none"),
        ("--braking 1e:2", "ridetune: --braking 1e:2: '1e' is not a finite number"),
        ("--braking driven.csv=2:", "ridetune: --braking driven.csv=2:: '' is not a finite number"),
        ("--braking 3:2", "begin first"),
        ("--braking 8:9", "it lasts from 0 to 4 s"),
        ("--braking -3:-1", "from -3 to -1 s, but it lasts from 0 to 4 s"),
        ("--braking lap.csv=1:2", "there is no run lap.csv; there are"),
        ("--braking other/driven.csv=1:2", "there is no run other/driven.csv; there are"),
        ("--braking 1:2 none", "driven.csv with none and with an interval; leave out one"),
    ],
)
def test_bad_option_is_refused(driven, capsys, option, told):
    error = refused(capsys, "identify", str(driven), "--vehicle", "paper", *option.split())
    assert told in error


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


def test_identified_car_and_report(folder, driven, capsys):
    """Oracle: the car that drove; 0.1 % is what the noise-free fit promises."""
    truth = reference_vehicles()["paper"]
    command = ["identify", str(driven), "--vehicle", "paper", "-o", "fit.json"]
    command += ["--free", "front.suspension.stiffness", "rear.suspension.damping"]
    command += ["--start", "front.suspension.stiffness=30000", "rear.suspension.damping=1500"]
    command += ["--bounds", "front.suspension.stiffness=10000:50000"]
    assert main(command) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "The fit converged" in printed.out
    row = next(line for line in printed.out.splitlines() if line.startswith("front.suspension"))
    assert row.split()[-1] == "yes"
    assert "N/m" in row
    fit = json.loads((folder / "fit.json").read_text())
    assert fit["parameters"][0]["upper"] == 50000
    for path in ("front.suspension.stiffness", "rear.suspension.damping"):
        assert read_vehicle("fit.json").value(path) == pytest.approx(truth.value(path), rel=1e-3)

    assert main(["simulate", "--vehicle", "fit.json", "--rims", str(driven)]) == 0


def test_starts_loss_and_priors_are_asked_for_printed_and_kept(folder, driven, capsys):
    """Oracle: the car that drove, and a prior far narrower than what the noise-free run tells."""
    command = ["identify", str(driven), "--vehicle", "paper", "-o", "fit.json"]
    command += ["--free", "K_F", "K_R", "--start", "K_F=40000", "--starts", "4", "--seed", "7"]
    command += ["--loss", "huber", "--loss-scale", "2.5", "--prior", "K_R=30000~1e-6%"]
    assert main(command) == 0
    printed = capsys.readouterr().out
    assert "minimum" in printed
    assert "The search converged." in printed
    fit = json.loads((folder / "fit.json").read_text())
    assert (fit["starts"], fit["loss"], fit["loss_scale"]) == (4, "huber", 2.5)
    assert sum(one["starts"] for one in fit["minima"]) == 4
    assert fit["minima"][0]["cost"] == fit["cost"]
    assert fit["priors"][0]["deviation"] == pytest.approx(3e-4)
    assert fit["parameters"][1]["value"] == pytest.approx(30000.0, rel=1e-6)
    assert "standard errors from its prior" in " ".join(fit["warnings"])


@pytest.mark.parametrize(
    ("option", "sentence"),
    [
        ("--starts 0", "starts is 0; give a number from 1 to 1024"),
        ("--starts 1.5", "is not a whole number"),
        ("--loss hubert", "invalid choice: 'hubert'"),
        ("--loss-scale 2", "needs a loss that bends"),
        ("--loss huber --loss-scale 0", "loss_scale is 0.0; give 0.01 to 1e+06 noises"),
        ("--prior K_F=24000", "lacks a standard deviation; write NAME=VALUE~DEVIATION"),
        ("--prior K_F=24000~x", "'x' is not a finite number"),
        ("--prior K_Q=24000~1", "did you mean K_R?"),
        ("--prior C_F=1700~5%", "front.suspension.damping, which is not free"),
        ("--prior K_F=24000~5% K_F=1~1", "a second time"),
    ],
)
def test_what_a_search_cannot_be_asked_is_refused(driven, capsys, option, sentence):
    command = ["identify", str(driven), "--vehicle", "paper", "--free", "K_F", *option.split()]
    assert sentence in refused(capsys, *command)


def test_how_a_recording_is_prepared_is_the_caller_s_and_is_kept(folder, driven):
    """Several runs need a name with each mark; "none" is a mark too."""
    run = read_run(driven)
    write_run(Run("lap", run.time, {name: 1.1 * run[name] for name in RECORDED}), "lap.csv")
    command = ["identify", str(driven), "lap.csv", "--vehicle", "paper", "--free", "K_F"]
    command += ["--a-x-cutoff", "none", "--rim-cutoff", "30", "--initial-state", "measured"]
    command += ["--step", "0.004"]
    assert main([*command, "--braking", "1:2"]) == 2
    marks = ["lap.csv=2.5:3", "lap.csv=1:2", f"{driven}=none"]
    assert main([*command, "--braking", *marks, "-o", "fit.json"]) == 0
    fit = json.loads((folder / "fit.json").read_text())
    settings = {"a_x_cutoff_hz": None, "rim_cutoff_hz": 30.0, "output_cutoff_hz": None}
    settings |= {"output_highpass_hz": None}
    settings |= {"initial_state": "measured", "step": 0.004}
    assert fit["settings"] == settings
    assert [run["braking"] for run in fit["runs"]] == [[], [[2.5, 3.0], [1.0, 2.0]]]


def test_two_slope_dampers_are_found_beside_what_else_is_free(folder, driven):
    """With `--fixed` as for every parameter."""
    command = ["identify", str(driven), "--vehicle", "paper", "--free", "K_F", "-o", "fit.json"]
    assert main([*command, "--damper", "two-slope", "--fixed", "v_R"]) == 0
    fit = json.loads((folder / "fit.json").read_text())
    found = [one["name"] for one in fit["parameters"]]
    assert found == [
        "front.suspension.stiffness",
        "front.suspension.rebound_ratio",
        "front.suspension.knee_speed",
        "rear.suspension.rebound_ratio",
    ]
    assert "rebound_ratio" in fit["vehicle"]["rear"]["suspension"]


def test_two_slope_dampers_of_the_car_are_known_unless_asked_for(folder, driven):
    knees = {f"{axle}.suspension.knee_speed": 0.4 for axle in ("front", "rear")}
    write_vehicle(reference_vehicles()["paper"].with_values(knees), "bent.json")
    command = ["identify", str(driven), "--vehicle", "bent.json", "-o", "fit.json"]
    assert main(command) == 0
    fit = json.loads((folder / "fit.json").read_text())
    assert [one["name"] for one in fit["parameters"]] == list(PARAMETER_NAMES)
    assert fit["vehicle"]["rear"]["suspension"]["knee_speed"] == 0.4


def test_a_path_names_the_run_where_the_file_s_name_names_two(folder, driven, capsys):
    """Marks may begin before the record, which cuts them."""
    run = read_run(driven)
    paths = []
    for name in ("first", "second"):
        (folder / name).mkdir()
        channels = {name: 1.1 ** len(paths) * run[name] for name in RECORDED}
        paths.append(f"{name}/lap.csv")
        write_run(Run("lap", run.time, channels), paths[-1])
    command = ["identify", *paths, "--vehicle", "paper", "--free", "K_F", "-o", "fit.json"]
    ambiguous = refused(capsys, *command, "--braking", "lap.csv=1:2")
    assert "name it by its path, one of first/lap.csv, second/lap.csv" in ambiguous
    assert main([*command, "--braking", f"{paths[1]}=-1:2", f"./{paths[0]}=none"]) == 0
    fit = json.loads((folder / "fit.json").read_text())
    assert [run["braking"] for run in fit["runs"]] == [[], [[0.0, 2.0]]]


def test_a_channel_with_the_wrong_sign_ends_in_a_warning_that_names_it(folder, driven, capsys):
    run = read_run(driven)
    flipped = {name: run[name] * (-1 if name == "chassis.z" else 1) for name in RECORDED}
    write_run(Run("flipped", run.time, flipped), "flipped.csv")
    command = ["identify", "flipped.csv", "--vehicle", "paper", "--free", "K_F", "K_R"]
    assert main(command) == 0
    warnings = [line for line in capsys.readouterr().out.splitlines() if "Warning:" in line]
    assert any("chassis.z" in line for line in warnings)


def test_a_turned_sensor_is_offered_as_an_option_that_mends_the_fit(folder, driven, capsys):
    """Oracle: the fit to the recording that is not turned, and its prediction by rims."""
    run = read_run(driven)
    upright = {name: run[name] for name in RECORDED}
    turned = {**upright, "chassis.z": -run["chassis.z"]}
    write_run(Run("upright", run.time, upright), "upright.csv")
    write_run(Run("turned", run.time, turned), "turned.csv")
    how = ["--vehicle", "paper", "--free", "K_F", "K_R"]
    assert main(["identify", "turned.csv", *how]) == 0
    [option] = re.findall(r"Add (--sensor) (\S+)\.\n", capsys.readouterr().out)
    assert option == ("--sensor", "chassis.z.sign=-1")
    scores = []
    for name, options in (("turned.csv", option), ("upright.csv", ())):
        command = ["validate", name, *how, *options, "-o", "report.html", "--json", "all.json"]
        assert main([*command, "--hold-out", "upright.csv" if options else "turned.csv"]) == 0
        found = json.loads((folder / "all.json").read_text())["runs"][0]["predictions"]
        scores.append([one["scores"] for one in found])
    assert scores[0] == scores[1]


def test_sensors_are_identified_and_told(folder, driven, capsys):
    """Oracle: the gain and the noise that were put on the recording; 801 samples of noise scatter
    by 2.5 %: four of that."""
    run = read_run(driven)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(run.time))
    channels = {name: run[name] for name in RECORDED}
    channels["chassis.z"] = 1.1 * run["chassis.z"] + noise
    write_run(Run("lap", run.time, channels), "lap.csv")
    command = ["identify", "lap.csv", "--vehicle", "paper", "--free", "K_F", "-o", "fit.json"]
    asked = ["--fit-sensor", "chassis.z.gain", "sensor.chassis.z.delay", "--fit-noise"]
    known = ["--sensor", "chassis.pitch.noise=0.001", "--profile", "K_F"]
    assert main([*command, *asked, *known]) == 0
    assert re.search(r"^sensor\.chassis\.z\.gain +1\.[01]", capsys.readouterr().out, re.MULTILINE)
    fit = json.loads((folder / "fit.json").read_text())
    delay, gain = fit["sensors"]
    assert abs(gain["value"] - 1.1) < 4.0 * gain["std_error"]
    assert abs(delay["value"]) < 4.0 * delay["std_error"]
    [seen] = fit["runs"]
    assert seen["noise_source"]["chassis.z"] == "fitted"
    assert seen["noise"]["chassis.z"] == pytest.approx(1e-3, rel=0.1)
    assert seen["noise"]["chassis.pitch"] == 0.001
    assert main(["advise", "lap.csv", "--vehicle", "fit.json", "--candidates", "brake-54"]) == 0


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--sensor", "chasis.z.gain=2"], "did you mean chassis.z?"),
        (["--sensor", "chassis.z.gian=2"], "did you mean gain?"),
        (["--sensor", "chassis.z.gain"], "write CHANNEL.QUANTITY=VALUE in SI units"),
        (["--sensor", "chassis.z.gain=x"], "'x' is not a finite number"),
        (["--sensor", "z=1"], "write a channel and a quantity, e.g. chassis.z.gain"),
        (
            ["--sensor", "chassis.z.gain=1", "--fit-sensor", "chassis.z.gain"],
            "sets chassis.z.gain a second time",
        ),
    ],
)
def test_a_sensor_that_cannot_be_is_refused(folder, driven, capsys, options, sentence):
    assert sentence in refused(capsys, "identify", str(driven), "--vehicle", "paper", *options)


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
    assert message.endswith(f"not installed; {how_to_install('detailed')}.")
    assert not list(folder.iterdir())


def test_what_a_shell_makes_of_an_unset_variable_is_refused(folder, capsys):
    assert "an argument is empty" in refused(capsys, "simulate", "--vehicle", "paper", "--rims", "")
    assert "an argument is empty" in refused(capsys, "campaign", "-o", "")
    assert not list(folder.iterdir())


@pytest.mark.parametrize(
    ("command", "place"),
    [
        ("identify run.csv --vehicle car.json", "run.csv"),
        ("identify run.csv --vehicle car.json", "run.toml"),
        ("identify run.csv --vehicle car.json", "car.json"),
        ("identify run.csv --vehicle car.json --noise noise.toml", "noise.toml"),
        ("simulate --vehicle car.json --rims run.csv", "run.csv"),
        ("simulate --vehicle car.json --posts run.csv", "run.csv"),
        ("simulate --vehicle car.json --manoeuvre bump", "car.json"),
        ("simulate --vehicle car.json --manoeuvre short.json", "short.json"),
        ("simulate --vehicle car.json --manoeuvre 1 --road road.csv", "road.csv"),
    ],
)
def test_no_input_is_written_over(folder, capsys, command, place):
    """Whatever way leads to it; refused before anything is read."""
    write_vehicle(reference_vehicles()["paper"], "car.json")
    for name in ("run.csv", "run.toml", "noise.toml", "short.json", "road.csv"):
        (folder / name).write_text(f"an engineer's {name}")
    kept = (folder / place).read_bytes()
    (folder / "link").symlink_to(place)
    for way in (place, f"./{place}", "link"):
        message = refused(capsys, *command.split(), "-o", way)
        assert f"ridetune: {way}: this is {place} itself" in message
    assert (folder / place).read_bytes() == kept


def test_campaign_does_not_write_over_its_noise_even_if_forced(folder, capsys):
    """Oracle: the file as it was."""
    (folder / "manoeuvre_1.toml").write_text('[noise]\n"chassis.z" = 0.001 # my sensor\n')
    command = ["campaign", "--noise", "manoeuvre_1.toml", "--force", "-o", "."]
    assert "this is manoeuvre_1.toml itself" in refused(capsys, *command)
    assert "my sensor" in (folder / "manoeuvre_1.toml").read_text()
    assert [path.name for path in folder.iterdir()] == ["manoeuvre_1.toml"]


@pytest.mark.parametrize("place", ["missing/fit.json", "."])
def test_a_place_that_cannot_be_written_is_refused_before_the_work(folder, driven, capsys, place):
    command = ["identify", str(driven), "--vehicle", "paper", "-o", place]
    assert main(command) == 2
    refused = capsys.readouterr()
    assert place in refused.err
    assert "-o" in refused.err
    assert refused.out == ""


def test_campaign_writes_over_nothing_unless_forced(folder, capsys):
    (folder / "runs").mkdir()
    (folder / "runs" / "manoeuvre_2.csv").write_text("mine")
    message = refused(capsys, "campaign", "-o", "runs")
    assert message.startswith("ridetune: runs/manoeuvre_2.csv: the file is there already")
    assert [path.name for path in (folder / "runs").iterdir()] == ["manoeuvre_2.csv"]
    assert (folder / "runs" / "manoeuvre_2.csv").read_text() == "mine"
    assert main(["campaign", "-o", "runs", "--force"]) == 0
    assert read_run("runs/manoeuvre_2.csv").columns == RECORDED


def test_the_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--version"])
    assert stop.value.code == 0
    assert capsys.readouterr().out == f"ridetune {version('ridetune')}\n"


def test_a_simulation_tells_when_a_tyre_pulls_on_the_road(folder, capsys):
    assert main(["simulate", "--vehicle", "paper", "--manoeuvre", "bump", "-o", "run.csv"]) == 0
    assert "tyre load at or below zero: fl" in capsys.readouterr().out


PROGRAM = "import sys; from ridetune.app.cli import main; sys.exit(main())"


def test_closed_pipe_ends_quietly(folder):
    command = [sys.executable, "-c", PROGRAM, "campaign", "-o", "runs"]
    shell = ["sh", "-c", '{ "$@"; echo $? >status; } 2>errors | true', "sh", *command]
    subprocess.run(shell, check=True)
    assert (folder / "errors").read_text() == ""
    assert (folder / "status").read_text() == "141\n"


def test_interrupt_ends_quietly(folder):
    """The vehicle is a pipe that nobody writes to, so the command waits until interrupted.

    Tests that run in the background of a shell ignore interrupts, and so would the command.
    """
    os.mkfifo("car.json")
    listening = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    program = [sys.executable, "-c", listening + PROGRAM]
    command = [*program, "identify", "run.csv", "--vehicle", "car.json"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as waiting:
        # Opens when the command does. Closed again, since a signal just before the command's read
        # would find it waiting for ever.
        with open("car.json", "w"):
            waiting.send_signal(signal.SIGINT)
        assert waiting.wait(timeout=60) == 130
        assert waiting.stderr.read() == ""


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


def test_serve_answers_until_interrupted(folder):
    command = [sys.executable, "-u", "-c", PROGRAM, "serve", "--port", "0", "--data", "data"]
    environment = {name: value for name, value in os.environ.items() if "RIDETUNE" not in name}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as service:
        try:
            address = next(word for word in service.stdout.readline().split() if "http" in word)
            with urllib.request.urlopen(f"{address}healthz", timeout=30) as reply:
                assert reply.status == 200
        finally:
            service.send_signal(signal.SIGINT)
        assert service.wait(timeout=60) == 0


def test_identify_profiles_a_parameter(folder, capsys):
    """Oracle: the fit's own interval, as springs move the twin in proportion."""
    options = "--vehicle paper --free K_F K_R --profile K_F -o fit.json"
    assert main(["identify", str(TWIN), *options.split()]) == 0
    document = json.loads((folder / "fit.json").read_text())
    [found], estimate = document["profiles"], document["parameters"][0]
    assert found["name"] == estimate["name"] == "front.suspension.stiffness"
    low, high = estimate["confidence_interval"]
    assert found["confidence_interval"] == pytest.approx([low, high], abs=0.02 * (high - low))
    printed = capsys.readouterr().out
    assert re.search(r"^front\.suspension\.stiffness +2\S+ +2\S+ +N/m$", printed, re.MULTILINE)


def test_only_what_is_free_is_profiled(capsys):
    message = refused(
        capsys, "identify", str(TWIN), *["--vehicle", "paper", "--free", "K_F", "--profile", "d_F"]
    )
    assert "front.pivot.distance was not free in this fit; free are" in message
