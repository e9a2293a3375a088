"""Runs of different cars are told apart, whatever their vehicle is called."""

from dataclasses import replace
from pathlib import Path

from ridetune.engine.identification.advisor import advise
from ridetune.engine.identification.cars import mixed_plants
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.measurement import read_run
from ridetune.engine.vehicle_file import reference_vehicles

from ... import stand_in

SAMPLES = Path(__file__).parents[3] / "sample_runs"


def test_runs_of_one_plant_are_not_told_of():
    assert mixed_plants({}) == []
    assert mixed_plants({"a.csv": "", "b.csv": ""}) == []
    assert mixed_plants({"a.csv": "detailed", "b.csv": "detailed"}) == []


def test_one_sentence_names_the_runs_by_what_drove_them():
    (said,) = mixed_plants({"a.csv": "", "b.csv": "concept", "c.csv": "", "d.csv": "detailed"})
    assert ": nothing tells what drove a.csv, c.csv; b.csv was driven by the concept car of" in said
    assert "d.csv was driven by the detailed car of a campaign. Use those of one car" in said


def test_a_run_of_which_nothing_is_told_is_not_said_to_be_of_another_car():
    (said,) = mixed_plants({"a.csv": "detailed", "b.csv": ""})
    assert said == (
        "Whether the runs are of one car is not known: a.csv was driven by the detailed car of a"
        " campaign; nothing tells what drove b.csv. Add the notes of those that have none, or use"
        " those of one car together."
    )


def test_a_fit_and_the_advice_after_it_warn_of_a_virtual_run_among_measured_ones():
    """Oracle: the notes of the twin, which a campaign of the concept car drove."""
    twin = read_run(SAMPLES / "twin/manoeuvre_1.csv")
    assert (twin.vehicle, twin.plant) == ("Reference car of the paper", "concept")
    measured = replace(read_run(SAMPLES / "twin/manoeuvre_2.csv"), plant="")
    car = reference_vehicles()["paper"]
    some = {"bump": reference_manoeuvres()["bump"]}
    said = advise(Problem.build(car, [twin, measured], ["K_F"]), some).warnings
    assert said == tuple(mixed_plants({twin.name: "concept", measured.name: ""}))
    assert advise(Problem.build(car, [twin], ["K_F"]), some).warnings == ()

    one, other = (
        stand_in.recording(stand_in.REFERENCE, name=name, seed=seed)
        for seed, name in enumerate(("one", "other"))
    )
    runs = [one, replace(other, plant="detailed")]
    found = identify(Problem.build(stand_in.REFERENCE, runs), simulate=stand_in.simulate)
    assert mixed_plants({"one": "", "other": "detailed"})[0] in found.warnings
