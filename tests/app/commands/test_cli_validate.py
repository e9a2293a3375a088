"""`ridetune validate` as a person meets it: table, report, results, refusals."""

import hashlib
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.app.cli import main
from ridetune.engine.measurement import read_run, write_run

from ..command_line import refused

SAMPLES = Path(__file__).parents[3] / "sample_runs"
TWIN = [str(SAMPLES / f"twin/manoeuvre_{number}.csv") for number in (1, 2)]
COMMAND = f"validate {TWIN[0]} --hold-out {TWIN[1]} --vehicle paper"
# Springs alone are found within seconds; all else is the twin's own.
QUICK = "--free K_F K_R --start K_F=30000"


class Elements(HTMLParser):
    """What a browser finds in a file, script texts by their type or id."""

    def __init__(self, text):
        super().__init__()
        self.seen, self.texts, self._script = [], {}, None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        self._script = dict(attrs).get("id", "") if tag == "script" else None

    def handle_data(self, data):
        if self._script is not None:
            self.texts[self._script] = self.texts.get(self._script, "") + data


def test_a_held_out_run_is_predicted_over_its_road(folder, capsys):
    """Oracle: the twin's car drove both; what is missed is the noise that was added to z."""
    (folder / "pivots.json").write_text('{"rear": {"distance": 1.1, "angle": 0.1745}}')
    known = "--manoeuvre manoeuvre_2.csv=2 --geometry pivots.json"
    assert main(f"{COMMAND} {QUICK} {known} -o r.html --json r.json".split()) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert re.search(r"manoeuvre_2\.csv \(held out\) +road \+ torque +8-DOF +96\.", printed.out)
    document = json.loads((folder / "r.json").read_text())
    fitted, held = document["runs"]
    within = re.findall(
        r"^manoeuvre_2\.csv \(held out\) +(?:rims|road \+ torque) +([. \d]+)$",
        printed.out,
        re.MULTILINE,
    )
    shares = [
        [score["coverage"] for score in one["scores"].values()]
        for one in held["predictions"]
        if one["model"] == "8dof"
    ]
    told = [[float(one) for one in row.split()] for row in within]
    assert_allclose(told, 100.0 * np.array(shares), rtol=0, atol=0.0501)
    assert_allclose(shares, 0.95, atol=0.014)  # white noise, 4001 samples, four times
    [heads] = re.findall(r"squat, deg of pitch.*", printed.out)
    assert heads.split("  ")[-1].strip() == "7-DOF, road + torque"
    [steps] = re.findall(r"^manoeuvre_2\.csv +(-[-. \d]+)$", printed.out, re.MULTILINE)
    told = [held["squat"]["step"], *(one["squat"] for one in held["predictions"])]
    assert_allclose([float(step) for step in steps.split()], np.degrees(told), atol=5e-4)
    assert held["manoeuvre"]["seed"] == 2
    for run in (fitted, held):
        assert [one["mode"] for one in run["predictions"]] == ["rims", "rims", "road", "road"]
    for one in (*fitted["predictions"], *held["predictions"]):
        if one["model"] == "8dof":
            assert_allclose(one["scores"]["chassis.z"]["rms_error"], 0.5e-3, rtol=0.045)
    assert document["geometry"]["rear.pivot.distance"] == 1.1
    assert {one["name"] for one in document["fit"]["parameters"]} == {
        "front.suspension.stiffness",
        "rear.suspension.stiffness",
    }
    for path, told in zip(TWIN, document["made"]["recordings"], strict=True):
        assert told["sha256"] == hashlib.sha256(Path(path).read_bytes()).hexdigest()
    shown = Elements((folder / "r.html").read_text())
    assert json.loads(shown.texts["data"])["validation"] == document
    for _, attributes in shown.seen:
        assert not {"src", "href"} & attributes.keys()


def test_the_manoeuvre_beside_a_recording_is_taken_and_texts_stay_texts(folder):
    """Oracle: the file's own name; nothing in it becomes an element of the report."""
    evil = "</script><img src=x onerror=alert(1)><!--.csv"
    name = evil.replace("/", "\u2215")
    run = read_run(TWIN[1])
    write_run(run, folder / name)
    beside = (folder / name).with_suffix("").name + ".manoeuvre.json"
    manoeuvre = json.loads((SAMPLES.parent / "engine" / "manoeuvres" / "2.json").read_text())
    (folder / beside).write_text(json.dumps(manoeuvre | {"name": "</script><b>"}))
    command = ["validate", name, "--vehicle", "paper", *QUICK.split(), "-o", "r.html"]
    assert main(command) == 0
    shown = Elements((folder / "r.html").read_text())
    assert not {"img", "b"} & {tag for tag, _ in shown.seen}
    (found,) = json.loads(shown.texts["data"])["validation"]["runs"]
    assert found["name"] == name
    assert found["manoeuvre"]["name"] == "</script><b>"
    assert {one["mode"] for one in found["predictions"]} == {"rims", "road"}


def test_what_makes_a_held_out_run_tell_nothing_is_warned_of(folder, capsys):
    """Oracle: the channel that was turned over, and the car that the notes name."""
    run = read_run(TWIN[1])
    turned = replace(run, channels={**run.channels, "chassis.z": -run["chassis.z"]})
    write_run(turned, "turned.csv")
    (folder / "turned.toml").write_text('vehicle = "BMW 320i"')
    command = f"validate {TWIN[0]} --hold-out turned.csv --vehicle paper {QUICK} -o r.html"
    assert main(f"{command} --json r.json".split()) == 0
    printed = capsys.readouterr()
    warnings = [line for line in printed.out.splitlines() if line.startswith("Warning: ")]
    findings = json.loads((folder / "r.json").read_text())["runs"][1]["findings"]
    assert warnings[-2:] == [f"Warning: {one}" for one in findings]
    assert "another car, BMW 320i" in findings[0]
    assert "chassis.z of run turned.csv runs against the model" in findings[1]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (f"--hold-out {TWIN[0]}", "is to be held out, but the car is fitted to it"),
        ("--manoeuvre manoeuvre_1.csv=3", "nor a manoeuvre of that name"),
        ("--manoeuvre manoeuvre_1.csv=heave", "moves the posts of a rig"),
        ("--manoeuvre manoeuvre_3.csv=1", "there is no run manoeuvre_3.csv"),
        ("--manoeuvre 1", "names no run or no manoeuvre"),
        ("--manoeuvre manoeuvre_1.csv=bump", "count the run's time from the manoeuvre's"),
        ("--manoeuvre manoeuvre_1.csv=1 manoeuvre_1.csv=2", "give it one"),
        ("--geometry bad.json", 'front.distanc is not known; did you mean "distance"?'),
        ("--geometry gone.json", "cannot be read"),
        ("--hold-out lacking.csv", "lacks wheel.rr.z"),
        ("--json missing/r.json", "there is no folder missing"),
        ("--json r.html", "name the same file"),
        ("--json bad.json --geometry bad.json", "which the command reads"),
    ],
)
def test_what_cannot_be_validated_is_refused_in_one_line(folder, capsys, arguments, sentence):
    (folder / "bad.json").write_text('{"front": {"distanc": 1.0, "angle": 0.1}}')
    run = read_run(TWIN[1])
    kept = {name: run[name] for name in run.columns if name != "wheel.rr.z"}
    write_run(type(run)("lacking", run.time, kept), folder / "lacking.csv")
    told = refused(capsys, *f"validate {TWIN[0]} --vehicle paper -o r.html {arguments}".split())
    assert sentence in told
    assert not (folder / "r.html").exists()


def test_the_report_needs_a_place(folder, capsys):
    assert "--output" in refused(capsys, *COMMAND.split())
    assert "no folder" in refused(capsys, *f"{COMMAND} -o missing/r.html".split())
