"""What the engine reports beside the motion, against the independent multibody program.

Oracle: Newton's law for each arm and rigid-body accelerations on MuJoCo's tree, see tests/oracles.
The tolerance is round-off of the largest force or acceleration.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.app.bench.car_points import CORNERS
from ridetune.engine.roads.road import Road
from ridetune.engine.simulation.car_rows import car_row
from ridetune.engine.simulation.integration import free_outputs, rims_outputs
from ridetune.engine.simulation.output_channels import common_channels

from ...factories import random_rims_state, random_road_state, random_vehicle
from ...oracles.car_tree import about_x, about_y
from ...oracles.mujoco_car import MujocoCar
from ...single_state import rims_accelerations

SEAT = (-0.3, 0.4, 0.2)


def road_channels(vehicle, state):
    """Channels of one state of the direct mode."""
    order = ("road_height", "road_rate", "drive", "brake")
    inputs = np.concatenate([state.inputs[name] for name in order])[np.newaxis]
    states = np.concatenate([state.q, state.qd])[np.newaxis]
    outputs = free_outputs(car_row(vehicle, False), states, inputs, Road.flat())
    channels = common_channels(states, outputs, {"seat": SEAT})
    return {name: values[0] for name, values in channels.items()}


def rims_channels(vehicle, state, q, qd):
    """Channels of one state of the rims mode."""
    inputs = [*state.u, *state.u_rate, *state.u_acc, state.a_x, state.v, state.braking]
    states = np.concatenate([q, qd])[np.newaxis]
    outputs = rims_outputs(car_row(vehicle), states, np.array([inputs]), True)
    channels = common_channels(states, outputs, {"seat": SEAT})
    return {name: values[0] for name, values in channels.items()}


def assert_channels(channels, car, q, qd, qdd, on_tyres):
    """Compare every channel that is not itself a coordinate or rate."""
    car.place(q, qd)
    R = about_y(q[2]) @ about_x(q[3])
    forces, expected_forces = [], []
    for i, (name, corner) in enumerate(zip(CORNERS, car.corners, strict=True)):
        length, on_mount, damper = car.spring_and_damper(q, qd, i)
        suspension = corner.axle.suspension
        travel = suspension.mount_height - length
        rise = car.wheel_centre(q, i)[2] - corner.axle.wheel.radius
        assert channels[f"suspension.{name}.travel"] == pytest.approx(travel, abs=1e-14)
        assert channels[f"wheel.{name}.z"] == pytest.approx(rise, abs=1e-14)
        assert channels[f"arm.{name}.angle"] == pytest.approx(q[4 + i], abs=1e-14)
        on_pivot = car.pivot_force(q, qd, qdd, i, on_tyres[i])
        mount_B, pivot_B = R.T @ on_mount, R.T @ on_pivot
        expected_forces += [corner.preload + suspension.stiffness * travel, damper]
        expected_forces += [*mount_B[[0, 2]], *pivot_B[[0, 2]], on_tyres[i][2]]
        forces += [channels[f"suspension.{name}.{part}_force"] for part in ("spring", "damper")]
        forces += [channels[f"{at}.{name}.force_{k}"] for at in ("mount", "pivot") for k in "xz"]
        forces += [channels[f"tyre.{name}.load"]]
    assert_allclose(forces, expected_forces, rtol=0, atol=1e-12 * np.abs(expected_forces).max())

    bars = [car.corners[i].axle.stabilizer_bar for i in (0, 2)]
    torques = [
        bar.stiffness * (q[left] - q[left + 1]) + bar.damping * (qd[left] - qd[left + 1])
        for bar, left in zip(bars, (4, 6), strict=True)
    ]
    found = [channels[f"stabilizer_bar.{axle}.torque"] for axle in ("front", "rear")]
    assert_allclose(found, torques, rtol=1e-10, atol=1e-9)

    seat = car.point_acceleration(car.on_chassis(q, np.array(SEAT)), "chassis", qd, qdd)
    found = [channels[f"seat.a_{axis}"] for axis in "xyz"]
    assert_allclose(found, seat, rtol=0, atol=1e-12 * np.abs(qdd).max())
    assert channels["chassis.a_x"] == pytest.approx(qdd[0], abs=1e-12 * np.abs(qdd).max())


@pytest.mark.parametrize("seed", range(50))
def test_road_channels_are_those_of_the_multibody_program(seed):
    rng = np.random.default_rng([6, seed])
    vehicle = random_vehicle(rng)
    state, car = random_road_state(rng, vehicle), MujocoCar(vehicle)
    q, qd, inputs = state.q, state.qd, state.inputs
    qdd = car.accelerations(q, qd, **inputs)
    loads = car.tyre_loads(q, qd, inputs["road_height"], inputs["road_rate"])
    way = np.tanh(qd[0] / 0.1)
    on_tyres = []
    for i, corner in enumerate(car.corners):
        traction = (inputs["drive"][i] - inputs["brake"][i] * way) / corner.axle.wheel.radius
        rolling = corner.axle.tyre.rolling_resistance * loads[i] * way
        on_tyres.append(np.array([traction - rolling, 0.0, loads[i]]))
    assert_channels(road_channels(vehicle, state), car, q, qd, qdd, on_tyres)


@pytest.mark.parametrize("seed", range(50))
def test_rims_channels_are_those_of_the_multibody_program(seed):
    rng = np.random.default_rng([7, seed])
    vehicle = random_vehicle(rng)
    state, car = random_rims_state(rng, vehicle), MujocoCar(vehicle)
    qdd, vertical, longitudinal = car.rims_accelerations(*state.arguments)
    q, qd = car.rims_state(*state.arguments[:5])
    on_tyres = [np.array([X, 0.0, Z]) for X, Z in zip(longitudinal, vertical, strict=True)]
    assert_channels(rims_channels(vehicle, state, q, qd), car, q, qd, qdd, on_tyres)


@pytest.mark.parametrize("seed", range(50))
def test_arms_reach_the_prescribed_wheel_centres(seed):
    """Oracle: Newton's method on the wheel centres' heights; the engine has a closed form."""
    rng = np.random.default_rng([8, seed])
    vehicle = random_vehicle(rng)
    state = random_rims_state(rng, vehicle)
    q, qd = MujocoCar(vehicle).rims_state(*state.arguments[:5])
    found = rims_accelerations(vehicle, *state.arguments)
    assert_allclose(found["q"], q, rtol=0, atol=1e-14)
    assert_allclose(found["qd"], qd, rtol=0, atol=1e-13 * np.abs(qd).max())
