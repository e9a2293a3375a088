import copy
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import ridetune.engine
from ridetune.engine.errors import VehicleError
from ridetune.engine.vehicle_file import (
    read_vehicle,
    reference_vehicles,
    vehicle_from_json,
    vehicle_from_text,
    vehicle_to_json,
    write_vehicle,
)
from scipy.linalg import eigh

KEYS = ["paper", "bmw-320i", "ford-escort", "vw-vanagon"]


@pytest.fixture
def data():
    """The documented example of a vehicle's JSON, complete."""
    return copy.deepcopy(vehicle_to_json(reference_vehicles()["paper"]))


def test_the_reference_cars_are_there_the_paper_s_first():
    assert list(reference_vehicles()) == KEYS


def test_the_paper_s_car_has_the_documented_numbers():
    """Oracle: the model's description, "Reference vehicle"."""
    car = reference_vehicles()["paper"]
    assert car.chassis.cg_height == 0.56
    assert [car.front.cg_distance, car.rear.cg_distance] == [1.30, 1.36]
    assert [car.front.track, car.rear.track] == [1.50, 1.51]
    for axle, spring, damper, bar, bar_damper, distance, degrees in (
        (car.front, 24000, 1700, 22000, 150, 1.60, 4),
        (car.rear, 27000, 1900, 9000, 100, 1.10, 10),
    ):
        assert (axle.suspension.stiffness, axle.suspension.damping) == (spring, damper)
        assert (axle.stabilizer_bar.stiffness, axle.stabilizer_bar.damping) == (bar, bar_damper)
        assert axle.pivot.distance == distance
        assert axle.pivot.angle == pytest.approx(np.radians(degrees), rel=1e-12)
        assert axle.suspension.mount_height == 0.40
        assert (axle.tyre.stiffness, axle.tyre.damping) == (196261, 50)
        assert axle.tyre.rolling_resistance == 0.01
        assert (axle.wheel.radius, axle.wheel.inertia.yy) == (0.30, 1.1)


def undamped_frequencies(car):
    """Undamped modes of z, pitch, roll and four wheels, Hz, written down for this test alone.

    The bar acts as the roll stiffness Ktor (track/d)^2 between the body and the line through the
    two wheel centres, as in the CommonRoad sets.
    """
    axles = (car.front, car.front, car.rear, car.rear)
    x = [car.front.cg_distance] * 2 + [-car.rear.cg_distance] * 2
    y = [side * axle.track / 2 for side, axle in zip((1, -1, 1, -1), axles, strict=True)]
    inertia, stiffness = car.chassis.inertia, np.zeros((7, 7))
    masses = np.diag([car.chassis.mass, inertia.yy, inertia.xx, *(a.wheel.mass for a in axles)])
    for corner, axle in enumerate(axles):
        compression = np.zeros(7)
        compression[:3] = 1.0, -x[corner], y[corner]
        compression[3 + corner] = -1.0
        stiffness += axle.suspension.stiffness * np.outer(compression, compression)
        stiffness[3 + corner, 3 + corner] += axle.tyre.stiffness
    for left, axle in ((3, car.front), (5, car.rear)):
        roll = np.zeros(7)
        roll[2], roll[left], roll[left + 1] = 1.0, -1.0 / axle.track, 1.0 / axle.track
        bar = axle.stabilizer_bar.stiffness * (axle.track / axle.pivot.distance) ** 2
        stiffness += bar * np.outer(roll, roll)
    return np.sqrt(eigh(stiffness, masses, eigvals_only=True)) / (2.0 * np.pi)


@pytest.mark.parametrize(
    ("key", "body", "hop"),
    [
        ("bmw-320i", [1.420, 1.436, 2.303], [11.90, 12.31]),
        ("vw-vanagon", [1.405, 1.615, 2.327], [12.41, 13.11]),
        ("ford-escort", [1.217, 1.611, 2.240], [12.79, 13.20]),
    ],
)
def test_published_cars_have_their_published_modes(key, body, hop):
    """Oracle: undamped modes of the CommonRoad sets, given to 1 mHz (body) and 10 mHz (hop).

    Half a digit of the figures plus what seven-digit input may shift.
    """
    found = undamped_frequencies(reference_vehicles()[key])
    np.testing.assert_allclose(found[:3], body, rtol=0, atol=5.1e-4)
    np.testing.assert_allclose(found[[3, 6]], hop, rtol=0, atol=5.1e-3)


@pytest.mark.parametrize("key", KEYS)
def test_every_reference_car_states_its_source(key):
    source = reference_vehicles()[key].source
    assert "hosen" in source  # what was chosen
    if key != "paper":
        assert "LICENSE-commonroad.txt" in source


def test_the_licence_of_the_published_sets_is_shipped():
    folder = Path(ridetune.engine.__file__).parent / "vehicles"
    assert "BSD 3-Clause" in (folder / "LICENSE-commonroad.txt").read_text()


@pytest.mark.parametrize("key", KEYS)
def test_writing_and_reading_returns_the_same_car(key, tmp_path):
    car = reference_vehicles()[key]
    write_vehicle(car, tmp_path / "car.json")
    assert read_vehicle(tmp_path / "car.json") == car


def test_a_car_without_brakes_is_written_without_them(data):
    del data["brakes"]
    car = vehicle_from_json(data)
    assert car.brakes is None
    assert vehicle_to_json(car) == data


def test_left_out_fields_take_the_documented_defaults(data):
    del data["chassis"]["inertia"]["xz"]
    del data["front"]["suspension"]["mount_height"]
    del data["front"]["torque_reaction"]
    del data["front"]["wheel"]["cg_offset"]
    del data["brakes"]["reaction"]
    car = vehicle_from_json(data)
    assert car == reference_vehicles()["paper"]


def test_the_result_of_an_identification_is_accepted_as_a_vehicle(data, tmp_path):
    path = tmp_path / "fit.json"
    path.write_text(json.dumps({"vehicle": data, "parameters": [], "cost": 1.0}))
    assert read_vehicle(path) == reference_vehicles()["paper"]


def test_a_fault_inside_a_fit_is_named_by_its_whole_path(data):
    del data["front"]["track"]
    with pytest.raises(VehicleError, match=r"fit\.json: vehicle\.front\.track is missing"):
        vehicle_from_json({"vehicle": data}, "fit.json")


def _set(data, path, value):
    *parents, last = path.split(".")
    for name in parents:
        data = data[name]
    if value is ...:
        del data[last]
    else:
        data[last] = value


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("front.track", ..., "front.track is missing; add a number between 0.2 and 5 m"),
        ("rear", ..., "rear is missing; add an object"),
        ("front.trakc", 1.5, 'front.trakc is not known; did you mean "track"?'),
        ("front.suspension.stifness", 1, 'stifness is not known; did you mean "stiffness"?'),
        ("front.track", "1.5", 'front.track is "1.5", but must be a number'),
        ("front.track", True, "front.track is true, but must be a number"),
        ("front.track", None, "front.track is null, but must be a number"),
        ("front.track", [1.5], "front.track is a list, but must be a number"),
        ("front.track", float("nan"), "front.track is nan, but must lie between 0.2 and 5 m"),
        ("front.track", float("inf"), "front.track is inf, but must lie between 0.2 and 5 m"),
        ("front.track", 10**400, "but must lie between 0.2 and 5 m"),
        ("chassis.mass", -1090, "chassis.mass is -1090, but must lie between 10 and 100000 kg"),
        ("front.driven", 1, "front.driven is 1, but must be true or false"),
        ("front.driven", "yes", 'front.driven is "yes", but must be true or false'),
        ("front.torque_reaction", "body", 'is "body", but must be "chassis" or "arm"'),
        ("front.wheel.cg_offset", [0, 0], "cg_offset has 2 values, but must have 3"),
        ("front.wheel.cg_offset", [0, 0, 9], r"cg_offset[2] is 9, but must lie between -1 and 1 m"),
        ("name", 3, "name is 3, but must be a text"),
        ("name", 10_001 * "x", "name has 10001 characters, at most 10000 are taken; shorten it"),
        ("front", [], "front must be an object {...}, not a list"),
    ],
)
def test_a_fault_is_named_by_file_path_and_remedy(data, path, value, message):
    _set(data, path, value)
    with pytest.raises(VehicleError) as caught:
        vehicle_from_json(data, "car.json")
    assert str(caught.value).startswith("car.json: ")
    assert message in str(caught.value)


@pytest.mark.parametrize("content", [[], None, 3, "car", True])
def test_something_else_than_an_object_is_no_vehicle(content):
    with pytest.raises(VehicleError, match=r"vehicle: must be an object"):
        vehicle_from_json(content)


def test_a_doubled_key_is_refused_rather_than_the_last_one_taken(data):
    text = json.dumps(data).replace('"track": 1.5,', '"track": 1.5, "track": 1.6,')
    with pytest.raises(VehicleError, match=r"car\.json: front\.track is given twice; keep one"):
        vehicle_from_text(text.encode(), "car.json")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(VehicleError, match=r"nowhere\.json: cannot be read .*check the path"):
        read_vehicle(tmp_path / "nowhere.json")


def test_a_source_is_kept_and_plays_no_part(data):
    car = vehicle_from_json(data | {"source": "weighed on Monday"})
    assert car.source == "weighed on Monday"
    assert replace(car, source="") == replace(reference_vehicles()["paper"], source="")
