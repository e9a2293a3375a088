"""The engine's accelerations against an independent multibody program, equation by equation.

Oracle: MuJoCo's mass matrix and bias of the same tree with forces written out by hand, see
tests/oracles. Both sides are exact, so the tolerance is round-off: 1e-12 of the largest
acceleration of the state.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ...factories import (
    mirrored,
    mirrored_coordinates,
    paper_vehicle,
    random_rims_state,
    random_road_state,
    random_vehicle,
    with_random_dampers,
)
from ...oracles.mujoco_car import MujocoCar
from ...single_state import accelerations, rims_accelerations

ROUND_OFF = 1e-12
STILL = {name: np.zeros(4) for name in ("road_height", "road_rate", "drive", "brake")}


def within_round_off(actual, expected):
    assert_allclose(actual, expected, rtol=0, atol=ROUND_OFF * np.abs(expected).max())


@pytest.mark.parametrize("lift_off", [False, True])
@pytest.mark.parametrize("seed", range(100))
def test_direct_accelerations_are_those_of_the_multibody_program(seed, lift_off):
    rng = np.random.default_rng([1, seed])
    vehicle = random_vehicle(rng)
    state = random_road_state(rng, vehicle)
    expected = MujocoCar(vehicle).accelerations(
        state.q, state.qd, **state.inputs, lift_off=lift_off
    )
    within_round_off(
        accelerations(vehicle, state.q, state.qd, **state.inputs, lift_off=lift_off), expected
    )


@pytest.mark.parametrize("seed", range(30))
def test_direct_accelerations_hold_far_outside_small_angles(seed):
    """Angles to 0.8 rad: half-way to where a simulation is given up as diverged."""
    rng = np.random.default_rng([1, seed])
    vehicle = random_vehicle(rng)
    state = random_road_state(rng, vehicle)
    q = np.concatenate([state.q[:2], rng.uniform(-0.8, 0.8, 6)])
    expected = MujocoCar(vehicle).accelerations(q, state.qd, **state.inputs)
    within_round_off(accelerations(vehicle, q, state.qd, **state.inputs), expected)


def test_random_states_have_wheels_on_and_off_the_ground():
    """Guards the comparison above: without negative loads `lift_off` would change nothing."""
    lifted = []
    for seed in range(100):
        rng = np.random.default_rng([1, seed])
        vehicle = random_vehicle(rng)
        state, car = random_road_state(rng, vehicle), MujocoCar(vehicle)
        car.place(state.q, state.qd)
        road = state.inputs["road_height"], state.inputs["road_rate"]
        lifted.append(car.tyre_loads(state.q, state.qd, *road) < 0)
    assert 0.2 < np.mean(lifted) < 0.8


@pytest.mark.parametrize("traction", ["exact", "paper"])
@pytest.mark.parametrize("seed", range(100))
def test_rims_accelerations_are_those_of_the_multibody_program(seed, traction):
    rng = np.random.default_rng([2, seed])
    vehicle = random_vehicle(rng)
    state = random_rims_state(rng, vehicle)
    qdd, vertical, longitudinal = MujocoCar(vehicle).rims_accelerations(
        *state.arguments, traction=traction
    )
    found = rims_accelerations(vehicle, *state.arguments, traction=traction)
    within_round_off(found["qdd"], qdd)
    within_round_off(found["vertical_force"], vertical)
    within_round_off(found["longitudinal_force"], longitudinal)


@pytest.mark.parametrize("seed", range(20))
def test_direct_accelerations_mirror_left_and_right(seed):
    rng = np.random.default_rng([3, seed])
    vehicle = random_vehicle(rng)
    state = random_road_state(rng, vehicle)
    other = state.mirror()
    within_round_off(
        mirrored_coordinates(accelerations(vehicle, other.q, other.qd, **other.inputs)),
        accelerations(vehicle, state.q, state.qd, **state.inputs),
    )


@pytest.mark.parametrize("traction", ["exact", "paper"])
@pytest.mark.parametrize("seed", range(20))
def test_rims_accelerations_mirror_left_and_right(seed, traction):
    rng = np.random.default_rng([4, seed])
    vehicle = random_vehicle(rng)
    state = random_rims_state(rng, vehicle)
    here = rims_accelerations(vehicle, *state.arguments, traction=traction)
    there = rims_accelerations(vehicle, *state.mirror().arguments, traction=traction)
    within_round_off(mirrored_coordinates(there["qdd"]), here["qdd"])
    within_round_off(mirrored(there["vertical_force"]), here["vertical_force"])
    within_round_off(mirrored(there["longitudinal_force"]), here["longitudinal_force"])


@pytest.mark.parametrize("seed", range(40))
def test_two_slope_dampers_are_those_of_the_multibody_program_in_both_modes(seed):
    """Oracle: the law written out by hand; and the mirror, where left and right change places."""
    rng = np.random.default_rng([6, seed])
    vehicle = with_random_dampers(random_vehicle(rng), rng)
    road, rims = random_road_state(rng, vehicle), random_rims_state(rng, vehicle)
    car = MujocoCar(vehicle)
    free = accelerations(vehicle, road.q, road.qd, **road.inputs)
    within_round_off(free, car.accelerations(road.q, road.qd, **road.inputs))
    other = road.mirror()
    there = accelerations(vehicle, other.q, other.qd, **other.inputs)
    within_round_off(mirrored_coordinates(there), free)
    expected, *_ = car.rims_accelerations(*rims.arguments)
    within_round_off(rims_accelerations(vehicle, *rims.arguments)["qdd"], expected)


def cars_at_rest():
    rng = np.random.default_rng(5)
    return [paper_vehicle(), *(random_vehicle(rng) for _ in range(20))]


def test_a_car_at_rest_on_flat_ground_stays_at_rest():
    for vehicle in cars_at_rest():
        qdd = accelerations(vehicle, np.zeros(8), np.zeros(8), **STILL)
        assert_allclose(qdd, 0, rtol=0, atol=1e-10)


@pytest.mark.parametrize("traction", ["exact", "paper"])
def test_a_car_whose_wheels_are_held_stays_at_rest_on_its_static_loads(traction):
    """Oracle: statics. The wheel centres carry the tyre loads of the car at rest."""
    still = np.zeros(3), np.zeros(3), 0.0, np.zeros(4), np.zeros(4), np.zeros(4), 0.0
    for vehicle in cars_at_rest():
        found = rims_accelerations(vehicle, *still, traction=traction)
        assert_allclose(found["qdd"], 0, rtol=0, atol=1e-10)
        loads = [corner.tyre_load for corner in MujocoCar(vehicle).corners]
        assert_allclose(found["vertical_force"], loads, rtol=1e-12)
        assert_allclose(found["longitudinal_force"], 0, rtol=0, atol=1e-9)
