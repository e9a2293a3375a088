"""The damper with two slopes and a knee. Its accelerations are in test_dynamics_oracle.py."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ridetune.engine.errors import SimulationError
from ridetune.engine.frames import CORNERS
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.simulation.car_rows import car_row, car_rows
from ridetune.engine.simulation.rims import prepare
from ridetune.engine.simulation.simulate import rims_batch, simulate_posts, simulate_road
from ridetune.engine.simulation.stability import (
    check_free_step,
    is_stable,
    rims_eigenvalues,
    road_eigenvalues,
)

from ..factories import DAMPERS, paper_vehicle, random_vehicle, with_random_dampers


@pytest.fixture(scope="module")
def bent():
    """The paper's car with dampers as road cars have them."""
    return paper_vehicle().with_values(DAMPERS)


@pytest.fixture(scope="module")
def ride(bent):
    """Its run through Manoeuvre 2."""
    return simulate_road(bent, reference_manoeuvres()["2"]).run


def damper_of(run, corner):
    """Jounce rate and damper force of a corner over a run."""
    rate = np.gradient(run[f"suspension.{corner}.travel"], run.time)
    return rate, run[f"suspension.{corner}.damper_force"]


def test_the_damper_only_takes_energy_out(ride):
    """Oracle: force and jounce rate have one sign; the rate by differences is wrong by less than
    its own step where it changes sign."""
    for corner in CORNERS:
        rate, force = damper_of(ride, corner)
        lively = np.abs(rate) > 0.02
        assert lively.sum() > 100
        assert np.all(force[lively] * rate[lively] > 0.0)


def test_the_force_halves_at_the_knee_and_its_slopes_have_the_ratio(bent, ride):
    """Oracle: the law, F = C_j j / (1 + |j| / v), C_r = rho C_j, mean C, on smooth parts."""
    suspension = bent.rear.suspension
    rate, force = damper_of(ride, "rl")
    slopes = 2.0 * suspension.damping / 3.0 * np.where(rate > 0.0, 1.0, 2.0)
    expected = slopes * rate / (1.0 + np.abs(rate) / suspension.knee_speed)
    error = np.abs(force - expected)
    assert np.percentile(error, 90) < 0.02 * np.abs(expected).max()


def test_without_ratio_and_knee_the_damper_is_the_paper_s_to_the_last_bit():
    """Oracle: equality of the rows, so of all that follows; a knee far away is no knee."""
    car = paper_vehicle()
    same = car.with_values({"front.suspension.rebound_ratio": 1.0})
    assert_array_equal(car_row(same), car_row(car))
    demand = reference_manoeuvres()["bump"]
    far = car.with_values({f"{axle}.suspension.knee_speed": 100.0 for axle in ("front", "rear")})
    one, other = (simulate_road(each, demand).run["chassis.z"] for each in (car, far))
    assert_allclose(other, one, rtol=0, atol=0.02 * np.ptp(one))


def test_dampers_leave_a_car_at_rest_where_it_stands(bent):
    """Oracle: statics, the same car with linear dampers."""
    heave = reference_manoeuvres()["heave"]
    one, other = (simulate_posts(each, heave).run for each in (paper_vehicle(), bent))
    for corner in CORNERS:
        name = f"tyre.{corner}.load"
        assert one[name][0] == pytest.approx(other[name][0], abs=1e-9)


def test_cars_in_a_batch_move_as_alone(ride):
    """Oracle: the cars one by one."""
    rng = np.random.default_rng(7)
    cars = [with_random_dampers(random_vehicle(rng, offsets=False), rng) for _ in range(9)]
    inputs = prepare(ride, paper_vehicle())
    rows = np.stack([car_row(car) for car in cars])
    alone = np.concatenate([rims_batch(row[np.newaxis], inputs, "exact") for row in rows])
    assert_allclose(rims_batch(rows, inputs, "exact"), alone, rtol=0, atol=1e-10)


def test_many_cars_have_the_rows_of_each_alone():
    """Oracle: the cars one by one."""
    car, names = paper_vehicle(), list(DAMPERS)
    values = np.array([list(DAMPERS.values())]) * np.array([[0.5], [1.0], [1.5]])
    alone = [car_row(car.with_values(dict(zip(names, row, strict=True)))) for row in values]
    assert_allclose(car_rows(car, names, values), alone, rtol=1e-15)


def test_a_step_is_bounded_by_the_steeper_slope():
    """Oracle: the linear car with that slope."""
    car = paper_vehicle()
    bent = car.with_values(DAMPERS)
    steep = {
        f"{name}.suspension.damping": max(bent.axle(name).suspension.slopes)
        for name in ("front", "rear")
    }
    still = np.zeros(4)
    one, other = (car_row(each)[np.newaxis] for each in (bent, car.with_values(steep)))
    assert_allclose(road_eigenvalues(one, still), road_eigenvalues(other, still))
    assert_allclose(rims_eigenvalues(one), rims_eigenvalues(other))
    stiff = replace(car, front=replace(car.front, suspension=replace(
        car.front.suspension, damping=2e4, rebound_ratio=9.0)))  # fmt: skip
    assert is_stable(0.0025, road_eigenvalues(car_row(car)[np.newaxis], still)).all()
    with pytest.raises(SimulationError, match="too long"):
        check_free_step(car_row(stiff), still, 0.0025)


def test_the_seven_dof_model_says_that_it_is_linear(bent):
    """Oracle: the same car with linear dampers moves alike, and without a word."""
    bump = reference_manoeuvres()["bump"]
    one, other = (simulate_road(each, bump, model="7dof") for each in (paper_vehicle(), bent))
    assert_array_equal(one.run["chassis.z"], other.run["chassis.z"])
    assert not one.warnings
    assert "front and rear suspension.damping counts" in other.warnings[0]
