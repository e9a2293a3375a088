"""The oracle against itself and pencil: Lagrange's equations, statics, free fall, one pendulum.

The engine does not appear here. What these tests leave open is only whether the forces are the
documented ones; the tree, its energies and its Jacobians are checked by other means.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.app.bench.car_points import CORNERS, GRAVITY
from scipy.optimize import root

from ..factories import (
    mirrored,
    mirrored_coordinates,
    paper_vehicle,
    random_rims_state,
    random_road_state,
    random_vehicle,
)
from .mujoco_car import MujocoCar

STILL = {name: np.zeros(4) for name in ("road_height", "road_rate", "drive", "brake")}


def cars_and_states(count, **kinds):
    rng = np.random.default_rng(20)
    for _ in range(count):
        vehicle = random_vehicle(rng, **kinds)
        yield MujocoCar(vehicle), random_road_state(rng, vehicle)


def complex_step_gradient(function, q):
    """d(function)/dq exact to round-off; derivatives along the last axis."""
    step = 1e-30
    return np.stack(
        [np.imag(function(q + 1j * step * unit)) / step for unit in np.eye(len(q))], axis=-1
    )


def lagrangian_mass_matrix(car, q):
    """M from explicit positions and rotations: sum of m Jp^T Jp + Jr^T I Jr."""
    chassis = car.vehicle.chassis
    tensor = np.array(
        [
            [chassis.inertia.xx, 0, chassis.inertia.xz],
            [0, chassis.inertia.yy, 0],
            [chassis.inertia.xz, 0, chassis.inertia.zz],
        ]
    )
    bodies = [(chassis.mass, tensor, car.origin, lambda q: car.rotation_of_arm(level(q), 0))]
    for i, corner in enumerate(car.corners):
        bodies.append(
            (
                corner.axle.wheel.mass,
                corner.inertia,
                lambda q, i=i, corner=corner: car.on_arm(q, i, corner.p_G),
                lambda q, i=i: car.rotation_of_arm(q, i),
            )
        )
    matrix = np.zeros((8, 8))
    for mass, inertia, position, rotation in bodies:
        Jp = complex_step_gradient(position, q)
        spin = np.einsum("abk,cb->ack", complex_step_gradient(rotation, q), rotation(q))
        Jr = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        turned = rotation(q) @ inertia @ rotation(q).T
        matrix += mass * Jp.T @ Jp + Jr.T @ turned @ Jr
    return matrix


def level(q):
    """The chassis's own rotation is that of an arm at angle zero."""
    return np.concatenate([q[:4], np.zeros(4)])


def test_mass_matrix_is_the_hessian_of_the_kinetic_energy():
    """Oracle: kinetic energy from explicit positions, differentiated to round-off."""
    for car, state in cars_and_states(20):
        car.place(state.q, state.qd)
        expected = lagrangian_mass_matrix(car, state.q)
        assert_allclose(car.mass_matrix(), expected, rtol=0, atol=1e-12 * abs(expected).max())


def test_bias_is_that_of_lagranges_equations():
    """Oracle: Christoffel terms of M by central differences, whose error is about step**2."""
    step = 1e-5
    for car, state in cars_and_states(10):
        q, qd = state.q, state.qd
        dM = np.stack(
            [
                (
                    lagrangian_mass_matrix(car, q + step * unit)
                    - lagrangian_mass_matrix(car, q - step * unit)
                )
                / (2 * step)
                for unit in np.eye(8)
            ],
            axis=-1,
        )
        expected = np.einsum("ijk,j,k->i", dM, qd, qd) - 0.5 * np.einsum("jki,j,k->i", dM, qd, qd)
        expected += complex_step_gradient(car.gravity_energy, q)
        car.place(q, qd)
        assert_allclose(car.bias(), expected, rtol=0, atol=1e-8 * abs(expected).max())


def test_undamped_forces_are_minus_the_gradient_of_their_energy():
    for car, state in cars_and_states(20):
        q, road = state.q, state.inputs["road_height"]
        car.place(q, np.zeros(8))
        elastic = -complex_step_gradient(car.suspension_energy, q)
        force = car.suspension_forces(q, np.zeros(8))
        assert_allclose(force, elastic, rtol=0, atol=1e-12 * abs(elastic).max())
        tyres = -complex_step_gradient(lambda q, car=car, road=road: car.tyre_energy(q, road), q)
        loads = car.tyre_loads(q, np.zeros(8), road, np.zeros(4))
        force = sum(car.at_wheel(q, i, [0, 0, loads[i]]) for i in range(4))
        assert_allclose(force, tyres, rtol=0, atol=1e-12 * abs(tyres).max())


def test_dampers_take_power_by_their_rates():
    """Oracle: power C (dL/dt)^2 + Ctor (da_L - da_R)^2, the rate of length by complex step."""
    for car, state in cars_and_states(20):
        q, qd = state.q, state.qd
        car.place(q, qd)
        taken = (car.suspension_forces(q, 0 * qd) - car.suspension_forces(q, qd)) @ qd
        expected = 0.0
        for i, corner in enumerate(car.corners):

            def length(q, i=i, car=car):
                element = car.mount(q, i) - car.wheel_centre(q, i)
                return np.sqrt(np.sum(element * element))

            rate = complex_step_gradient(length, q) @ qd
            expected += corner.axle.suspension.damping * rate**2
        for left, bar in ((4, car.corners[0].axle), (6, car.corners[2].axle)):
            expected += bar.stabilizer_bar.damping * (qd[left] - qd[left + 1]) ** 2
        assert taken == pytest.approx(expected, rel=1e-12)


def test_a_car_in_free_fall_falls_with_g_and_nothing_turns():
    for car, state in cars_and_states(10):
        car.place(state.q, np.zeros(8))
        qdd = np.linalg.solve(car.mass_matrix(), -car.bias())
        assert_allclose(qdd, [0, -GRAVITY, 0, 0, 0, 0, 0, 0], rtol=0, atol=1e-11)


def test_an_arm_on_a_held_chassis_is_a_pendulum():
    """Oracle: (I + m s^2) a'' = m g s cos(angle), s and angle of G seen from the pivot."""
    for car, state in cars_and_states(10):
        q = np.array([0, 0, 0, 0, *state.q[4:]])
        car.place(q, np.zeros(8))
        M, h = car.mass_matrix(), car.bias()
        for i, corner in enumerate(car.corners):
            along, up = (corner.p_G - corner.p_P)[[0, 2]]
            wheel, angle = corner.axle.wheel, q[4 + i]
            reach = along * np.cos(angle) + up * np.sin(angle)
            inertia = wheel.inertia.yy + wheel.mass * (along**2 + up**2)
            expected = wheel.mass * GRAVITY * reach / inertia
            assert -h[4 + i] / M[4 + i, 4 + i] == pytest.approx(expected, rel=1e-12)


def test_a_car_at_rest_stays_at_rest():
    rng = np.random.default_rng(3)
    for vehicle in [paper_vehicle(), *(random_vehicle(rng) for _ in range(20))]:
        qdd = MujocoCar(vehicle).accelerations(np.zeros(8), np.zeros(8), **STILL)
        assert_allclose(qdd, 0, atol=1e-10)


def test_preloads_of_the_reference_car_are_those_of_the_sprung_mass():
    """Oracle: F0 = m_s g l/(2L), W0 = F0 + m g."""
    car = MujocoCar(paper_vehicle())
    front, rear = 1090 * 9.81 * 1.36 / 5.32, 1090 * 9.81 * 1.30 / 5.32
    assert_allclose([c.preload for c in car.corners], [front, front, rear, rear], rtol=1e-14)
    loads = [front + 36 * 9.81] * 2 + [rear + 39 * 9.81] * 2
    assert_allclose([c.tyre_load for c in car.corners], loads, rtol=1e-14)


def test_steady_acceleration_squats_the_reference_car_as_published():
    """Oracle: z = -2.46 mm, pitch = -0.880 deg, arms +0.559 and +1.113 deg near 3 m/s2.

    Those come from another multibody program. "Near" is the torque of a law that ignores the
    arms' lag, r M (v/t + fr g)/2 a wheel at v/t = 3 m/s2; a last printed digit is the tolerance.
    """
    vehicle = paper_vehicle()
    car = MujocoCar(vehicle)
    torque = 0.30 * car.total_mass * (3.0 + 0.01 * GRAVITY) / 2
    inputs = STILL | {"drive": np.array([0, 0, torque, torque])}

    def rates_of_the_pose(pose):
        q = np.array([0, pose[0], pose[1], 0, pose[2], pose[2], pose[3], pose[3]])
        return car.accelerations(q, np.array([10.0, *np.zeros(7)]), **inputs)[[1, 2, 4, 6]]

    z, pitch, front, rear = root(rates_of_the_pose, np.zeros(4), tol=1e-12).x
    assert z * 1e3 == pytest.approx(-2.46, abs=0.01)
    assert np.degrees([pitch, front, rear]) == pytest.approx([-0.880, 0.559, 1.113], abs=1e-3)


def test_accelerations_mirror_left_and_right():
    for car, state in cars_and_states(20):
        qdd = car.accelerations(state.q, state.qd, **state.inputs)
        other = state.mirror()
        mirror = car.accelerations(other.q, other.qd, **other.inputs)
        assert_allclose(mirrored_coordinates(mirror), qdd, rtol=0, atol=1e-12 * abs(qdd).max())


def test_wheel_centre_drift_is_the_rate_of_its_jacobian():
    """Oracle: MuJoCo's own dJ/dt qd, which the by-hand expression does not use."""
    for car, state in cars_and_states(20):
        car.place(state.q, state.qd)
        for i, name in enumerate(CORNERS):
            centre = car.wheel_centre(state.q, i)
            rate = car.point_acceleration(centre, name, state.qd, np.zeros(8))
            drift = car.wheel_centre_drift(state.q, state.qd, i)
            assert_allclose(drift, rate, rtol=0, atol=1e-12 * max(1, abs(drift).max()))


def test_forces_on_the_chassis_accelerate_it():
    """Oracle: Newton's law for the chassis alone, on mount and pivot forces and its weight."""
    for car, state in cars_and_states(20):
        q, qd, inputs = state.q, state.qd, state.inputs
        qdd = car.accelerations(q, qd, **inputs)
        loads = car.tyre_loads(q, qd, inputs["road_height"], inputs["road_rate"])
        way = np.tanh(qd[0] / 0.1)
        total = np.array([0.0, 0.0, -GRAVITY * car.vehicle.chassis.mass])
        for i, corner in enumerate(car.corners):
            torque = inputs["drive"][i] - inputs["brake"][i] * way
            rolling = corner.axle.tyre.rolling_resistance * loads[i] * way
            on_tyre = np.array([torque / corner.axle.wheel.radius - rolling, 0, loads[i]])
            total += car.spring_and_damper(q, qd, i)[1]
            total += car.pivot_force(q, qd, qdd, i, on_tyre)
        momentum = car.vehicle.chassis.mass * np.array([qdd[0], 0, qdd[1]])
        # Nothing moves sideways in this model: its Y balance is a constraint's reaction.
        assert_allclose(total[[0, 2]], momentum[[0, 2]], rtol=0, atol=1e-11 * abs(momentum).max())


@pytest.mark.parametrize("traction", ["exact", "paper"])
def test_rims_forces_driven_back_through_the_direct_mode_give_the_same_accelerations(traction):
    """A road and torques that cause the solved forces must cause the solved accelerations."""
    rng = np.random.default_rng(5)
    for _ in range(30):
        vehicle = random_vehicle(rng)
        car, state = MujocoCar(vehicle), random_rims_state(rng, vehicle)
        qdd, vertical, longitudinal = car.rims_accelerations(*state.arguments, traction=traction)
        q, qd = car.rims_state(*state.arguments[:5])

        way = np.tanh(state.v / 0.1)
        tyres = [c.axle.tyre for c in car.corners]
        rolling = np.array([t.rolling_resistance for t in tyres]) * vertical * way
        stiffness = np.array([t.stiffness for t in tyres])
        level = car.tyre_loads(q, qd, np.zeros(4), np.zeros(4))
        road_height = (vertical - level) / stiffness
        # The total traction again, split by hand into driving and braking torques.
        driven = np.array([c.axle.driven for c in car.corners])
        total = (longitudinal + rolling).sum()
        radius = np.array([c.axle.wheel.radius for c in car.corners])
        drive = (1 - state.braking) * total * driven / driven.sum() * radius
        brake = np.zeros(4)
        if state.braking:
            front = vehicle.brakes.front_share
            share = np.array([front, front, 1 - front, 1 - front]) / 2
            if way == 0:
                continue  # a standing car's brakes have no direction in the direct mode
            brake = -state.braking * total * share * radius / way
        direct = car.accelerations(
            q, qd, road_height=road_height, road_rate=np.zeros(4), drive=drive, brake=brake
        )
        assert_allclose(direct, qdd, rtol=0, atol=1e-10 * abs(qdd).max())
        lifts = [car.at_wheel(q, i, [0, 0, 1]) @ qdd for i in range(4)]
        drifts = [car.wheel_centre_drift(q, qd, i)[2] for i in range(4)]
        assert_allclose(np.add(lifts, drifts), state.u_acc, rtol=0, atol=1e-10)
        if traction == "exact":
            assert qdd[0] == pytest.approx(state.a_x, abs=1e-11)
        else:
            assert total == pytest.approx(car.total_mass * state.a_x + rolling.sum(), rel=1e-11)


def test_rims_state_puts_the_wheel_centres_where_asked():
    rng = np.random.default_rng(6)
    for _ in range(20):
        vehicle = random_vehicle(rng)
        car, state = MujocoCar(vehicle), random_rims_state(rng, vehicle)
        q, qd = car.rims_state(*state.arguments[:5])
        for i, corner in enumerate(car.corners):
            height = car.wheel_centre(q, i)[2] - corner.axle.wheel.radius
            assert height == pytest.approx(state.u[i], abs=1e-15)
            assert car.at_wheel(q, i, [0, 0, 1]) @ qd == pytest.approx(state.u_rate[i], abs=1e-13)


def test_rims_accelerations_mirror_left_and_right():
    rng = np.random.default_rng(7)
    for traction in ("exact", "paper"):
        vehicle = random_vehicle(rng)
        car, state = MujocoCar(vehicle), random_rims_state(rng, vehicle)
        qdd, vertical, _ = car.rims_accelerations(*state.arguments, traction=traction)
        other, lifted, _ = car.rims_accelerations(*state.mirror().arguments, traction=traction)
        assert_allclose(mirrored_coordinates(other), qdd, rtol=0, atol=1e-12 * abs(qdd).max())
        assert_allclose(mirrored(lifted), vertical, rtol=1e-11)
