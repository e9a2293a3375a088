"""`ridetune channels` and --mapping. Oracle: a sample run under other names and in other units."""

import json
import re

import numpy as np
import pytest
from ridetune.app.cli import main
from ridetune.app.commands.arguments import mappings
from ridetune.app.commands.inputs import mapping_files
from ridetune.engine.mapping.mapping import read_mapping
from ridetune.engine.mapping.reading import read_recording
from ridetune.engine.measurement import read_run, write_run

from ..command_line import refused
from ..conftest import SAMPLES

NATIVE = SAMPLES / "twin/manoeuvre_2.csv"
TITLES = {
    "time": ("Zeit [ms]", 1e3),
    "chassis.z": ("Aufbauhub [mm]", 1e3),
    "chassis.pitch": ("Nickwinkel [rad]", 180.0 / np.pi),
    "chassis.a_x": ("acc_x_g", 1e3 / 9.80665),
    **{
        f"wheel.{corner}.z": (f"Radweg {word} [mm]", 1e3)
        for corner, word in zip(("fl", "fr", "rl", "rr"), ("VL", "VR", "HL", "HR"), strict=True)
    },
}
"""By channel another title, and what its numbers are multiplied by: pitch and a_x lie."""


@pytest.fixture
def foreign(tmp_path, monkeypatch):
    """The sample run as another house writes it, its pitch turned over."""
    monkeypatch.chdir(tmp_path)
    run = read_run(NATIVE)
    table = [factor * run[name] for name, (_, factor) in TITLES.items()]
    table[2] = -table[2]
    titles = [title for title, _ in TITLES.values()]
    np.savetxt(
        "foreign.csv", np.transpose(table), "%.12g", ";", header=";".join(titles), comments=""
    )
    return tmp_path / "foreign.csv"


def test_the_columns_are_shown_with_what_they_are_taken_for_and_why(foreign, capsys):
    assert main(["channels", "foreign.csv", "-o", "mapping.json"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("foreign.csv: CSV, 8 columns\n")
    [pitch] = [line for line in printed.splitlines() if line.startswith("Nickwinkel")]
    assert re.search(r"rad .* chassis.pitch +deg +\+1 .* unit lies: .* fit deg, not rad", pitch)
    assert "Warning: chassis.pitch runs against the pitch of the wheels" in printed
    assert "Wrote mapping.json: look through it" in printed
    taken = {one.channel: one.unit for one in read_mapping("mapping.json").columns}
    assert taken["chassis.a_x"] == "mg"
    assert set(taken) == set(TITLES)


def test_a_mapping_makes_a_foreign_recording_one_of_ours(foreign, capsys):
    """Once pitch is turned back, every number is that of the sample, to the digits written."""
    main(["channels", "foreign.csv", "--flip", "chassis.pitch", "-o", "mapping.json"])
    found, native = read_recording(foreign, read_mapping("mapping.json")), read_run(NATIVE)
    for name in TITLES:
        np.testing.assert_allclose(found[name], native[name], rtol=1e-10, atol=1e-12)
    capsys.readouterr()
    main(["channels", "foreign.csv", "--mapping", "mapping.json"])
    assert "Warning" not in capsys.readouterr().out

    simulate = ["simulate", "--vehicle", "paper", "--rims"]
    assert main([*simulate, "foreign.csv", "--mapping", "mapping.json"]) == 0
    mapped = capsys.readouterr().out
    main([*simulate, str(NATIVE)])
    ours = capsys.readouterr().out
    shown = [re.findall(r"^(chassis.(?:z|pitch)) +(\S+)$", one, re.M) for one in (mapped, ours)]
    assert shown[0] == shown[1]
    assert len(shown[0]) == 2


def test_the_signs_of_named_channels_are_turned_over(foreign, capsys):
    """Of the guess and of a mapping that is there already, whose confirmed sign is none then."""

    def signs():
        return {one.channel: one.sign for one in read_mapping("mapping.json").columns}

    main(["channels", "foreign.csv", "-o", "mapping.json"])
    guessed = signs()
    flip = ["--flip", "chassis.pitch", "chassis.z", "-o", "mapping.json"]
    capsys.readouterr()
    assert main(["channels", "foreign.csv", *flip]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"^Nickwinkel .* chassis.pitch +deg +-1 ", printed, re.M)
    assert "chassis.pitch runs against" not in printed
    turned = {name: -1 if name in flip else 1 for name in guessed}
    assert signs() == {name: sign * turned[name] for name, sign in guessed.items()}
    known = json.loads((foreign.parent / "mapping.json").read_text())
    for one in known["columns"]:
        one["sign_sure"] = True
    (foreign.parent / "known.json").write_text(json.dumps(known))
    command = ["channels", "foreign.csv", "--mapping", "known.json"]
    assert main([*command, "--flip", "chassis.z", "--flip", "chassis.pitch", *flip[-2:]]) == 0
    assert signs() == guessed
    unsure = {one.channel for one in read_mapping("mapping.json").columns if not one.sign_sure}
    assert unsure == {"chassis.z", "chassis.pitch"}


@pytest.mark.parametrize(
    ("flip", "sentence"),
    [
        (["chassis.pich"], "--flip chassis.pich: no column is taken for a channel chassis.pich"),
        (["time"], "--flip time: no column is taken for a channel time that has a sign; name "),
        (["chassis.z", "chassis.z"], "--flip chassis.z is given twice"),
    ],
)
def test_a_sign_that_cannot_be_turned_over_is_refused(foreign, capsys, flip, sentence):
    said = refused(capsys, "channels", "foreign.csv", "--flip", *flip, "-o", "mapping.json")
    assert sentence in said
    assert not (foreign.parent / "mapping.json").exists()


@pytest.mark.parametrize(
    "command",
    [
        ["identify", "foreign.csv", "--vehicle", "paper"],
        ["simulate", "--vehicle", "paper", "--rims", "foreign.csv"],
        ["simulate", "--vehicle", "paper", "--posts", "foreign.csv", "-o", "x.csv"],
        ["validate", "foreign.csv", "--vehicle", "paper", "-o", "report.html"],
    ],
)
def test_other_names_without_a_mapping_are_refused_with_the_way(foreign, capsys, command):
    said = refused(capsys, *command)
    assert "foreign.csv: no column is called time" in said
    assert "run `ridetune channels foreign.csv -o mapping.json`" in said
    assert said.endswith("and add --mapping mapping.json.")


def test_a_run_has_a_mapping_of_its_own(foreign, capsys):
    """The halves of a recording, the second with other names. Oracle: the fit to both halves
    by our names, whose numbers have eleven digits.
    """
    main(["channels", "foreign.csv", "--flip", "chassis.pitch", "-o", "first.json"])
    title, *rows = foreign.read_text().splitlines()
    foreign.write_text("\n".join([title, *rows[:2000]]))
    (foreign.parent / "other.csv").write_text("\n".join(["a;b;c;d;e;f;g;h", *rows[2000:]]))
    mapping = json.loads((foreign.parent / "first.json").read_text())
    for one, name in zip(mapping["columns"], "abcdefgh", strict=True):
        one["column"] = name
    (foreign.parent / "second.json").write_text(json.dumps(mapping))
    for name, under in (("foreign", "first"), ("other", "second")):
        run = read_recording(f"{name}.csv", read_mapping(f"{under}.json"))
        write_run(run, f"our_{name}.csv")

    def fit(*runs):
        free = ["--free", "K_F", "C_F", "-o", "fit.json"]
        assert main(["identify", *runs, "--vehicle", "paper", *free]) == 0
        found = json.loads((foreign.parent / "fit.json").read_text())
        return [one["value"] for one in found["parameters"]]

    ours = fit("our_foreign.csv", "our_other.csv")
    runs = ["foreign.csv", "other.csv"]
    for told in (
        ["first.json", "other.csv=second.json"],
        ["other.csv=second.json", "foreign.csv=first.json"],
    ):
        np.testing.assert_allclose(fit(*runs, "--mapping", *told), ours, rtol=1e-6)
    validate = ["validate", runs[0], "--vehicle", "paper", "--free", "K_F", "-o", "report.html"]
    held = ["--hold-out", runs[1], "--mapping", "first.json", "other.csv=second.json"]
    assert main([*validate, *held]) == 0
    advise = ["advise", *runs, "--vehicle", "fit.json", "--candidates", "heave"]
    assert main([*advise, "--mapping", "first.json", "other.csv=second.json"]) == 0


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        (
            ["lap.csv=m.json"],
            "--mapping lap.csv=m.json: there is no run lap.csv; there are foreign",
        ),
        (["=m.json"], "--mapping =m.json names no run or no file; write FILE or RUN=FILE."),
        (["m.json", "n.json"], "--mapping n.json is a second mapping of the same runs; give one"),
        (
            ["foreign.csv=m.json", "foreign.csv=n.json"],
            "--mapping foreign.csv=n.json is a second mapping of foreign.csv; give one",
        ),
    ],
)
@pytest.mark.parametrize("command", [["identify"], ["validate", "-o", "r.html"], ["advise"]])
def test_a_mapping_that_is_no_run_s_is_refused(foreign, capsys, command, told, sentence):
    name, *more = command
    asked = [name, "foreign.csv", *more, "--vehicle", "paper", "--mapping", *told]
    assert sentence in refused(capsys, *asked)


def test_a_file_that_is_there_is_meant_by_its_whole_name(folder):
    """Whatever = is in it, alone and after a run; of one that is not there the last one parts."""
    (folder / "car=7.json").touch()
    paths = ["lap=1.csv", "lap.csv"]
    assert mappings(["car=7.json"], paths) == ["car=7.json"] * 2
    assert mappings(["lap=1.csv=car=7.json"], paths) == ["car=7.json", None]
    assert mappings(["lap=1.csv=nowhere.json"], paths) == ["nowhere.json", None]
    assert mapping_files(["lap.csv=car=7.json"]) == ["car=7.json"]


def test_what_makes_no_sense_with_a_mapping_is_refused(foreign, capsys):
    main(["channels", "foreign.csv", "-o", "mapping.json"])
    capsys.readouterr()
    command = ["simulate", "--vehicle", "paper", "--manoeuvre", "2", "-o", "x.csv"]
    said = refused(capsys, *command, "--mapping", "mapping.json")
    assert "--mapping belongs to a recording" in said
    said = refused(capsys, "channels", str(NATIVE), "--mapping", "mapping.json")
    assert "manoeuvre_2.csv: the file has no column called 'Zeit'" in said
    assert "nowhere.json: cannot be read" in refused(
        capsys, "channels", "foreign.csv", "--mapping", "nowhere.json"
    )
    assert "nowhere.csv: the file cannot be read" in refused(capsys, "channels", "nowhere.csv")
    said = refused(capsys, "channels", "foreign.csv", "-o", "foreign.csv")
    assert "which the command reads" in said


def test_what_cannot_be_applied_yet_is_said_with_the_guess(foreign, capsys):
    lines = foreign.read_text().splitlines()
    for row in range(100, 105):
        cells = lines[row].split(";")
        lines[row] = ";".join([cells[0], "-9999", *cells[2:]])
    foreign.write_text("\n".join(lines))
    assert main(["channels", "foreign.csv"]) == 0
    printed = capsys.readouterr().out
    assert "Warning: Aufbauhub is -9999 in 5 samples, far outside the rest" in printed
    assert "give -9999 as missing, else say that no number is missing" in printed


def test_of_a_file_that_says_nothing_everything_is_left_to_a_person(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    rows = "\n".join(f"{k},{k % 7}" for k in range(20))
    (tmp_path / "raw.csv").write_text(f"channel 1 [V],channel 2 [V]\n{rows}\n")
    assert main(["channels", "raw.csv", "-o", "mapping.json"]) == 0
    assert (
        "No column is taken for a channel by its name; map some by hand." in capsys.readouterr().out
    )
    assert json.loads((tmp_path / "mapping.json").read_text())["columns"] == []
