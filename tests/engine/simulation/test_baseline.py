"""The linear 7-DOF car: published modes, closed forms, balances, exact integration."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.demand import PostMotion
from ridetune.engine.frames import CORNERS
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.roads.road import Road
from ridetune.engine.simulation.baseline import (
    Baseline,
    recursion,
    simulate_posts,
    simulate_rims,
    simulate_road,
)
from ridetune.engine.vehicle_file import reference_vehicles
from scipy.integrate import solve_ivp

from ...factories import mirrored, paper_vehicle, random_vehicle

G = 9.81
POSE = ("chassis.z", "chassis.pitch", "chassis.roll")


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def on_posts(motion, duration, step=0.005):
    """A rig whose posts follow motion(t) -> (n, 4)."""
    time = np.linspace(0.0, duration, round(duration / step) + 1)
    return PostMotion(time, motion(time))


def wheels(channels, name):
    return np.column_stack([channels[name.format(corner)] for corner in CORNERS])


def without_bars(vehicle):
    still = replace(vehicle.front.stabilizer_bar, stiffness=0.0, damping=0.0)
    return replace(
        vehicle,
        front=replace(vehicle.front, stabilizer_bar=still),
        rear=replace(vehicle.rear, stabilizer_bar=still),
    )


@pytest.mark.parametrize(
    ("key", "body", "hop"),
    [
        ("bmw-320i", (1.420, 1.436, 2.303), (11.90, 12.31)),
        ("vw-vanagon", (1.405, 1.615, 2.327), (12.41, 13.11)),
        ("ford-escort", (1.217, 1.611, 2.240), (12.79, 13.20)),
    ],
)
def test_undamped_modes_of_published_cars(key, body, hop):
    """Oracle: the parameter sets' modes as published to 0.001 Hz (body) and 0.01 Hz (hop)."""
    modes = Baseline.of(reference_vehicles()[key]).tyres.undamped_frequencies()
    assert_allclose(modes[:3], body, rtol=0, atol=0.0006)
    assert_allclose(modes[[3, -1]], hop, rtol=0, atol=0.006)


def test_heave_of_a_car_without_pitch_coupling_is_a_quarter_car():
    """Oracle: equal axles; heave decouples: M z'' = 4 K (w - z), m w'' = K (z - w) - Kt w."""
    vehicle = without_bars(paper_vehicle())
    vehicle = replace(vehicle, rear=replace(vehicle.front, driven=True))
    modes = Baseline.of(vehicle).tyres.undamped_frequencies()
    k, kt, sprung, unsprung = 24000.0, 196261.0, 1090.0 / 4, 36.0
    matrix = np.array([[k / sprung, -k / sprung], [-k / unsprung, (k + kt) / unsprung]])
    expected = np.sqrt(np.linalg.eigvals(matrix)) / (2 * np.pi)
    for frequency in expected:
        assert np.min(np.abs(modes - frequency)) < 1e-9


def test_a_bar_acts_on_the_wheels_as_its_rate_over_d_squared():
    """Oracle: force 2 Ktor/d^2 s on each wheel, opposite, when one axle's wheels go +-s."""
    baseline = Baseline.of(paper_vehicle())
    bar = baseline.stiffness - np.diag([24000.0, 24000.0, 27000.0, 27000.0])
    force = bar @ np.array([0.01, -0.01, 0.0, 0.0])
    assert_allclose(force, 2 * 22000.0 / 1.6**2 * np.array([0.01, -0.01, 0, 0]), atol=1e-9)
    assert_allclose(bar @ np.array([0.01, 0.01, -0.02, -0.02]), 0.0, atol=1e-12)


@pytest.mark.parametrize("mode", ["posts", "rims"])
def test_a_car_lifted_pitched_or_rolled_as_a_whole_follows_rigidly(mode, rng):
    """Oracle: a plane through the contact points costs no deflection."""
    vehicle = random_vehicle(rng)
    heave, pitch, roll = 0.02, 0.01, -0.015
    x = np.repeat([vehicle.front.cg_distance, -vehicle.rear.cg_distance], 2)
    y = np.repeat([vehicle.front.track, vehicle.rear.track], 2) * [0.5, -0.5, 0.5, -0.5]
    plane = heave - pitch * x + roll * y
    system = getattr(Baseline.of(vehicle), {"posts": "tyres", "rims": "rims"}[mode])
    rest = system.at_rest(plane)
    assert_allclose(rest[:3], [heave, pitch, roll], rtol=1e-9)
    if mode == "posts":
        assert_allclose(rest[3:], plane, rtol=1e-9)


def test_one_raised_post_warps_the_car_as_its_springs_share_it():
    """Oracle: four equal springs in series with tyres: a post up by u moves z by u/4, pitch by
    -u/(4 l), roll by u/(4 b), l and b the distances of the wheels from the middle."""
    vehicle = without_bars(paper_vehicle())
    vehicle = replace(vehicle, rear=replace(vehicle.front, driven=True))
    rest = Baseline.of(vehicle).tyres.at_rest(np.array([0.04, 0.0, 0.0, 0.0]))
    assert_allclose(rest[0], 0.01, rtol=1e-9)
    assert_allclose(rest[1], -0.04 / (4 * 1.30), rtol=1e-9)
    assert_allclose(rest[2], 0.04 / (4 * 0.75), rtol=1e-9)


@pytest.mark.parametrize("frequency", [1.3, 5.0, 12.0])
def test_a_sinusoid_settles_to_the_transfer_function(frequency, rng):
    """Oracle: H = (K + i w C - w^2 M)^-1 (P + i w R); the start has decayed by 1e-6 in 15 s and
    the cubic between 2 ms steps errs by (w h)^4/384."""
    vehicle, amplitudes = random_vehicle(rng), rng.uniform(-0.01, 0.01, 4)
    system, omega = Baseline.of(vehicle).tyres, 2 * np.pi * frequency

    def motion(t):
        return np.outer(np.sin(omega * t), amplitudes)

    channels = simulate_posts(vehicle, on_posts(motion, 16.0, 0.001), 0.004)
    dynamic = system.stiffness + 1j * omega * system.damping - omega**2 * system.mass
    response = np.linalg.solve(
        dynamic, (system.input_stiffness + 1j * omega * system.input_damping) @ amplitudes
    )
    late = channels["time"] > 15.0
    phase = np.exp(1j * omega * channels["time"][late])
    for i, name in enumerate((*POSE, *(f"wheel.{corner}.z" for corner in CORNERS))):
        expected = (response[i] * phase).imag
        assert_allclose(channels[name][late], expected, rtol=0, atol=2e-5 * np.abs(response[i]))


def test_a_cubic_input_is_integrated_exactly_whatever_the_step(rng):
    """Oracle: a quarter of the step, and an adaptive solver asked for 1e-10."""
    system = Baseline.of(random_vehicle(rng)).tyres
    coefficients = rng.uniform(-1, 1, (4, 4)) * 0.02
    coefficients[1] = 0.0

    def u(t):
        return np.polynomial.polynomial.polyval(t, coefficients).T

    def u_rate(t):
        return np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyder(coefficients)).T

    coarse_time, fine_time = np.linspace(0, 1, 21), np.linspace(0, 1, 81)
    coarse = system.respond(u(coarse_time), u_rate(coarse_time), 0.05)
    fine = system.respond(u(fine_time), u_rate(fine_time), 0.0125)
    scale = np.abs(fine.q).max()
    assert_allclose(coarse.q, fine.q[::4], rtol=0, atol=1e-11 * scale)

    def rate(t, state):
        q, q_rate = state[:7], state[7:]
        force = system.input_stiffness @ u(t) + system.input_damping @ u_rate(t)
        force = force - system.stiffness @ q - system.damping @ q_rate
        return np.concatenate([q_rate, force / np.diag(system.mass)])

    start = np.concatenate([system.at_rest(u(0.0)), np.zeros(7)])
    solved = solve_ivp(rate, (0, 1), start, "DOP853", rtol=1e-10, atol=1e-13).y[:, -1]
    assert_allclose(coarse.q[-1], solved[:7], rtol=0, atol=1e-8 * scale)
    assert_allclose(coarse.rate[-1], solved[7:], rtol=0, atol=1e-8 * np.abs(fine.rate).max())
    assert_allclose(
        coarse.acceleration[-1], rate(1.0, solved)[7:], atol=1e-7 * np.abs(fine.acceleration).max()
    )


def test_blocks_side_by_side_give_the_plain_recursion(rng):
    """Oracle: one step after another."""
    transition = 0.3 * rng.normal(size=(5, 5))
    for count in (1, 2, 3, 7, 16, 50):
        forced, first = rng.normal(size=(count, 5)), rng.normal(size=5)
        expected = [first]
        for row in forced:
            expected.append(transition @ expected[-1] + row)
        assert_allclose(recursion(transition, forced, first), expected, atol=1e-12)


def test_vertical_forces_balance_the_chassis_mass(rng):
    """Oracle: sum (spring + damper - preload) = m_s z'', as bars cancel over an axle."""
    vehicle = random_vehicle(rng)
    demand = replace(reference_manoeuvres()["2"], duration=12.0).demand(vehicle)
    channels = simulate_road(vehicle, demand, 0.005, {"point.cg": (0.0, 0.0, 0.0)})
    force = wheels(channels, "suspension.{}.spring_force").sum(axis=1)
    force += wheels(channels, "suspension.{}.damper_force").sum(axis=1)
    inertial = vehicle.chassis.mass * channels["point.cg.a_z"]
    assert_allclose(force - force[0], inertial, rtol=0, atol=1e-9 * force[0])


def test_a_seat_feels_heave_pitch_and_roll():
    """Oracle: a_z = z'' - x pitch'' + y roll'' by differences of the rates, step 1 ms."""
    vehicle, place = paper_vehicle(), (0.4, -0.3, 0.2)
    posts = replace(reference_manoeuvres()["heave"], duration=4.0).demand(vehicle).posts
    posts = replace(posts, height=posts.height * np.array([1.0, 0.3, -0.2, 0.6]))
    channels = simulate_posts(vehicle, posts, 0.001, {"seat.rear": place})
    z, pitch, roll = (np.gradient(channels[f"{name}_rate"], 0.001) for name in POSE)
    expected = z - place[0] * pitch + place[1] * roll
    seat = channels["seat.rear.a_z"]
    assert_allclose(seat[2:-2], expected[2:-2], rtol=0, atol=2e-3 * np.abs(seat).max())


def test_left_and_right_are_mirrored():
    """Oracle: the mirrored road gives the mirrored motion to rounding."""
    vehicle = paper_vehicle()
    demand = replace(reference_manoeuvres()["2"], duration=12.0).demand(vehicle)
    road = demand.road
    mirror = replace(demand, road=Road(road.start, road.spacing, road.right, road.left))
    one, other = simulate_road(vehicle, demand, 0.005), simulate_road(vehicle, mirror, 0.005)
    for name, sign in zip(POSE, (1, 1, -1), strict=True):
        assert_allclose(other[name], sign * one[name], rtol=0, atol=1e-12)
    loads = wheels(one, "tyre.{}.load")
    assert_allclose(wheels(other, "tyre.{}.load"), mirrored(loads), rtol=1e-11)


def test_torque_alone_leaves_the_car_at_rest():
    """The baseline has no longitudinal coupling: no squat, static loads, but it drives away."""
    vehicle = paper_vehicle()
    demand = replace(reference_manoeuvres()["2"], road=None).demand(vehicle)
    channels = simulate_road(vehicle, demand, 0.01)
    for name in POSE:
        assert not channels[name].any()
    front = G * (1090 * 1.36 / 2.66 / 2 + 36)
    assert_allclose(channels["tyre.fl.load"], front, rtol=1e-12)
    assert_allclose(wheels(channels, "tyre.{}.load").sum(axis=1), 1240 * G, rtol=1e-12)
    assert channels["chassis.v_x"].max() > 14.9
    assert_allclose(channels["drive.rl.torque"].max(), 0.3 * 1240 * (3 + 0.0981) / 2)


def test_wheels_of_a_road_run_reproduce_it_on_the_rims():
    """Oracle: the same car; the spline through 2 ms samples errs by (w h)^4/384 of hop, 1e-6, and
    its second derivative by (w h)^2/12, 2e-3, away from the ends."""
    vehicle = paper_vehicle()
    demand = replace(reference_manoeuvres()["2"], duration=14.0).demand(vehicle)
    road = simulate_road(vehicle, demand, 0.002)
    rims = simulate_rims(vehicle, road["time"], wheels(road, "wheel.{}.z"))
    for name in POSE:
        scale = np.abs(road[name]).max()
        assert_allclose(rims[name], road[name], rtol=0, atol=1e-5 * scale)
    for corner in CORNERS:
        change = road[f"tyre.{corner}.load"] - road[f"tyre.{corner}.load"][0]
        repeated = rims[f"tyre.{corner}.load"] - road[f"tyre.{corner}.load"][0]
        inner, bound = slice(5, -5), 0.01 * np.abs(change).max()
        assert_allclose(repeated[inner], change[inner], rtol=0, atol=bound)


def test_rims_may_be_sampled_unevenly(rng):
    """Oracle: the even samples; the spline through up to 8 ms steps of a 2 Hz wave errs by 1e-7."""
    vehicle = paper_vehicle()
    even = np.arange(0.0, 4.0, 0.004)
    kept = np.sort(rng.choice(even.size, size=800, replace=False))

    def motion(t):
        shape = 0.01 * np.sin(2 * np.pi * 2 * t) * np.minimum(t, 1.0) ** 3
        return np.outer(shape, [1.0, 0.4, -0.3, 0.8])

    expected = simulate_rims(vehicle, even, motion(even))
    uneven = simulate_rims(vehicle, even[kept], motion(even[kept]))
    for name in POSE:
        scale = np.abs(expected[name]).max()
        assert_allclose(uneven[name], expected[name][kept], rtol=0, atol=1e-3 * scale)


def test_samples_begin_at_zero_and_keep_their_step():
    vehicle = paper_vehicle()
    demand = replace(reference_manoeuvres()["bump"], duration=1.003).demand(vehicle)
    for step in (0.001, 0.005, 0.0125):
        time = simulate_road(vehicle, demand, step)["time"]
        assert_allclose(time, step * np.arange(int(1.003 / step + 1e-9) + 1), atol=1e-12)
