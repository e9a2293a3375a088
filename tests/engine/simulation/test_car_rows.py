from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.errors import ParameterError, VehicleError
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.simulation.car_rows import car_row, car_rows
from ridetune.engine.vehicle import numbers

from ...factories import paper_vehicle, random_vehicle

EVERY_NUMBER = list(numbers())


def one_by_one(vehicle, names, values, **options):
    """Rows of cars made and checked one at a time, not a number where a car is refused."""
    rows = []
    for row in values:
        try:
            car = vehicle.with_values(dict(zip(names, row, strict=True)))
            rows.append(car_row(car, **options))
        except VehicleError:
            rows.append(np.full_like(car_row(vehicle), np.nan))
    return np.array(rows)


@pytest.mark.parametrize("names", [list(PARAMETER_NAMES), EVERY_NUMBER])
def test_rows_of_many_cars_are_those_of_each_alone(names):
    """Oracle: the cars one by one; numpy's tangent of an array may round differently."""
    rng = np.random.default_rng(1)
    for lift_off in (False, True):
        vehicle = random_vehicle(rng, braked=True).with_values(
            {"front.suspension.knee_speed": 0.5, "rear.suspension.knee_speed": 0.8}
        )
        start = np.array([vehicle.value(name) for name in names])
        values = start * rng.uniform(0.7, 1.4, (200, len(names)))
        expected = one_by_one(vehicle, names, values, lift_off=lift_off)
        assert np.isfinite(expected).all(axis=1).sum() > 20
        found = car_rows(vehicle, names, values, lift_off)
        assert_allclose(found, expected, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(
    ("name", "fine", "wrong"),
    [
        ("chassis.mass", 1000.0, 1.0),
        ("front.pivot.distance", -0.5, 0.05),
        ("front.pivot.angle", 0.5, 1.49),
        ("chassis.inertia.xx", 400.0, 4000.0),
        ("chassis.inertia.xz", 50.0, 900.0),
        ("rear.wheel.inertia.xx", 1.0, 9.0),
        ("front.wheel.mass", 40.0, 9e4),
        ("rear.cg_distance", 1.3, np.nan),
    ],
)
def test_a_car_that_would_be_refused_alone_is_not_a_number_and_spoils_no_other(name, fine, wrong):
    """Oracle: the refusal of the car by itself."""
    car = paper_vehicle()
    outwards = replace(car.front.wheel, cg_offset=(-0.05, 0.0, 0.0))
    vehicle = replace(car, front=replace(car.front, wheel=outwards))
    with pytest.raises(VehicleError):
        car_row(vehicle.with_values({name: wrong}))
    found = car_rows(vehicle, [name], np.array([[wrong], [fine]]))
    assert np.all(np.isnan(found[0]))
    assert_allclose(found[1], car_row(vehicle.with_values({name: fine})), rtol=1e-13)


def test_a_path_that_leads_to_no_number_is_refused():
    with pytest.raises(ParameterError, match=r"did you mean front\.pivot\.angle"):
        car_rows(paper_vehicle(), ["front.pivot.angel"], np.ones((1, 1)))
    with pytest.raises(ParameterError, match="has no brakes"):
        car_rows(paper_vehicle(), ["brakes.front_share"], np.ones((1, 1)))
