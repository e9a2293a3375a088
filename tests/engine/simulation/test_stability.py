"""RK4's limit of stability, and the refusal of steps beyond it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.demand import Demand, PiecewiseLinear
from ridetune.engine.errors import SimulationError
from ridetune.engine.frames import CORNERS
from ridetune.engine.identification.problem import Problem
from ridetune.engine.identification.residuals import Residuals
from ridetune.engine.manoeuvre import manoeuvre_from_json, reference_manoeuvres
from ridetune.engine.run import Run
from ridetune.engine.simulation.car_rows import car_row
from ridetune.engine.simulation.integration import free_states, rims_states
from ridetune.engine.simulation.rims import prepare
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import (
    rims_batch,
    simulate_posts,
    simulate_rims,
    simulate_road,
)
from ridetune.engine.simulation.stability import (
    HALF_DISC,
    MARGIN,
    check_free_step,
    check_rims_step,
    eigenvalues,
    largest_stable_step,
    road_eigenvalues,
    stable_on_rims,
    stable_on_road,
)
from ridetune.engine.simulation.step_bound import fastest_on_road
from ridetune.engine.simulation.stepping import prepare_free
from ridetune.engine.vehicle_file import reference_vehicles

from ...factories import paper_vehicle, random_vehicle

STIFF = {"front.suspension.damping": 2e5}


@pytest.mark.parametrize(
    ("value", "limit"),
    [(-1000.0, 2.7852936e-3), (100j, 2.8284271e-2), (-1e-9 + 50j, 2.0**1.5 / 50.0)],
)
def test_the_limits_on_the_axes_are_those_of_the_textbooks(value, limit):
    """Oracle: Hairer and Wanner, the real root of R(z) = 1, and 2 sqrt(2)."""
    assert_allclose(largest_stable_step(np.array([value, np.conj(value)])), limit, rtol=5e-4)


@pytest.mark.parametrize("angle", [100.0, 120.0, 150.0, 170.0])
def test_the_limit_between_the_axes_is_where_steps_begin_to_grow(angle):
    """Oracle: RK4 steps of y' = s y, taken one by one."""
    s = 40.0 * np.exp(1j * np.radians(angle))
    limit = largest_stable_step(np.array([s, np.conj(s)]))

    def after(h):
        y = 1.0 + 0.0j
        for _ in range(4000):
            k1 = s * y
            k2 = s * (y + 0.5 * h * k1)
            k3 = s * (y + 0.5 * h * k2)
            k4 = s * (y + h * k3)
            y += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return abs(y)

    assert after(0.998 * limit) < 1.0
    assert after(1.002 * limit) > 1.0


def test_the_eigenvalues_are_those_of_an_oscillator():
    """Oracle: s^2 + 2 D w s + w^2 = 0; and a motion without any force does not count."""

    def oscillator(q, rates):
        return np.column_stack([-(50.0**2) * q[:, 0] - 2 * 0.2 * 50.0 * rates[:, 0], 0 * q[:, 1]])

    found = eigenvalues(oscillator, 2)
    expected = -10.0 + 50.0j * np.sqrt(1 - 0.2**2)
    assert np.abs(found - expected).min() < 1e-5
    assert_allclose(np.sort(np.abs(found)), [0, 0, 50, 50], atol=1e-5)
    assert np.isfinite(largest_stable_step(found))


def test_cars_stay_at_rest_below_the_limit_and_not_above_it():
    """Oracle: the integrator itself, from a start beside equilibrium.

    A stiff damper's motion dies out with a step just below the stated one, and grows beyond any
    bound with a step that exceeds the linear limit by a tenth.
    """
    car = paper_vehicle().with_values(STIFF)
    row = car_row(car)
    with pytest.raises(SimulationError, match=r"at most (\S+) ms") as caught:
        check_free_step(row, np.zeros(4), 0.02)
    stated = 1e-3 * float(str(caught.value).split("at most ")[1].split()[0])

    def states(step):
        still = PiecewiseLinear.zero(1.0)
        jerk = PiecewiseLinear(
            np.array([0.0, 0.1, 0.1, 1.0]), np.outer([9.0, 9.0, 0.0, 0.0], [0, 0, 1, 1])
        )
        inputs = prepare_free(Demand(1.0, 0.0, jerk, still, None), step, 4 * step)
        return free_states(row[np.newaxis], inputs)

    assert np.abs(states(stated).values[0, -1, 1:8]).max() < 0.01
    above = states(1.1 * stated / MARGIN)
    assert above.failed[0] > 0


@pytest.mark.parametrize("key", list(reference_vehicles()))
def test_every_reference_car_takes_the_longest_accepted_step_of_the_page(key):
    """Oracle: wheel hop of 8 to 15 Hz allows 2.8/95 = 30 ms."""
    check_free_step(car_row(reference_vehicles()[key]), np.zeros(4), 0.02)


def test_a_step_too_long_is_refused_in_every_mode_with_the_longest_one():
    car = paper_vehicle().with_values(STIFF)
    bump, heave = reference_manoeuvres()["bump"], reference_manoeuvres()["heave"]
    sentence = r"step of 2.5 ms is too long for this car, .* take a step of at most 0\.\d+ ms, or"
    for simulate, manoeuvre in ((simulate_road, bump), (simulate_posts, heave)):
        with pytest.raises(SimulationError, match=sentence):
            simulate(car, replace(manoeuvre, duration=2.0), sample_step=0.01)
    simulate_road(car, replace(bump, duration=0.2), step=2e-4)

    time = np.linspace(0.0, 1.0, 201)
    channels = {f"wheel.{corner}.z": 0.0 * time for corner in CORNERS}
    run = Run("still", time, channels | {"chassis.a_x": 0.0 * time})
    with pytest.raises(SimulationError, match=r"step of 5 ms is too long .* at most \d\.\d+ ms"):
        simulate_rims(car, run)
    simulate_rims(car, run, settings=RimsSettings(step=0.001))


def test_many_cars_at_once_are_judged_like_each_alone():
    """Oracle: the refusal of one car, found by walking along each eigenvalue's ray."""
    rng = np.random.default_rng(7)
    dampings = 10.0 ** rng.uniform(3.0, 5.5, 40)
    cars = rows(*(random_vehicle(rng).with_values({next(iter(STIFF)): c}) for c in dampings))
    for step in (0.002, 0.005, 0.02):
        refused = []
        for car in cars:
            try:
                check_rims_step(car, step)
            except SimulationError as error:
                longest = float(str(error).split("at most ")[1].split()[0])
                assert longest < 1e3 * step
                assert stable_on_rims(car[np.newaxis], 1e-3 * longest).all()
                refused.append(True)
            else:
                refused.append(False)
        assert list(~stable_on_rims(cars, step)) == refused
        assert 0 < sum(refused) < len(refused)


def rows(*cars):
    return np.stack([car_row(car) for car in cars])


def lively(rng, count):
    """Random cars, one in two braking, some with dampers and tyres of a lorry."""
    names = ["front.suspension.damping", "rear.tyre.stiffness"]
    cars, brakes = [], []
    for _ in range(count):
        numbers = 10.0 ** rng.uniform([2.5, 5.0], [5.5, 7.0])
        cars.append(random_vehicle(rng).with_values(dict(zip(names, numbers, strict=True))))
        brakes.append(np.repeat(10.0 ** rng.uniform(0.0, 4.5, 2), 2) * (rng.random() < 0.5))
    return rows(*cars), np.array(brakes)


def test_no_motion_of_a_car_on_a_road_is_faster_than_its_bound():
    """Oracle: eigenvalues of the equations of motion, differences of which err by 1e-6."""
    cars, brakes = lively(np.random.default_rng(3), 300)
    fastest = np.abs(road_eigenvalues(cars, brakes)).max(axis=1)
    share = fastest / fastest_on_road(cars, brakes)
    assert share.max() < 1.0 + 1e-6
    assert np.median(share) > 0.3


@pytest.mark.parametrize("angle", np.linspace(90.0, 180.0, 91))
def test_the_half_disc_is_stable(angle):
    """Oracle: the four stages of a Runge-Kutta step of y' = z y, written out."""
    z = HALF_DISC * np.exp(1j * np.radians(angle))
    k1 = z
    k2 = z * (1.0 + 0.5 * k1)
    k3 = z * (1.0 + 0.5 * k2)
    k4 = z * (1.0 + k3)
    assert abs(1.0 + (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0) <= 1.0 + 1e-12


def test_many_cars_on_a_road_are_judged_like_each_alone():
    """Oracle: the walk along the ray of each eigenvalue of each car."""
    cars, brakes = lively(np.random.default_rng(4), 120)
    for step in (0.0005, 0.002, 0.01):
        expected = [
            MARGIN * largest_stable_step(values) > step for values in road_eigenvalues(cars, brakes)
        ]
        assert list(stable_on_road(cars, brakes, step)) == expected
        assert 0 < sum(expected) < len(expected)


def test_an_impossible_car_takes_no_step():
    possible = rows(paper_vehicle())
    cars = np.vstack([np.full_like(possible, np.nan), possible])
    assert list(stable_on_road(cars, np.zeros(4), 0.002)) == [False, True]
    assert list(stable_on_rims(cars, 0.005)) == [False, True]
    assert list(stable_on_rims(cars[:1], 0.005)) == [False]


def ride(car):
    """A recording of the car itself over a bump."""
    return simulate_road(car, replace(reference_manoeuvres()["bump"], duration=3.0)).run


def test_an_unstable_car_of_a_batch_fails_and_spoils_no_other():
    """Oracle: the stable car by itself. The other one is so near to the limit that three seconds do
    not carry it off: the integrator alone would take it for a car."""
    car = paper_vehicle()
    inputs, stiff = prepare(ride(car), car), car.with_values({next(iter(STIFF)): 1.35e5})
    assert rims_states(rows(stiff), inputs, True).failed[0] < 0
    found = rims_batch(rows(stiff, car), inputs, "exact")
    assert np.all(np.isnan(found[0]))
    assert_allclose(found[1], rims_batch(rows(car), inputs, "exact")[0], rtol=0, atol=1e-12)
    assert np.all(np.isnan(rims_batch(rows(stiff), inputs, "exact")))


def test_a_fit_is_refused_an_unstable_start_and_counts_an_unstable_trial_as_failed():
    car = paper_vehicle()
    run, name = ride(car), "front.suspension.damping"
    bounds = {name: (500.0, 3e5)}
    with pytest.raises(SimulationError, match=r"step of 5 ms is too long .* at most \d\.\d+ ms"):
        Residuals(Problem.build(car, [run], [name], bounds=bounds, start=STIFF), rims_batch)
    shorter = RimsSettings(step=0.001)
    asked = Problem.build(car, [run], [name], bounds=bounds, start=STIFF, settings=shorter)
    assert np.isfinite(Residuals(asked, rims_batch).costs([np.zeros(1)])[0])

    residuals = Residuals(Problem.build(car, [run], [name], bounds=bounds), rims_batch)
    costs = residuals.costs([np.zeros(1), residuals.upper])
    assert list(np.isfinite(costs)) == [True, False]


def test_brakes_near_standstill_bound_the_step():
    """Oracle: near v = 0 they are a damper of sum B/(r M v0): 4 * 15 kN m give 1.6e3 1/s."""
    data = {"kind": "table", "time": [0, 1], "torque": [6e4, 6e4], "front_share": 0.5}
    stop = manoeuvre_from_json({"name": "t", "kind": "road", "duration": 1, "brake": data})
    with pytest.raises(SimulationError, match=r"changes at 1\.6\d?e\+03 1/s"):
        simulate_road(paper_vehicle(), stop)
