"""`ridetune condition`: what it prints and writes, and what a fit says of its inputs."""

import json
import re

import pytest
from numpy.testing import assert_allclose
from ridetune.app.cli import main
from ridetune.engine.measurement import missing_for_identification, read_run, write_run
from ridetune.engine.vehicle_file import write_vehicle

from ...factories import paper_vehicle
from ...raw_sensors import drive, recorded

CAR = paper_vehicle()


@pytest.fixture(scope="module")
def raw():
    return recorded(CAR, drive(CAR, sample_step=0.005), seed=3)


@pytest.fixture
def folder(tmp_path, monkeypatch, raw):
    monkeypatch.chdir(tmp_path)
    write_run(raw, "raw.csv")
    write_vehicle(CAR, "car.json")
    (tmp_path / "raw.toml").write_text('description = "wet"\n[noise]\n"chassis.body_a_z" = 0.03\n')
    return tmp_path


def test_the_suggested_steps_can_be_edited_and_done(folder, capsys):
    assert main(["condition", "raw.csv", "--vehicle", "car.json", "--suggest"]) == 0
    told = capsys.readouterr()
    steps = json.loads(told.out)
    assert [step["kind"] for step in steps][-1] == "rim-from-travel"
    assert "Compare the run with --output-highpass 0.6." in told.err
    steps[-1]["geometry"] = "arm"
    (folder / "steps.json").write_text(json.dumps(steps))
    command = ["condition", "raw.csv", "--vehicle", "car.json", "--steps", "steps.json"]
    assert main([*command, "-o", "done.csv"]) == 0
    printed = capsys.readouterr().out
    assert "chassis.z from 0.3 to 40 Hz; an error of 1 mg at 0.3 Hz is 2.8 mm." in printed
    assert "Compare the run with --output-highpass 0.6." in printed
    done = read_run("done.csv")
    assert missing_for_identification(done) == ()
    assert [record.step for record in done.conditioning] == steps
    assert done.description == "wet"
    assert done.noise["chassis.body_a_z"] == 0.03
    # What it wrote itself it writes over.
    assert main([*command, "-o", "done.csv"]) == 0
    assert read_run("done.csv").conditioning == done.conditioning


def test_without_a_place_it_says_that_nothing_was_written(folder, capsys):
    before = sorted(folder.iterdir())
    (folder / "steps.json").write_text('[{"kind": "rest"}]')
    assert main(["condition", "raw.csv", "--steps", "steps.json"]) == 0
    assert "Nothing was written; add -o run.csv" in capsys.readouterr().out
    assert sorted(folder.iterdir()) == sorted([*before, folder / "steps.json"])


def test_a_fit_to_raw_sensors_is_led_to_conditioning(folder, capsys):
    assert main(["identify", "raw.csv", "--vehicle", "car.json"]) == 2
    said = capsys.readouterr().err
    assert "has none of chassis.z, chassis.pitch, chassis.roll" in said
    assert (
        "make them of raw sensors such as chassis.pitch_rate first, with ridetune condition" in said
    )


@pytest.mark.parametrize(("low", "told"), [(0.45, "0.9"), (None, None)])
def test_the_high_pass_that_the_steps_call_for_is_told(folder, capsys, low, told):
    """Oracle: twice the lowest frequency of what is made; nothing without a band."""
    steps = [{"kind": "rest"}, {"kind": "scale", "channel": "chassis.body_a_z"}]
    if low:
        steps.append({"kind": "displacement", "channels": ["wheel.fl.a_z"], "band_hz": [low, 40]})
    (folder / "steps.json").write_text(json.dumps(steps))
    assert main(["condition", "raw.csv", "--steps", "steps.json"]) == 0
    printed = capsys.readouterr().out
    assert re.findall(r"--output-highpass ([\d.]+)\.$", printed, re.MULTILINE) == (
        [told] if told else []
    )


def test_what_a_step_finds_doubtful_is_told_and_kept_beside_the_recording(folder, capsys):
    """Oracle: the speed is made 0.35 s late."""
    write_run(recorded(CAR, drive(CAR, sample_step=0.005), seed=3, delay=0.35), "late.csv")
    steps = [
        {"kind": "rest"},
        {"kind": "speed", "acceleration": True},
        {"kind": "angles", "angle": "pitch"},
    ]
    (folder / "steps.json").write_text(json.dumps(steps))
    assert main(["condition", "late.csv", "--steps", "steps.json", "-o", "done.csv"]) == 0
    [line] = [one for one in capsys.readouterr().out.splitlines() if "seems" in one]
    assert re.match(r"Warning: chassis.pitch changes by .* chassis.v_x seems 0\.3[45]\d ±", line)
    [kept] = read_run("done.csv").conditioning[-1].warnings
    assert line == f"Warning: {kept}"


def test_a_fit_says_how_its_inputs_came_about(folder, capsys):
    assert main(["condition", "raw.csv", "--vehicle", "car.json", "-o", "done.csv"]) == 0
    command = ["identify", "done.csv", "--vehicle", "car.json", "--free", "K_F", "-o", "fit.json"]
    assert main([*command, "--output-highpass", "0.6"]) == 0
    [run] = json.loads((folder / "fit.json").read_text())["runs"]
    kinds = [record["step"]["kind"] for record in run["conditioning"]]
    assert kinds[0] == "rest"
    assert kinds[-1] == "rim-from-travel"
    assert run["conditioning"][-2]["band_hz"] == {"low": 0.3, "high": 40.0}


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--steps", "none.json"], "none.json: cannot be read"),
        (
            ["--steps", "bad.json"],
            'bad.json: step[0].kind "rset" is not known; did you mean "rest"?',
        ),
        (["--steps", "rims.json"], "where the wheels are is not known; give a vehicle"),
        (["--suggest", "-o", "done.csv"], "--suggest does nothing to the run"),
        (["-o", "raw.csv"], "raw.csv: this is raw.csv itself, which the command reads"),
        (["-o", "other.csv"], "other.toml: these notes were not written by this command"),
        (["-o", "done.toml"], "done.toml: its notes would be the same file"),
    ],
)
def test_bad_input_is_one_line(folder, capsys, options, sentence):
    (folder / "bad.json").write_text('[{"kind": "rset"}]')
    (folder / "rims.json").write_text('[{"kind": "rim-from-travel"}]')
    (folder / "other.toml").write_text('description = "mine"\n')
    assert main(["condition", "raw.csv", *options]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("ridetune: ")
    assert sentence in line
    assert (folder / "other.toml").read_text() == 'description = "mine"\n'


def test_steps_and_suggest_exclude_each_other(folder, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["condition", "raw.csv", "--suggest", "--steps", "s.json"])
    assert ended.value.code == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_recording_of_another_house_is_conditioned_by_its_mapping(folder, capsys, raw):
    """Oracle: the same recording by our names; its numbers are written with ten digits at least."""
    names = {name: f"K{place}" for place, name in enumerate(raw.columns)}
    theirs = (folder / "raw.csv").read_text()
    for name, other in names.items():
        theirs = theirs.replace(f"{name} [", f"{other} [", 1)
    (folder / "theirs.csv").write_text(theirs)
    assert main(["condition", "theirs.csv"]) == 2
    assert "ridetune channels theirs.csv -o mapping.json" in capsys.readouterr().err
    title = re.compile(r"(K\d+) \[(.*?)\]")
    units = dict(title.findall(theirs.splitlines()[0]))
    columns = [{"column": "time", "channel": "time", "unit": "s"}] + [
        {"column": names[name], "channel": name, "unit": units[names[name]]} for name in names
    ]
    (folder / "mapping.json").write_text(json.dumps({"columns": columns}))
    steps = ["--vehicle", "car.json", "-o"]
    assert main(["condition", "raw.csv", *steps, "ours_done.csv"]) == 0
    command = ["condition", "theirs.csv", "--mapping", "mapping.json", *steps, "done.csv"]
    assert main(command) == 0, capsys.readouterr().err
    ours, done = read_run("ours_done.csv"), read_run("done.csv")
    assert_allclose(done["chassis.z"], ours["chassis.z"], rtol=0, atol=1e-9)
