"""Manoeuvres as data: Table 2's torques and roads, the messages about wrong files."""

import copy
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.demand import point_mass_motion
from ridetune.engine.errors import ManoeuvreError, RoadError
from ridetune.engine.manoeuvre import (
    manoeuvre_from_json,
    manoeuvre_to_json,
    read_manoeuvre,
    reference_manoeuvres,
)
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.roads.iso8608 import iso_road
from ridetune.engine.roads.road import LEFT, RIGHT
from ridetune.engine.torque_laws import DriveTable
from ridetune.engine.vehicle import Brakes
from scipy import signal

from ..factories import paper_vehicle

G, MASS, RADIUS = 9.81, 1240.0, 0.30
KEYS = list(reference_manoeuvres())
BRAKING = {
    "name": "stop",
    "kind": "road",
    "duration": 8,
    "initial_speed": 20,
    "brake": {"kind": "deceleration", "level": 4, "start": 1, "ramp": 0},
}


def motion_of(manoeuvre, vehicle):
    demand = manoeuvre.demand(vehicle)
    return point_mass_motion(
        vehicle, demand.drive, demand.brake, demand.initial_speed, demand.duration
    )


def changed(path, value, base=None):
    """Data of manoeuvre 2 (or another) with one value replaced, or removed where it is None."""
    data = copy.deepcopy(base or manoeuvre_to_json(reference_manoeuvres()["2"]))
    *folders, name = path.split(".")
    part = data
    for folder in folders:
        part = part[int(folder)] if isinstance(part, list) else part[folder]
    if value is None:
        del part[name]
    else:
        part[name] = value
    return data


@pytest.mark.parametrize("key", KEYS)
def test_every_manoeuvre_of_the_package_survives_its_own_json(key):
    manoeuvre = reference_manoeuvres()[key]
    text = json.dumps(manoeuvre_to_json(manoeuvre))
    assert manoeuvre_from_json(json.loads(text)) == manoeuvre
    assert manoeuvre.name
    assert manoeuvre.description


@pytest.mark.parametrize("key", KEYS)
def test_every_manoeuvre_of_the_package_gives_a_whole_demand(key):
    """The road reaches beyond the farthest wheel; a rig moves all four posts from rest."""
    manoeuvre, vehicle = reference_manoeuvres()[key], paper_vehicle()
    demand = manoeuvre.demand(vehicle)
    assert demand.duration == manoeuvre.duration
    if manoeuvre.kind == "posts":
        assert demand.road is None
        assert demand.posts.time[-1] == manoeuvre.duration
        assert_allclose(demand.posts.height[[0, -1]], 0.0, atol=1e-15)
        assert np.abs(demand.posts.height).max(axis=0).min() > 1e-3
    else:
        assert demand.posts is None
        assert demand.road.height(LEFT, vehicle.front.cg_distance) == 0.0
        if manoeuvre.road.kind == "iso8608":
            assert demand.road.end > motion_of(manoeuvre, vehicle).x[-1] + vehicle.front.cg_distance


@pytest.mark.parametrize(("key", "time"), [("1", 10.0), ("2", 5.0)])
def test_table_2_torques_on_the_driven_wheels(key, time):
    """Oracle: T_i = r M (v/t_a + fr g)/2, with 0.1 s ramps from t = 5 s on."""
    drive = reference_manoeuvres()[key].demand(paper_vehicle()).drive
    full = RADIUS * MASS * (15.0 / time + 0.01 * G) / 2
    expected = np.interp([4.9, 5.05, 5.1, 7.0], [5.0, 5.1], [0.0, full])
    for wheel in (2, 3):
        assert_allclose(drive.at([4.9, 5.05, 5.1, 7.0])[:, wheel], expected, rtol=1e-12)
        assert_allclose(
            drive.at(5 + time + np.array([0.0, 0.05, 0.1, 3]))[:, wheel], [full, full / 2, 0, 0]
        )
    assert not drive.at(np.linspace(0, 20, 99))[:, :2].any()


@pytest.mark.parametrize(("key", "time"), [("1", 10.0), ("2", 5.0)])
def test_table_2_reaches_15_m_per_s_and_coasts_at_a_hundredth_of_g(key, time):
    """Oracle: the ramps keep the impulse; rolling resistance acts 0.1 s longer (0.01 m/s) and is
    missing while v < v0 = 0.1 m/s (0.003 m/s)."""
    motion = motion_of(reference_manoeuvres()[key], paper_vehicle())
    end = np.searchsorted(motion.time, 5 + time + 0.1)
    assert_allclose(motion.v[end], 15.0, rtol=0, atol=0.015)
    assert_allclose(motion.a[end + 1 :], -0.01 * G, rtol=1e-9)
    assert_allclose(motion.v[motion.time <= 5.0], 0.0, atol=1e-12)


def test_four_driven_wheels_share_the_traction():
    vehicle = paper_vehicle()
    vehicle = replace(vehicle, front=replace(vehicle.front, driven=True))
    drive = reference_manoeuvres()["2"].demand(vehicle).drive
    assert_allclose(drive.at(7.0), RADIUS * MASS * (3.0 + 0.01 * G) / 4, rtol=1e-12)


def test_the_class_changes_where_the_car_is_when_the_torque_ends():
    """Oracle: the road built from the point mass's place at t = 10.1 s."""
    manoeuvre, vehicle = reference_manoeuvres()["2"], paper_vehicle()
    motion = motion_of(manoeuvre, vehicle)
    place = float(np.interp(10.1, motion.time, motion.x))
    assert_allclose(place, 15.0 * 5.1 / 2, rtol=0.01)
    road = manoeuvre.demand(vehicle).road
    expected = iso_road([("A", 1.30), ("C", place)], 150.0, manoeuvre.seed)
    x = np.linspace(0.0, 149.0, 3000)
    for side in (LEFT, RIGHT):
        assert_allclose(road.height(side, x), expected.height(side, x), rtol=0, atol=1e-6)


@pytest.mark.parametrize("duration", [1.0, 7.0])
def test_a_manoeuvre_cut_before_its_torque_ends_keeps_the_first_class(duration):
    """Oracle: the whole manoeuvre's road, up to where its class changes."""
    whole = reference_manoeuvres()["2"]
    car = paper_vehicle()
    cut = replace(whole, duration=duration).demand(car).road
    x = np.linspace(0.0, cut.end - 1.0, 200)
    assert_allclose(cut.height(LEFT, x), whole.demand(car).road.height(LEFT, x), atol=1e-6)


def test_another_seed_is_another_road_and_the_same_torques():
    manoeuvre, vehicle = reference_manoeuvres()["1"], paper_vehicle()
    one, other = manoeuvre.demand(vehicle), replace(manoeuvre, seed=99).demand(vehicle)
    assert np.array_equal(one.drive.values, other.drive.values)
    assert not np.allclose(one.road.left, other.road.left)


def test_a_road_of_half_the_power_from_a_lowest_frequency_on_has_that_spectrum():
    """Oracle: Gd(n) of ISO 8608 by Welch's method on 10 km of class C; an octave from n holds
    n * length waves on each track, and Hann windows of 205 m spread a bin over 0.005 cycle/m.
    """
    lowest, manoeuvre = 0.03, reference_manoeuvres()["constant-speed-c"].lasting(500.0)
    driven = manoeuvre.roughened(0.5, (lowest, 2.83), seed=8)
    road = driven.demand(paper_vehicle()).road
    n, left = signal.welch(road.left[40:], fs=1 / road.spacing, nperseg=4096)
    psd = 0.5 * (left + signal.welch(road.right[40:], fs=1 / road.spacing, nperseg=4096)[1])
    for low in (0.05, 0.1, 0.2, 0.4, 0.8):
        octave = (n >= low) & (n < 2 * low)
        ratio = np.mean(psd[octave] / (0.5 * 256e-6 * (n[octave] / 0.1) ** -2))
        assert abs(ratio - 1.0) < 4 / np.sqrt(1e4 * low) + 0.01
    assert psd[n < lowest - 0.01].sum() < 1e-3 * psd.sum()


def test_the_road_options_are_those_of_the_file_and_leave_other_roads_alone():
    rough = reference_manoeuvres()["2"].roughened(0.5, (0.03, 2.0), seed=9)
    data = manoeuvre_to_json(rough)
    assert (data["road"]["class_factor"], data["road"]["band"]) == (0.5, [0.03, 2.0])
    assert data["seed"] == 9
    assert manoeuvre_from_json(data) == rough
    assert reference_manoeuvres()["2"].roughened() == reference_manoeuvres()["2"]
    bump = reference_manoeuvres()["bump"]
    assert bump.roughened(0.5, seed=9) is bump
    with pytest.raises(ManoeuvreError, match=r"road.class_factor is 0.0, but must lie between"):
        reference_manoeuvres()["2"].roughened(0.0)
    with pytest.raises(ManoeuvreError, match="band must rise"):
        reference_manoeuvres()["2"].roughened(band=(1.0, 0.5))


def test_braking_takes_the_stated_level_and_shares():
    """Oracle: sum B_i/r + fr M g = M b; 0.7 of it in front."""
    vehicle = replace(paper_vehicle(), brakes=Brakes(front_share=0.7))
    demand = manoeuvre_from_json(BRAKING).demand(vehicle)
    force = demand.brake.at(3.0) / RADIUS
    assert_allclose(force.sum() + 0.01 * MASS * G, MASS * 4.0, rtol=1e-12)
    assert_allclose(force, (MASS * 4.0 - 0.01 * MASS * G) * np.array([0.35, 0.35, 0.15, 0.15]))
    assert not demand.brake.at(0.99).any()


def test_braking_stops_the_car_within_its_distance():
    """Oracle: v^2/(2 b) after 1 s of coasting; tanh lengthens it by less than v0^2/b."""
    manoeuvre = manoeuvre_from_json(changed("brake.front_share", 0.6, BRAKING))
    motion = motion_of(manoeuvre, paper_vehicle())
    begin = 20.0 - 0.01 * G
    expected = 20.0 - 0.01 * G / 2 + begin**2 / (2 * 4.0)
    assert_allclose(motion.x[-1], expected, rtol=0, atol=0.01)
    assert_allclose(motion.v[motion.time > 1.2 + begin / 4.0], 0.0, atol=0.03)


def test_a_car_without_brakes_needs_a_share_from_the_manoeuvre():
    with pytest.raises(ManoeuvreError, match=r"no brakes; give the vehicle \"brakes\""):
        manoeuvre_from_json(BRAKING).demand(paper_vehicle())
    stated = manoeuvre_from_json(changed("brake.front_share", 0.6, BRAKING))
    front, rear = stated.demand(paper_vehicle()).brake.at(3.0)[[0, 2]]
    assert_allclose(front / (front + rear), 0.6)


def test_braking_for_a_time_ends():
    data = changed("brake.time", 2.0, changed("brake.front_share", 0.6, BRAKING))
    brake = manoeuvre_from_json(data).demand(paper_vehicle()).brake
    assert_allclose(brake.at(2.9), brake.at(1.1))
    assert not brake.at(3.1).any()


def test_constant_speed_is_constant():
    """Oracle: drive torque and rolling resistance cancel up to tanh(20/0.1) = 1."""
    motion = motion_of(reference_manoeuvres()["constant-speed-c"], paper_vehicle())
    assert_allclose(motion.v, 20.0, rtol=1e-9)


@pytest.mark.parametrize("speed", [0.0, 0.05, 0.1, 3.0])
def test_a_held_speed_is_held_however_slow(speed):
    """Oracle: T = r M fr g tanh(v/v0)/n cancels rolling resistance at v, so v stays as it is."""
    slow = replace(reference_manoeuvres()["constant-speed-c"], initial_speed=speed)
    assert_allclose(motion_of(slow, paper_vehicle()).v, speed, rtol=0, atol=1e-9)


def test_a_table_acts_from_its_first_time_on():
    """Oracle: the words of docs/manoeuvres.md, as one-sided values at the first time."""
    drive = {"kind": "table", "time": [2, 3], "torque": [400, 600]}
    brake = {"kind": "table", "time": [4, 5], "torque": [800, 800], "front_share": 0.5}
    demand = manoeuvre_from_json(
        {"name": "t", "kind": "road", "duration": 6, "drive": drive, "brake": brake}
    ).demand(paper_vehicle())
    assert not demand.drive.at([-1.0, 0.0, 1.99]).any()
    assert not demand.drive.at(2.0, "left").any()
    assert_allclose(demand.drive.at([2.0, 2.5, 9.0]).sum(axis=1), [400.0, 500.0, 600.0])
    assert not demand.brake.at([0.0, 3.99]).any()
    assert_allclose(demand.brake.at([4.0, 9.0]).sum(axis=1), 800.0)
    at_once = DriveTable((0.0, 1.0), (400.0, 400.0)).wheel_torque(paper_vehicle(), 0.0, 6.0)
    assert_allclose(at_once.at(0.0, "left").sum(), 400.0)


@pytest.mark.parametrize(
    ("torque", "end"),
    [
        ([0, 400, 0, 0, 0], 3.0),
        ([0, 0, 0, 400, 0], 5.0),
        ([400, 0, 0, 0, 0], 2.0),
        ([0, 400, 0, -400, 0], 5.0),
        ([0, 0, 0, 0, 0], 0.0),
        ([0, 0, 0, 0, 1], None),
    ],
)
def test_a_table_ends_with_its_last_torque(torque, end):
    """Oracle: by eye, the first time from which on the torque is zero."""
    assert DriveTable((1.0, 2.0, 3.0, 4.0, 5.0), tuple(torque)).end() == end


def test_tables_of_torque_are_totals_over_the_wheels():
    drive = {"kind": "table", "time": [1, 2, 2, 3], "torque": [0, 400, 100, 0]}
    brake = {"kind": "table", "time": [4, 5], "torque": [0, 800], "front_share": 0.75}
    demand = manoeuvre_from_json(
        {"name": "t", "kind": "road", "duration": 6, "drive": drive, "brake": brake}
    ).demand(paper_vehicle())
    assert_allclose(demand.drive.at([1.5, 2.0, 9.0]).sum(axis=1), [200.0, 100.0, 0.0])
    assert_allclose(demand.drive.at(1.5), [0, 0, 100, 100])
    assert_allclose(demand.brake.at(5.5), [300, 300, 100, 100])


@pytest.mark.parametrize("signs", [("heave", 1, 1, 1, 1), ("pitch", -1, -1, 1, 1)])
def test_front_and_rear_posts_follow_the_pattern(signs):
    """Oracle: pitch is positive nose down, so the front posts fall while the rear ones rise."""
    check_pattern(*signs)


@pytest.mark.parametrize("signs", [("roll", 1, -1, 1, -1), ("warp", 1, -1, -1, 1)])
def test_left_and_right_posts_follow_the_pattern(signs):
    """Oracle: roll is positive with the left side up."""
    check_pattern(*signs)


def check_pattern(key, *signs):
    heights = reference_manoeuvres()[key].demand(paper_vehicle()).posts.height
    assert np.array_equal(heights, np.outer(heights[:, 0], np.multiply(signs, signs[0])))


@pytest.mark.parametrize(
    ("path", "value", "sentence"),
    [
        ("duraton", 20, r'duraton is not known; did you mean "duration"\?'),
        ("duration", None, "duration is missing; add a number between 0.1 and 600 s"),
        ("duration", "20 s", 'duration is "20 s", but must be a number'),
        ("duration", -1, "duration is -1, but must lie between 0.1 and 600 s"),
        ("duration", float("nan"), "duration is nan, but must lie"),
        ("duration", True, "duration is true, but must be a number"),
        ("kind", "rode", 'kind is "rode", but must be "road" or "posts"'),
        ("seed", 1.5, "seed is 1.5, but must be a whole number"),
        ("seed", 10**400, "seed is a huge number, but must lie"),
        ("drive.kind", "reach-sped", r'drive.kind "reach-sped" is not known; did you mean'),
        ("drive.kind", None, 'drive.kind is missing; use "reach-speed" or "hold-speed"'),
        ("drive.kind", [], "drive.kind a list is not known"),
        ("drive.speed", 150, "drive.speed is 150, but must lie between 0 and 100 m/s"),
        ("drive.ramp", 7, r"drive: ramp \(7 s\) is longer than time \(5 s\); shorten"),
        ("drive", 5, "drive is 5, but must be"),
        ("road.sections", [], "road: sections is empty"),
        ("road.sections.1.class", "J", r'road.sections\[1\].class is "J", but must be "A" or'),
        ("road.sections.1.from", "middle", r"road.sections\[1\].from is \"middle\", but must be"),
        ("road.band", [0.1], "road.band has 1 values, but must have 2"),
        ("road.band", [1.0, 0.5], "road: band must rise"),
        ("road.coherence", "isotropik", 'road.coherence is "isotropik", but must be'),
        ("road.kind", "bumpy", r'did you mean "bump"\?'),
        ("posts", {"pattern": "heave"}, "posts.first_frequency is missing"),
    ],
)
def test_a_wrong_field_is_named_with_the_remedy(path, value, sentence):
    with pytest.raises(ManoeuvreError, match=rf"^m\.json: .*{sentence}"):
        manoeuvre_from_json(changed(path, value), "m.json")


def test_a_manoeuvre_that_is_no_object_is_refused():
    with pytest.raises(ManoeuvreError, match="must be an object"):
        manoeuvre_from_json([1, 2], "m.json")


@pytest.mark.parametrize(
    ("path", "value", "sentence"),
    [
        ("initial_speed", 3, "no drive, brake, road or initial_speed; correct them or the kind"),
        ("posts", None, 'a manoeuvre of kind "posts" has "posts"'),
        ("kind", "road", '"posts" belongs to kind "posts"'),
    ],
)
def test_parts_that_contradict_the_kind_are_refused(path, value, sentence):
    base = manoeuvre_to_json(reference_manoeuvres()["roll"])
    with pytest.raises(ManoeuvreError, match=sentence):
        manoeuvre_from_json(changed(path, value, base))


@pytest.mark.parametrize(
    ("time", "torque", "sentence"),
    [
        ([0, 1], [5], "time has 2 and torque 1 values"),
        ([0], [5], "two at least"),
        ([1, 0], [5, 5], "time must not decrease"),
    ],
)
def test_a_torque_table_out_of_order_is_refused(time, torque, sentence):
    drive = {"kind": "table", "time": time, "torque": torque}
    with pytest.raises(ManoeuvreError, match=f"drive: .*{sentence}"):
        manoeuvre_from_json({"name": "t", "kind": "road", "duration": 5, "drive": drive})


def test_a_section_at_the_end_of_a_torque_that_never_ends_is_refused():
    data = changed("drive", {"kind": "hold-speed"})
    with pytest.raises(Exception, match=r"the drive torque never ends; give its X") as caught:
        manoeuvre_from_json(data).demand(paper_vehicle())
    assert caught.value.code == "road"


def test_a_torque_that_ends_before_the_road_begins_is_refused():
    """The car has moved by centimetres when the torque ends; its front contact is at 1.3 m."""
    brief = changed("drive.time", 0.1, changed("drive.speed", 0.1))
    sentence = (
        r"class C begins where the drive torque ends, at X = 0\.\d+ m, but .* at 1\.30 m; let"
    )
    with pytest.raises(RoadError, match=sentence):
        manoeuvre_from_json(brief).demand(paper_vehicle())


def test_a_negative_seed_is_refused_wherever_it_comes_from():
    with pytest.raises(ManoeuvreError, match="seed is -1; give a whole number from 0 on"):
        replace(reference_manoeuvres()["1"], seed=-1)


def test_a_sweep_that_would_take_too_much_memory_is_refused():
    posts = replace(reference_manoeuvres()["heave"].posts, last_frequency=100.0)
    sweep = replace(reference_manoeuvres()["heave"], duration=600.0, posts=posts)
    with pytest.raises(ManoeuvreError, match=r"up to 100 Hz may last 125 s at most, not 600 s"):
        sweep.demand(paper_vehicle())


def test_a_file_is_named_with_the_line_of_the_mistake(tmp_path):
    path = tmp_path / "mine.json"
    path.write_text('{"name": "x",\n "kind" "road"}')
    with pytest.raises(ManoeuvreError, match=r"mine\.json: line 2, column \d+: not valid JSON"):
        read_manoeuvre(path)
    with pytest.raises(ManoeuvreError, match=r"none\.json.*check the path"):
        read_manoeuvre(tmp_path / "none.json")
    path.write_text(json.dumps(BRAKING))
    assert read_manoeuvre(path).initial_speed == 20.0


def test_the_documented_manoeuvres_are_read_and_driven():
    text = (Path(__file__).parents[2] / "docs" / "manoeuvres.md").read_text("utf-8")
    examples = re.findall(r"```json\n(.*?)```", text, re.DOTALL)
    assert len(examples) == 2
    for example in examples:
        manoeuvre_from_json(json.loads(example)).demand(paper_vehicle())


@pytest.mark.parametrize("key", KEYS)
def test_a_demand_is_the_same_whatever_the_suspension(key):
    """A tuned car is asked for what it was asked for before, and nothing is made anew."""
    car, manoeuvre = paper_vehicle(), reference_manoeuvres()[key]
    car = replace(car, brakes=Brakes(front_share=0.65))
    tuned = car.with_values({name: 1.1 * car.value(name) for name in PARAMETER_NAMES})
    assert manoeuvre.demand(tuned) is manoeuvre.demand(car)


def test_a_demand_follows_every_other_number_of_the_car():
    """Oracle: T = r M (a + fr g) / n on each driven wheel; the road begins at the front contact."""
    car, manoeuvre = paper_vehicle(), reference_manoeuvres()["2"]
    full = manoeuvre.demand(car).drive.values.max()
    heavy = car.with_values({"chassis.mass": car.chassis.mass + car.total_mass})
    assert manoeuvre.demand(heavy).drive.values.max() == pytest.approx(2.0 * full)
    large = car.with_values({"rear.wheel.radius": 2.0 * car.rear.wheel.radius})
    assert manoeuvre.demand(large).drive.values.max() == pytest.approx(2.0 * full)
    both = replace(car, front=replace(car.front, driven=True))
    assert manoeuvre.demand(both).drive.values.max() == pytest.approx(0.5 * full)
    long = car.with_values({"front.cg_distance": 1.8})
    assert manoeuvre.demand(long).road.start == pytest.approx(
        manoeuvre.demand(car).road.start + 0.5
    )
    assert manoeuvre.demand(car).drive.values.max() == full
