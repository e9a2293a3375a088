"""The detailed car's data: what is in it, and what is said of a mistake."""

import json
from copy import deepcopy
from math import nan
from pathlib import Path

import pytest
from ridetune.engine import detailed
from ridetune.engine.detailed.car_file import car_from_json, reference_car
from ridetune.engine.errors import VehicleError

DATA = json.loads((Path(detailed.__file__).parent / "car.json").read_text())


def test_the_reference_car_weighs_what_the_paper_says():
    assert reference_car().total_mass == pytest.approx(1240.0)
    assert len(reference_car().bodies) == 81


def rename(data):
    data["joints"][10]["bodies"][1] = "f_caliper_LL"


def unknown_law(data):
    data["bushings"][0]["law"] = "front_subfrme"


def no_mass(data):
    del data["bodies"][3]["mass"]


def negative_mass(data):
    data["bodies"][3]["mass"] = -1.0


def not_a_number(data):
    data["bodies"][3]["cg"][0] = nan


def impossible_inertia(data):
    data["bodies"][0]["inertia"]["zz"] = 1300.0


def no_axis(data):
    del next(one for one in data["joints"] if one["kind"] == "revolute")["axis"]


def loose(data):
    data["bodies"].append({**data["bodies"][0], "name": "trailer"})


def twice(data):
    data["bodies"].append(data["bodies"][0])


def to_itself(data):
    data["bushings"][0]["bodies"] = ["chassis", "chassis"]


def off_axle(data):
    data["wheels"][0]["centre"][2] += 0.01


def locked(data):
    data["wheels"][0]["carrier"] = data["wheels"][0]["body"]


def half_driven(data):
    del data["wheels"][2]["driven_against"]


def fifth_spring(data):
    data["springs"].append(data["springs"][0])


@pytest.mark.parametrize(
    ("spoil", "place", "remedy"),
    [
        (rename, 'joints[10].bodies[1] is "f_caliper_LL"', 'did you mean "f_caliper_L"?'),
        (unknown_law, 'bushings[0].law is "front_subfrme"', 'did you mean "front_subframe"?'),
        (no_mass, "bodies[3].mass is missing", "add a number"),
        (negative_mass, "bodies[3].mass is -1.0", "must lie between"),
        (not_a_number, "bodies[3].cg[0] is nan", "must lie between"),
        (impossible_inertia, 'bodies[0].inertia of "chassis"', "exceeds the sum of the others"),
        (no_axis, "axis is missing", "a revolute joint needs a unit vector"),
        (loose, 'bodies hold "trailer"', "join it"),
        (twice, 'bodies hold "chassis" 2 times', "rename"),
        (to_itself, 'bushings[0].bodies are both "chassis"', "name two"),
        (off_axle, "wheels[0].centre is 10.0 mm off", "correct it"),
        (locked, 'wheels[0].carrier is "f_rim_L"', "correct one of the two"),
        (half_driven, "wheels of the rear axle are driven by halves", 'give both "driven_against"'),
        (fifth_spring, 'springs are 2 of "fl"', "give one"),
    ],
)
def test_a_mistake_is_named_with_its_place_and_remedy(spoil, place, remedy):
    data = deepcopy(DATA)
    spoil(data)
    with pytest.raises(VehicleError) as refused:
        car_from_json(data, "mine.json")
    message = str(refused.value)
    assert message.startswith("mine.json: ")
    assert place in message
    assert remedy in message
    assert "\n" not in message
