"""`ridetune advise` as a person meets it: report, JSON, refusals."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from ridetune.app.cli import main
from ridetune.engine.measurement import read_run, write_run

from ..command_line import refused

SAMPLES = Path(__file__).parents[3] / "sample_runs"
TWIN = [str(SAMPLES / f"twin/manoeuvre_{number}.csv") for number in (1, 2)]


def test_a_plan_is_made_before_there_is_any_run(folder, capsys):
    """Braking tells the front pivot, a bump under both sides nothing (docs/advice.md)."""
    (folder / "track.json").write_text('{"name": "Track", "kind": "road", "duration": 2}')
    command = "advise --vehicle paper --candidates bump brake-54 track.json --planned 1 2"
    assert main(f"{command} --json advice.json".split()) == 0
    printed = capsys.readouterr().out
    assert "Together: brake-54, then" in printed
    told = json.loads((folder / "advice.json").read_text())
    assert [one["key"] for one in told["candidates"]][0] == "brake-54"
    assert {one["key"] for one in told["candidates"]} == {"brake-54", "bump", "track"}
    assert told["candidates"][0]["manoeuvre"]["brake"]["level"] == 3.924


def test_advice_after_a_fit_takes_its_values_and_what_was_free(folder, capsys):
    fit = f"identify {TWIN[0]} --vehicle paper --free K_F K_R phi_F --bounds K_F=10000:40000"
    assert main(f"{fit} -o fit.json".split()) == 0
    assert (
        main(f"advise {TWIN[0]} --vehicle fit.json --candidates brake-54 --json a.json".split())
        == 0
    )
    fitted = json.loads((folder / "fit.json").read_text())
    told = json.loads((folder / "a.json").read_text())
    now = told["now"]["parameters"]
    assert [one["name"] for one in now] == [one["name"] for one in fitted["parameters"]]
    for one, other in zip(now, fitted["parameters"], strict=True):
        assert one["value"] == other["value"]
        assert one["std_error"] == pytest.approx(other["std_error"], rel=0.01)
    assert told["candidates"][0]["sentence"].count("phi_F from") == 1


def test_a_fit_without_its_runs_is_told_to_need_them(folder, capsys):
    fit = f"identify {TWIN[0]} --vehicle paper --free K_F K_R -o fit.json"
    assert main(fit.split()) == 0
    assert main(["advise", "--vehicle", "fit.json", "--candidates", "brake-54"]) == 0
    assert "What fit.json knows counts only together with its runs" in capsys.readouterr().out


def test_from_a_vehicle_the_runs_are_fitted_first(folder, capsys):
    assert main(f"advise {TWIN[1]} --vehicle paper --candidates brake-54".split()) == 0
    assert capsys.readouterr().out.startswith("The fit converged")


def test_a_turned_channel_is_refused_as_identify_names_it(folder, capsys):
    """Oracle: the turn that was made. A fit to it has bent the car; one to another run has not."""
    run = read_run(TWIN[0])
    turned = replace(run, channels={**run.channels, "chassis.z": -run["chassis.z"]})
    write_run(turned, "turned.csv")
    free = "--free K_F K_R --bounds K_F=10000:40000 K_R=10000:40000"
    assert main(f"identify turned.csv --vehicle paper {free} -o bent.json".split()) == 0
    assert main(f"identify {TWIN[0]} --vehicle paper {free} -o right.json".split()) == 0
    [named] = json.loads((folder / "bent.json").read_text())["faults"]
    assert "chassis.z of run turned.csv runs against the model" in named
    capsys.readouterr()
    for vehicle in ("bent.json", "right.json"):
        told = refused(capsys, *f"advise turned.csv --vehicle {vehicle}".split())
        assert "chassis.z of run turned.csv runs against the model" in told
        assert "multiply it by -1." in told
    old = json.loads((folder / "bent.json").read_text())
    del old["faults"]
    (folder / "bent.json").write_text(json.dumps(old))
    told = refused(capsys, *["advise", "turned.csv", "--vehicle", "bent.json"])
    assert "a channel is probably wrong" in told


def test_refusals_name_the_place(folder, capsys):
    for arguments, sentence in (
        ("--vehicle paper --candidates brake-5", "did you mean brake-54?"),
        ("--vehicle paper --json nowhere/a.json", "there is no folder nowhere"),
        ("gone.csv --vehicle paper", "gone.csv: the file cannot be read"),
    ):
        assert sentence in refused(capsys, *f"advise {arguments}".split())


def test_a_fit_that_is_damaged_is_refused(folder, capsys):
    assert main(f"identify {TWIN[0]} --vehicle paper --free K_F K_R -o fit.json".split()) == 0
    fit = json.loads((folder / "fit.json").read_text())
    for damage, sentence in (
        ({"covariance": [[1.0]]}, "fit.json: this fit cannot be read"),
        ({"covariance": [[None, 0], [0, 1]]}, "fit.json: the fit's covariance is not finite"),
        ({"quantile": "two"}, "fit.json: this fit cannot be read"),
    ):
        (folder / "fit.json").write_text(json.dumps(fit | damage))
        assert sentence in refused(capsys, *f"advise {TWIN[0]} --vehicle fit.json".split())
