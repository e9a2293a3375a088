"""Oracles: balance of forces and moments, written for single bodies, and model.md's formulas."""

from dataclasses import replace

import pytest
from ridetune.engine.equilibrium import static_loads
from ridetune.engine.errors import VehicleError
from ridetune.engine.frames import AXLES, CORNERS, GRAVITY
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_from_json, vehicle_to_json

ROUNDING = 1e-9
"""N or N m; the car's weight is 1e4 N, so this is 1e-13 of it."""


def cars():
    """The reference cars, and one whose corners have their CG off the wheel centre."""
    paper = reference_vehicles()["paper"]
    offset = replace(
        paper,
        front=replace(paper.front, wheel=replace(paper.front.wheel, cg_offset=(0.2, 0.05, 0.1))),
        rear=replace(paper.rear, wheel=replace(paper.rear.wheel, cg_offset=(-0.1, 0.0, 0.0))),
    )
    outside = offset.with_values({"front.pivot.distance": -0.7})
    return [*reference_vehicles().values(), offset, outside]


@pytest.fixture(params=cars(), ids=lambda car: car.name)
def car(request):
    return request.param


def test_without_an_offset_each_spring_carries_the_sprung_mass_by_the_lever_rule():
    car = reference_vehicles()["ford-escort"]
    loads = static_loads(car)
    weight = car.chassis.mass * GRAVITY
    front = weight * car.rear.cg_distance / (2 * car.wheelbase)
    rear = weight * car.front.cg_distance / (2 * car.wheelbase)
    for corner, preload in zip(CORNERS, (front, front, rear, rear), strict=True):
        own = car.axle_at(corner).wheel.mass * GRAVITY
        assert loads.preload[corner] == pytest.approx(preload, abs=ROUNDING)
        assert loads.tyre_load[corner] == pytest.approx(preload + own, abs=ROUNDING)


def test_the_tyres_carry_the_whole_car(car):
    loads = static_loads(car)
    weight = car.total_mass * GRAVITY
    assert sum(loads.tyre_load.values()) == pytest.approx(weight, abs=ROUNDING)
    assert sum(loads.axle_load.values()) == pytest.approx(weight, abs=ROUNDING)


def test_left_and_right_carry_the_same(car):
    loads = static_loads(car)
    for values in (loads.tyre_load, loads.preload):
        assert values["fl"] == values["fr"]
        assert values["rl"] == values["rr"]


def corner_positions(car, name):
    """X of wheel centre, pivot and CG of an axle's corners from the sprung mass's CG, m."""
    axle, ahead = car.axle(name), 1.0 if name == "front" else -1.0
    centre = ahead * axle.cg_distance
    return centre, centre - ahead * axle.pivot.distance, centre - ahead * axle.wheel.cg_offset[0]


def test_the_whole_car_does_not_tip(car):
    loads, moment = static_loads(car), 0.0
    for name in AXLES:
        centre, _, cg = corner_positions(car, name)
        moment += loads.axle_load[name] * centre
        moment -= 2 * car.axle(name).wheel.mass * GRAVITY * cg
    assert moment == pytest.approx(0.0, abs=ROUNDING)


@pytest.mark.parametrize(("name", "corner"), [("front", "fl"), ("rear", "rr")])
def test_an_arm_does_not_turn_about_its_pivot(car, name, corner):
    loads = static_loads(car)
    centre, pivot, cg = corner_positions(car, name)
    own = car.axle(name).wheel.mass * GRAVITY
    lift = loads.tyre_load[corner] - loads.preload[corner]
    assert lift * (centre - pivot) == pytest.approx(own * (cg - pivot), abs=ROUNDING)


def test_springs_and_pivots_carry_the_sprung_mass(car):
    """The pivot gets what an arm's tyre, spring and weight leave over."""
    loads, force, moment = static_loads(car), 0.0, 0.0
    for corner in CORNERS:
        name = "front" if corner[0] == "f" else "rear"
        centre, pivot, _ = corner_positions(car, name)
        spring = loads.preload[corner]
        hinge = loads.tyre_load[corner] - spring - car.axle(name).wheel.mass * GRAVITY
        force += spring + hinge
        moment += spring * centre + hinge * pivot
    assert force == pytest.approx(car.chassis.mass * GRAVITY, abs=ROUNDING)
    assert moment == pytest.approx(0.0, abs=ROUNDING)


def with_front_offset(data, offset, distance):
    data["front"]["wheel"]["cg_offset"] = [offset, 0.0, 0.0]
    data["front"]["pivot"]["distance"] = distance
    return data


@pytest.mark.parametrize(("offset", "distance", "stands"), [(-1.0, 0.1, False), (-1.0, 1.0, True)])
def test_a_car_whose_springs_would_have_to_pull_is_refused(offset, distance, stands):
    """Oracle: moments about the pivot, F0 d = W0 d - m g (d - c), with the whole car's W0.

    36 kg hang 1 m ahead of the wheel: their moment 353 N (d + 1 m) against W0 d, W0 = 3.2 kN.
    """
    data = with_front_offset(
        vehicle_to_json(reference_vehicles()["paper"]), offset=offset, distance=distance
    )
    wheelbase, weight = 2.66, 36.0 * GRAVITY
    load = (1090.0 * GRAVITY * 1.36 + 2 * weight * (wheelbase - offset)) / (2 * wheelbase)
    spring = load - weight * (1.0 - offset / distance)
    assert (spring > 0.0) is stands
    if stands:
        loads = static_loads(vehicle_from_json(data))
        assert loads.preload["fl"] == pytest.approx(spring, rel=1e-9)
    else:
        sentence = rf"^v\.json: At rest each front spring would have to pull with {-spring:.4g} N"
        with pytest.raises(VehicleError, match=sentence):
            vehicle_from_json(data, "v.json")


def test_a_car_that_would_tip_at_rest_is_refused():
    """Oracle: the lever rule; the rear axle so near the CG that offsets take its load away."""
    data = vehicle_to_json(reference_vehicles()["paper"])
    data["front"]["cg_distance"], data["front"]["wheel"]["cg_offset"] = 0.05, [-1.0, 0.0, 0.0]
    data["front"]["wheel"]["mass"] = 200.0
    with pytest.raises(VehicleError, match=r"rear wheels would have to pull on the ground"):
        vehicle_from_json(data)
