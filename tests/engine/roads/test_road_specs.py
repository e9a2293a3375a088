"""Roads as data become the roads of their shapes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.curves import SweptSine
from ridetune.engine.errors import RoadError
from ridetune.engine.json_record import record_to_json
from ridetune.engine.roads.iso8608 import Roughness, iso_road
from ridetune.engine.roads.road import LEFT, RIGHT
from ridetune.engine.roads.road_shapes import bump, pothole, sine_sweep
from ridetune.engine.roads.road_specs import Place, road_spec_from_json

PLACE = Place(first_contact=1.3, torque_end=30.0, end=80.0)
SWEEP = {"length": 60, "first_wavelength": 20, "last_wavelength": 1}
ROADS = {
    "bump": (
        {"kind": "bump", "begin": 5, "length": 1, "height": 0.05},
        bump(5.0, 1.0, 0.05),
    ),
    "pothole": (
        {"kind": "pothole", "begin": 5, "length": 0.8, "depth": 0.05, "tracks": "left"},
        pothole(5.0, 0.8, 0.05, 0.1, "left"),
    ),
    "sine sweep": (
        {"kind": "sine-sweep", "begin": 5, **SWEEP, "amplitude": 0.02, "last_amplitude": 0.001},
        sine_sweep(5.0, SweptSine(60.0, 0.05, 1.0, 0.02, 0.001)),
    ),
    "one class": (
        {"kind": "iso8608", "sections": [{"class": "C"}]},
        iso_road([("C", 1.3)], 80.0, 3),
    ),
    "two classes, everything stated": (
        {
            "kind": "iso8608",
            "sections": [{"class": "A", "from": 2}, {"class": "C", "from": "torque-end"}],
            "class_factor": 0.5,
            "band": [0.03, 2],
            "waviness": 2.2,
            "coherence": "isotropic",
            "decay": 1,
            "track": 1.6,
        },
        iso_road(
            [("A", 2.0), ("C", 30.0)],
            80.0,
            3,
            Roughness((0.03, 2.0), 2.2, 0.5, "isotropic", 1.0, 1.6),
        ),
    ),
}


@pytest.mark.parametrize("name", list(ROADS))
def test_a_description_builds_its_road_and_survives_json(name):
    data, expected = ROADS[name]
    spec = road_spec_from_json(data)
    road, x = spec.build(PLACE, seed=3), np.linspace(-5, 90, 5001)
    for side in (LEFT, RIGHT):
        assert_allclose(road.height(side, x), expected.height(side, x), rtol=0, atol=1e-15)
    assert road_spec_from_json(record_to_json(spec)) == spec


def test_level_ground_is_a_road():
    road = road_spec_from_json({"kind": "flat"}).build(PLACE, seed=0)
    assert not road.height(LEFT, np.linspace(-10, 100, 50)).any()


def test_a_section_beyond_the_end_is_left_out():
    data = {"kind": "iso8608", "sections": [{"class": "A"}, {"class": "C", "from": 500}]}
    road, expected = road_spec_from_json(data).build(PLACE, 3), iso_road([("A", 1.3)], 80.0, 3)
    assert np.array_equal(road.left, expected.left)


def test_a_car_that_stays_has_a_road_all_the_same():
    data = {"kind": "iso8608", "sections": [{"class": "A", "from": 200}]}
    assert road_spec_from_json(data).build(PLACE, 3).end >= 202.0


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ({"kind": "pothole", "begin": 5, "length": 0.1, "depth": 0.05}, "edge is longer than half"),
        ({"kind": "bump", "begin": -1, "length": 1, "height": 0.05}, "begin is -1, but must lie"),
        ({"kind": "bump", "begin": 1, "length": 1, "height": 50}, "height is 50, but must lie"),
        (
            {"kind": "sine-sweep", "begin": 0, **SWEEP, "amplitude": 0.1, "last_amplitude": 0.1}
            | {"length": 20000},
            "more than 5000 waves of 1 m; shorten it to 5000 m",
        ),
        ({"kind": "hump"}, 'did you mean "bump"'),
        ({"begin": 5}, "kind is missing"),
        ("bump", 'is "bump", but must be an object of kind "flat"'),
        (
            {"kind": "iso8608", "sections": [{"class": "A", "from": 9}, {"class": "B", "from": 4}]},
            "put them in order",
        ),
    ],
)
def test_a_wrong_description_is_refused_with_the_remedy(data, sentence):
    with pytest.raises(RoadError, match=sentence):
        road_spec_from_json(data).build(PLACE, 1)
