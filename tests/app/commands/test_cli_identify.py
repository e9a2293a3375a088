"""`ridetune identify`: what it prints, writes and refuses."""

import json
import os
import re
import threading
from pathlib import Path

import numpy as np
import pytest
from ridetune.app.cli import main
from ridetune.engine.measurement import read_run, write_run
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.run import Run
from ridetune.engine.vehicle_file import (
    read_vehicle,
    reference_vehicles,
    vehicle_to_json,
    write_vehicle,
)

from ..command_line import RECORDED, refused

TWIN = Path(__file__).parents[3] / "sample_runs/twin/manoeuvre_1.csv"


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


def test_a_run_of_another_car_is_warned_of(folder, driven, capsys):
    """Oracle: the car that the notes name, and the one that is fitted."""
    write_run(read_run(driven), "lap.csv")
    command = ["identify", "lap.csv", "--vehicle", "paper", "--free", "K_F"]
    car = reference_vehicles()["paper"].name
    said_of_it = "lap.csv was recorded with another car, BMW 320i"
    for named, said in ((car, []), ("BMW 320i", [said_of_it])):
        (folder / "lap.toml").write_text(f'vehicle = "{named}"')
        assert main(command) == 0
        printed = capsys.readouterr().out.splitlines()
        warnings = [line for line in printed if "another car" in line]
        assert len(warnings) == len(said)
        for sentence, warning in zip(said, warnings, strict=True):
            assert sentence in warning
            assert f"than the one that follows it, {car}" in warning


def test_a_fit_that_ended_at_a_bound_is_gone_on_with_between_its_bounds(folder, driven):
    """Oracle: the bounds of the first fit, below the car's stiffness; those typed go before."""
    command = ["identify", str(driven), "--free", "K_F", "K_R", "-o"]
    front = "front.suspension.stiffness"
    at = ["--bounds", "K_F=10000:20000", "--start", "K_F=15000"]
    assert main([*command, "fit.json", "--vehicle", "paper", *at]) == 0

    def bounds_of(*options):
        assert main([*command, "again.json", "--vehicle", "fit.json", *options]) == 0
        rows = json.loads((folder / "again.json").read_text())["parameters"]
        return {row["name"]: (row["lower"], row["upper"]) for row in rows}

    first = json.loads((folder / "fit.json").read_text())
    assert [row["at_bound"] for row in first["parameters"]] == [True, False]
    again = bounds_of()
    assert again[front] == (10000.0, 20000.0)
    start = first["parameters"][1]["value"]
    assert again["rear.suspension.stiffness"] == pytest.approx((0.05 * start, 8.0 * start))
    assert bounds_of("--bounds", "K_F=10000:50000")[front] == (10000.0, 50000.0)
    assert bounds_of("--start", "K_F=20000")[front] == pytest.approx((1000.0, 160000.0))


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
    assert seen["noise_source"]["chassis.pitch"] == "typed"
    assert seen["noise"]["chassis.pitch"] == 0.001
    assert main(["advise", "lap.csv", "--vehicle", "fit.json", "--candidates", "brake-54"]) == 0


def test_a_file_of_noise_is_typed_for_all_runs(folder, driven, capsys):
    """Oracle: the file, which may tell of channels that are not compared."""
    (folder / "noise.toml").write_text("noise.chassis.roll = 0.002\nnoise.wheel.fl.z = 0.001\n")
    command = ["identify", str(driven), "--vehicle", "paper", "--noise", "noise.toml"]
    assert main([*command, "--free", "K_F", "-o", "fit.json"]) == 0
    [seen] = json.loads((folder / "fit.json").read_text())["runs"]
    assert seen["noise"]["chassis.roll"] == 0.002
    assert [seen["noise_source"][f"chassis.{one}"] for one in ("z", "roll")] == ["default", "typed"]
    told = refused(capsys, *command, "--sensor", "chassis.roll.noise=0.001")
    assert "stated twice, by itself and as sensor.chassis.roll.noise" in told


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


@pytest.mark.parametrize("place", ["missing/fit.json", "."])
def test_a_place_that_cannot_be_written_is_refused_before_the_work(folder, driven, capsys, place):
    command = ["identify", str(driven), "--vehicle", "paper", "-o", place]
    assert main(command) == 2
    refused = capsys.readouterr()
    assert place in refused.err
    assert "-o" in refused.err
    assert refused.out == ""


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


def test_a_car_may_come_by_a_pipe(folder, driven, capsys):
    """Which can be read but once: whoever opened it again would wait for ever."""
    os.mkfifo("car.json")
    text = json.dumps(vehicle_to_json(reference_vehicles()["paper"]))
    writer = threading.Thread(target=Path("car.json").write_text, args=[text], daemon=True)
    writer.start()
    assert main(["identify", str(driven), "--vehicle", "car.json", "--free", "K_F"]) == 0
    assert "front.suspension.stiffness" in capsys.readouterr().out
