"""Time histories of the engine against laws and against the independent multibody program.

Published squat, an independent integration, conservation of energy, the order of the integrator,
the modes of the linearised car, and a recording fed back into the rims mode.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.demand import Demand, PiecewiseLinear, PostMotion
from ridetune.engine.manoeuvre import Manoeuvre
from ridetune.engine.roads.road import Road
from ridetune.engine.run import Run
from ridetune.engine.simulation.car_rows import car_row
from ridetune.engine.simulation.integration import free_states
from ridetune.engine.simulation.rims import prepare
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import rims_batch, simulate_rims, simulate_road
from ridetune.engine.simulation.stepping import prepare_free
from ridetune.engine.torque_laws import Deceleration, DriveTable, ReachSpeed
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from ...factories import paper_vehicle, random_vehicle
from ...oracles.mujoco_car import MujocoCar

POSE = ("chassis.z", "chassis.pitch", "chassis.roll")
ARMS = tuple(f"arm.{corner}.angle" for corner in ("fl", "fr", "rl", "rr"))
UNFILTERED = RimsSettings(a_x_cutoff_hz=None, rim_cutoff_hz=None)


def smooth_road(amplitude=0.02, start=-4.0, spacing=0.02, end=80.0):
    """An analytic road, different left and right, sampled so finely that it is that function."""
    x = start + spacing * np.arange(round((end - start) / spacing) + 1)
    return Road(
        start,
        spacing,
        amplitude * np.cos(1.3 * x + 0.4),
        amplitude * np.cos(0.9 * x - 0.7),
    )


def one_bump(begin=3.0, length=2.0, height=0.03, spacing=0.01, end=20.0):
    """A raised cosine, a third lower on the right, on level ground."""
    x = spacing * np.arange(round(end / spacing) + 1)
    inside = (x > begin) & (x < begin + length)
    profile = np.where(inside, 0.5 * height * (1 - np.cos(2 * np.pi * (x - begin) / length)), 0.0)
    return Road(0.0, spacing, profile, 2 / 3 * profile)


def states_of(vehicle, demand, step, sample_step):
    """Sample times (S,) and all coordinates and rates (S, 16)."""
    inputs = prepare_free(demand, step, sample_step)
    states = free_states(car_row(vehicle)[np.newaxis], inputs)
    assert states.failed[0] == -1
    return inputs.time, states.values[0]


def rolling(road, duration, speed, torque=0.0):
    """Driving on a road with one constant torque on each rear wheel."""
    drive = PiecewiseLinear(np.array([0.0, duration]), np.tile([0, 0, torque, torque], (2, 1)))
    return Demand(duration, speed, drive, PiecewiseLinear.zero(duration), road)


def without_loss(vehicle):
    """The car without dampers and rolling resistance."""

    def axle(a):
        return replace(
            a,
            suspension=replace(a.suspension, damping=0.0),
            stabilizer_bar=replace(a.stabilizer_bar, damping=0.0),
            tyre=replace(a.tyre, damping=0.0, rolling_resistance=0.0),
        )

    return replace(vehicle, front=axle(vehicle.front), rear=axle(vehicle.rear))


def test_the_reference_car_squats_as_published():
    """Oracle: z = -2.46 mm, pitch -0.880 deg, arms +0.559 and +1.113 deg at nearly 3 m/s2.

    They come from another multibody program, printed to three digits: half of the last one is
    what their rounding hides, as much again what "nearly" does. After 6 s the slowest body mode
    has fallen below 1e-4.
    """
    law = ReachSpeed(speed=24.0, time=8.0, start=1.0)
    run = simulate_road(paper_vehicle(), Manoeuvre("squat", "road", 8.0, drive=law)).run
    rest, steady = run.time < 1.0, run.time > 7.0
    for name in (*POSE, *ARMS):
        assert_allclose(run[name][rest], 0, rtol=0, atol=1e-12)
    assert_allclose(run["chassis.z"][steady] * 1e3, -2.46, rtol=0, atol=0.01)
    assert_allclose(np.degrees(run["chassis.pitch"][steady]), -0.880, rtol=0, atol=1e-3)
    assert_allclose(run["chassis.roll"][steady], 0, rtol=0, atol=1e-12)
    for name, angle in zip(ARMS, (0.559, 0.559, 1.113, 1.113), strict=True):
        assert_allclose(np.degrees(run[name][steady]), angle, rtol=0, atol=1e-3)


@pytest.mark.parametrize("seed", range(2))
def test_a_drive_is_that_of_the_multibody_program_integrated_by_another_method(seed):
    """Oracle: DOP853 to 1e-7 on the other program's accelerations, the road by its own formula.

    A random car accelerates from 8 m/s, then brakes, on a wavy road. The engine's own
    error at 1 ms is fourth order in the wheel hop's (omega h = 0.1): below 1e-5 of the motion.
    """
    rng = np.random.default_rng([9, seed])
    vehicle = random_vehicle(rng, braked=True)
    drive = DriveTable((0.0, 0.2, 0.6, 0.6), (0.0, 900.0, 900.0, 0.0))
    brake = Deceleration(level=4.0, start=0.6, ramp=0.1)
    road = smooth_road()
    manoeuvre = Manoeuvre("drive", "road", 1.0, initial_speed=8.0, drive=drive, brake=brake)
    run = simulate_road(vehicle, manoeuvre, road=road, step=0.001).run

    car, demand = MujocoCar(vehicle), manoeuvre.demand(vehicle)

    def rate(t, y, side):
        q, qd = y[:8], y[8:]
        car.place(q, qd)
        height, slope_rate = np.empty(4), np.empty(4)
        for i in range(4):
            X = car.wheel_centre(q, i)[0]
            X_rate = car.at_wheel(q, i, np.array([1.0, 0.0, 0.0])) @ qd
            height[i] = road.height(i % 2, X)
            slope_rate[i] = road.slope(i % 2, X) * X_rate
        qdd = car.accelerations(
            q,
            qd,
            road_height=height,
            road_rate=slope_rate,
            drive=demand.drive.at(t, side),
            brake=demand.brake.at(t, side),
        )
        return np.concatenate([qd, qdd])

    y = np.array([0.0, *(run[name][0] for name in (*POSE, *ARMS)), 8.0, *np.zeros(7)])
    assert_allclose(rate(0.0, y - [*np.zeros(8), 8.0, *np.zeros(7)], "right")[9:], 0, atol=1e-6)
    names = ("chassis.x", *POSE, *ARMS, "chassis.v_x", "chassis.z_rate", "chassis.pitch_rate")
    for begin, end in ((0.0, 0.2), (0.2, 0.6), (0.6, 0.7), (0.7, 1.0)):
        piece = solve_ivp(
            lambda t, y, end=end: rate(t, y, "left" if t > end - 1e-9 else "right"),
            (begin, end),
            y,
            method="DOP853",
            rtol=1e-7,
            atol=1e-9,
        )
        y = piece.y[:, -1]
        sample = round(end / 0.005)
        found = np.array([run[name][sample] for name in names])
        assert_allclose(found, y[: len(names)], rtol=1e-5, atol=1e-7)


def test_a_car_without_losses_keeps_its_energy():
    """Oracle: energy of the other program; Runge-Kutta 4 loses it with order 4 at least.

    The bump leaves the car heaving, pitching, rolling and hopping on level ground.
    """
    vehicle = without_loss(paper_vehicle())
    car, demand = MujocoCar(vehicle), rolling(one_bump(), 2.0, 15.0)

    def drift(step):
        time, states = states_of(vehicle, demand, step, 0.1)
        free = states[time > 0.55]  # the rear wheels leave the bump at (5.0 + 1.4) / 15 s
        energy = [car.kinetic_energy(s[:8], s[8:]) + car.potential_energy(s[:8]) for s in free]
        assert np.ptp(free[:, 3]) > np.radians(0.1)
        return abs(energy[-1] - energy[0])

    drifts = [drift(step) for step in (0.004, 0.002, 0.001)]
    assert drifts[0] > 14 * drifts[1]
    assert drifts[1] > 14 * drifts[2]


@pytest.mark.parametrize("torque", [0.0, 500.0])
def test_the_integrator_is_of_fourth_order(torque):
    """Oracle: halving the step divides the difference to the next by 16, order 4 +- 0.2."""
    vehicle, road = paper_vehicle(), smooth_road()
    demand = rolling(road, 2.0, 10.0, torque)
    histories = [states_of(vehicle, demand, 0.004 / 2**k, 0.02)[1] for k in range(4)]
    differences = [np.linalg.norm(b - a) for a, b in zip(histories, histories[1:], strict=False)]
    orders = np.log2(np.divide(differences[:-1], differences[1:]))
    assert_allclose(orders, 4.0, rtol=0, atol=0.2)


def test_a_torque_jump_inside_the_record_costs_no_order():
    """Oracle: as above; a stage that sees the other side of the jump would leave order 1."""
    vehicle = paper_vehicle()
    time, torque = np.array([0.0, 0.503, 0.503, 1.0]), np.array([0.0, 0.0, 600.0, 600.0])
    drive = PiecewiseLinear(time, np.outer(torque, [0, 0, 1, 1]))
    demand = Demand(1.0, 10.0, drive, PiecewiseLinear.zero(1.0), smooth_road())
    histories = [states_of(vehicle, demand, 0.004 / 2**k, 0.02)[1] for k in range(4)]
    differences = [np.linalg.norm(b - a) for a, b in zip(histories, histories[1:], strict=False)]
    orders = np.log2(np.divide(differences[:-1], differences[1:]))
    assert_allclose(orders, 4.0, rtol=0, atol=0.3)


def linearised(car, difference=1e-6):
    """State matrix (16, 16) of the other program's car at rest on still posts."""
    still = {name: np.zeros(4) for name in ("road_height", "road_rate", "drive", "brake")}

    def rate(y):
        return np.concatenate([y[8:], car.accelerations(y[:8], y[8:], **still)])

    steps = difference * np.eye(16)
    return np.stack([(rate(s) - rate(-s)) / (2 * difference) for s in steps], axis=1)


def test_small_motions_are_the_modes_of_the_linearised_car():
    """Oracle: eigenvalues of the other program's linearised equations.

    One post moves by 10 um and returns; afterwards each mode's amplitude must follow exp(lambda t).
    What is left out is of second order: 1e-5 m over the arms' 1 m.
    """
    vehicle = paper_vehicle()
    eigenvalues, modes = np.linalg.eig(linearised(MujocoCar(vehicle)))
    time = np.linspace(0.0, 1.0, 2001)
    pulse = np.where(time < 0.1, np.sin(10 * np.pi * time) ** 4, 0.0)
    posts = PostMotion(time, 1e-5 * np.outer(pulse, [1, 0, 0, 0]))
    zero = PiecewiseLinear.zero(1.0)
    t, states = states_of(vehicle, Demand(1.0, 0.0, zero, zero, None, posts), 0.0005, 0.005)
    free = t >= 0.1
    t, amplitudes = t[free] - 0.1, np.linalg.solve(modes, states[free].T.astype(complex))
    expected = amplitudes[:, :1] * np.exp(np.outer(eigenvalues, t))
    assert_allclose(amplitudes, expected, rtol=0, atol=1e-4 * np.abs(amplitudes[:, 0]).max())

    frequencies = np.sort(np.abs(eigenvalues[eigenvalues.imag > 1e-6])) / (2 * np.pi)
    body, hop = frequencies[frequencies < 5], frequencies[frequencies > 5]
    assert len(body) == 3
    assert len(hop) == 4
    assert 0.8 < body.min() < body.max() < 3.0
    assert 8.0 < hop.min() < hop.max() < 16.0


def recording(time):
    """Smooth wheels and acceleration of any car, from rest; it brakes from 0.7 s to the end."""
    s = np.minimum(time / 0.4, 1.0)
    grown = s**3 * (10 - 15 * s + 6 * s**2)
    phases, rates = np.array([0.0, 0.9, 2.0, 3.3]), np.array([9.0, 11.0, 7.5, 13.0])
    u = 0.012 * grown[:, np.newaxis] * np.sin(np.outer(time, rates) + phases)
    channels = {f"wheel.{c}.z": u[:, i] for i, c in enumerate(("fl", "fr", "rl", "rr"))}
    channels |= {"chassis.a_x": -4.0 * np.sin(4.0 * time - 0.3), "chassis.v_x": 8.0 - 2.0 * time}
    return Run("smooth", time, channels)


@pytest.mark.parametrize("traction", ["exact", "paper"])
@pytest.mark.parametrize("seed", range(2))
def test_rims_histories_are_those_of_the_multibody_program(seed, traction):
    """Oracle: DOP853 to 1e-9 on the other program's rims accelerations, from knot to knot.

    Inputs are the documented C2 splines through the samples and the braking weight with its ramp of
    0.1 s. The engine's error at 2.5 ms and body frequencies (omega h < 0.1) is below
    1e-6 of the motion's centimetre.
    """
    vehicle = random_vehicle(np.random.default_rng([10, seed]), braked=True)
    run = recording(np.linspace(0.0, 1.2, 25))
    run = replace(run, braking=((0.7, 2.0),))
    settings = replace(UNFILTERED, step=0.0025)
    simulated = simulate_rims(vehicle, run, traction=traction, settings=settings).run
    wheels = [f"wheel.{corner}.z" for corner in ("fl", "fr", "rl", "rr")]
    u = CubicSpline(run.time, np.column_stack([run[name] for name in wheels]))
    a_x = CubicSpline(run.time, run["chassis.a_x"])
    car = MujocoCar(vehicle)

    def rate(t, y):
        v, braking = 8.0 - 2.0 * t, np.clip((t - 0.6) / 0.1, 0.0, 1.0)
        qdd, _, _ = car.rims_accelerations(
            y[:3], y[3:], v, u(t), u(t, 1), u(t, 2), a_x(t), braking, traction
        )
        return np.concatenate([y[3:], qdd[1:4]])

    y = np.concatenate([[simulated[name][0] for name in POSE], np.zeros(3)])
    for sample, (begin, end) in enumerate(zip(run.time, run.time[1:], strict=False), start=1):
        y = solve_ivp(rate, (begin, end), y, method="DOP853", rtol=1e-9, atol=1e-12).y[:, -1]
        found = [simulated[name][sample] for name in POSE]
        assert_allclose(found, y[:3], rtol=0, atol=1e-8)


def test_a_drive_fed_back_as_rims_gives_its_own_motion():
    """Oracle: the drive itself. What is left is spline interpolation of the rims, order 4 in the
    sampling, and of a_x at the torque's kinks: far below a millimetre and a hundredth of a degree.
    """
    vehicle = paper_vehicle()
    law = ReachSpeed(speed=15.0, time=3.0, start=0.5)
    manoeuvre = Manoeuvre("feedback", "road", 4.0, drive=law)
    errors = []
    for sample_step in (0.01, 0.005):
        run = simulate_road(
            vehicle, manoeuvre, road=smooth_road(), sample_step=sample_step, step=0.001
        ).run
        back = simulate_rims(vehicle, run, settings=UNFILTERED).run
        errors.append(max(np.abs(back[name] - run[name]).max() for name in POSE))
    assert errors[1] < 1e-5
    assert errors[1] < errors[0]


def test_cars_in_a_batch_move_as_alone():
    """Oracle: the same kernel, one car at a time; lanes may round differently, no more."""
    rng = np.random.default_rng(11)
    vehicles = [random_vehicle(rng, braked=True) for _ in range(11)]
    run = recording(np.linspace(0.0, 1.2, 241))
    inputs = prepare(run, vehicles[0], UNFILTERED)
    cars = np.stack([car_row(vehicle) for vehicle in vehicles])
    together = rims_batch(cars, inputs, "exact")
    for car, motion in zip(cars, together, strict=True):
        alone = rims_batch(car[np.newaxis], inputs, "exact")[0]
        assert_allclose(motion, alone, rtol=0, atol=1e-12)
