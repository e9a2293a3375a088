"""The 7-DOF baseline: a linear car without longitudinal coupling, shown beside the concept model.

Coordinates q = (z, pitch, roll, w_fl, w_fr, w_rl, w_rr): the sprung mass's CG and the wheel
centres, all vertical displacements from rest up, pitch nose down, roll left side up positive. With
(x_i, y_i) the wheel centre in B, the jounce of corner i is

    s_i = w_i - (z - x_i pitch + y_i roll)

and the suspension's upward force on the chassis, from rest, is K s + C ds/dt plus the stabilizer
bar as a vertical spring between the wheels of an axle: Ktor/d^2 (s_L - s_R), likewise Ctor. Tyres
push the wheels up by Kt (u - w) + Ct (du/dt - dw/dt), u the height of the contact point. Hence

    M q'' + C q' + K q = P u + R u'

with u the contact points' heights, or the wheel centres' in the rims mode, which leaves z, pitch
and roll. Between steps u is a cubic with the given values and rates at both ends, and for such an
input the matrix exponential steps the state exactly. What the trailing arms add in the concept
model (squat, dive, fore-aft inertia) is absent here by design.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.linalg import eigh, expm

from ..demand import Demand, PostMotion, point_mass_motion
from ..equilibrium import static_loads
from ..frames import AXLES, CORNERS, side_of
from ..roads.road import LEFT, RIGHT, Road
from ..run import Run
from ..vehicle import Vehicle
from .output_channels import DEFAULT_POINTS, Points

Channels = dict[str, NDArray[np.float64]]

NAME = "7-DOF baseline"

LONGEST_STEP = 0.002
"""Longest step of the integration, s: a 50 Hz input is followed within 0.1 %."""

CHASSIS = slice(0, 3)
WHEELS = slice(3, 7)


@dataclass(frozen=True, eq=False)
class Motion:
    """Coordinates and their first and second derivatives over time, each (k, n)."""

    q: NDArray[np.float64]
    rate: NDArray[np.float64]
    acceleration: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """M q'' + C q' + K q = P u + R u' of n coordinates under four inputs."""

    mass: NDArray[np.float64]
    damping: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    input_stiffness: NDArray[np.float64]
    input_damping: NDArray[np.float64]

    def undamped_frequencies(self) -> NDArray[np.float64]:
        """Natural frequencies without damping, Hz, rising, shape (n,)."""
        squares = np.asarray(eigh(self.stiffness, self.mass, eigvals_only=True), dtype=np.float64)
        return np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi)

    def at_rest(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Static equilibrium (n,) under constant inputs (4,)."""
        return np.linalg.solve(self.stiffness, self.input_stiffness @ u).astype(np.float64)

    def respond(self, u: NDArray[np.float64], u_rate: NDArray[np.float64], step: float) -> Motion:
        """Motion under inputs u and u' (k, 4) given every `step`, from rest on u[0]."""
        n = self.mass.shape[0]
        to_rate = np.linalg.solve(self.mass, np.hstack([-self.stiffness, -self.damping]))
        from_u = np.linalg.solve(self.mass, self.input_stiffness)
        from_u_rate = np.linalg.solve(self.mass, self.input_damping)
        transition, forcing = _step_matrices(to_rate, from_u, from_u_rate, step)
        forced = _cubic_coefficients(u, u_rate, step) @ forcing.T
        state = recursion(transition, forced, np.concatenate([self.at_rest(u[0]), np.zeros(n)]))
        acceleration = state @ to_rate.T + u @ from_u.T + u_rate @ from_u_rate.T
        return Motion(state[:, :n], state[:, n:], acceleration)


def recursion(transition: NDArray, forced: NDArray, first: NDArray) -> NDArray[np.float64]:
    """States (k + 1, m) of x[i + 1] = A x[i] + f[i] from x[0] = first.

    Blocks of about sqrt(k) steps are taken from zero side by side; what each block begins with
    is added afterwards through the powers of A.
    """
    count, size = forced.shape
    width = math.isqrt(count) + 1
    blocks = -(-count // width)
    padded = np.zeros((blocks, width, size))
    padded.reshape(-1, size)[:count] = forced
    states, power = np.empty_like(padded), [transition.T]
    states[:, 0] = padded[:, 0]
    for i in range(1, width):
        states[:, i] = states[:, i - 1] @ transition.T + padded[:, i]
        power.append(power[-1] @ transition.T)
    begins = np.empty((blocks, size))
    begins[0] = first
    for block in range(1, blocks):
        begins[block] = begins[block - 1] @ power[-1] + states[block - 1, -1]
    for i in range(width):
        states[:, i] += begins @ power[i]
    return np.vstack([first, states.reshape(-1, size)[:count]])


def _step_matrices(to_rate: NDArray, from_u: NDArray, from_u_rate: NDArray, step: float):
    """Matrices of one step: on the state, and on the coefficients of the inputs' cubic.

    Exponential of the system together with the chain c0' = c1, c1' = c2, c2' = c3 of a cubic input
    in the step's own time t/step, c_j = step^j d^j u/dt^j.
    """
    n, inputs = to_rate.shape[0], from_u.shape[1]
    size = 2 * n
    whole = np.zeros((size + 4 * inputs, size + 4 * inputs))
    whole[:n, n:size] = step * np.eye(n)
    whole[n:size, :size] = step * to_rate
    whole[n:size, size : size + inputs] = step * from_u
    whole[n:size, size + inputs : size + 2 * inputs] = from_u_rate
    for j in range(3):
        row = size + j * inputs
        whole[row : row + inputs, row + inputs : row + 2 * inputs] = np.eye(inputs)
    exponential = expm(whole)
    return exponential[:size, :size], exponential[:size, size:]


def _cubic_coefficients(u: NDArray, u_rate: NDArray, step: float) -> NDArray[np.float64]:
    """c0 ... c3 of the inputs' cubic on each step, shape (k - 1, 4 inputs)."""
    begin, end = u[:-1], u[1:]
    begin_rate, end_rate = step * u_rate[:-1], step * u_rate[1:]
    second = 6.0 * (end - begin) - 4.0 * begin_rate - 2.0 * end_rate
    third = 12.0 * (begin - end) + 6.0 * (begin_rate + end_rate)
    return np.hstack([begin, begin_rate, second, third])


@dataclass(frozen=True, eq=False)
class Baseline:
    """The 7-DOF car's matrices.

    jounce : (4, 7), s = jounce @ q
    stiffness, damping : (4, 4), suspension forces from s and ds/dt, bars included
    tyre_stiffness, tyre_damping, wheel_mass : (4,)
    tyres : the car driven at the contact points, n = 7
    rims : the car driven at the wheel centres, n = 3
    """

    jounce: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    tyre_stiffness: NDArray[np.float64]
    tyre_damping: NDArray[np.float64]
    wheel_mass: NDArray[np.float64]
    tyres: LinearSystem
    rims: LinearSystem

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Baseline":
        """The linear car with a vehicle's masses, rates and geometry."""
        x, y = wheel_positions(vehicle)
        jounce = np.column_stack([-np.ones(4), x, -y, np.eye(4)])
        axles = [vehicle.axle(name) for name in AXLES]
        stiffness = np.diag(_each([axle.suspension.stiffness for axle in axles]))
        damping = np.diag(_each([axle.suspension.damping for axle in axles]))
        for i, axle in enumerate(axles):
            pair = slice(2 * i, 2 * i + 2)
            difference = np.array([[1.0, -1.0], [-1.0, 1.0]]) / axle.pivot.distance**2
            stiffness[pair, pair] += axle.stabilizer_bar.stiffness * difference
            damping[pair, pair] += axle.stabilizer_bar.damping * difference
        tyre_stiffness = _each([axle.tyre.stiffness for axle in axles])
        tyre_damping = _each([axle.tyre.damping for axle in axles])
        wheel_mass = _each([axle.wheel.mass for axle in axles])
        inertia = vehicle.chassis.inertia
        mass = np.diag([vehicle.chassis.mass, inertia.yy, inertia.xx, *wheel_mass])
        k, c = jounce.T @ stiffness @ jounce, jounce.T @ damping @ jounce
        rims = LinearSystem(
            mass=mass[CHASSIS, CHASSIS],
            damping=c[CHASSIS, CHASSIS],
            stiffness=k[CHASSIS, CHASSIS],
            input_stiffness=-k[CHASSIS, WHEELS],
            input_damping=-c[CHASSIS, WHEELS],
        )
        on_wheels = np.eye(7)[:, WHEELS]
        tyres = LinearSystem(
            mass=mass,
            damping=c + on_wheels * tyre_damping @ on_wheels.T,
            stiffness=k + on_wheels * tyre_stiffness @ on_wheels.T,
            input_stiffness=on_wheels * tyre_stiffness,
            input_damping=on_wheels * tyre_damping,
        )
        return cls(
            jounce, stiffness, damping, tyre_stiffness, tyre_damping, wheel_mass, tyres, rims
        )


def wheel_positions(vehicle: Vehicle) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """x and y (4,) of the wheel centres from the sprung mass's CG, m."""
    front, rear = vehicle.front, vehicle.rear
    x = np.array([front.cg_distance, front.cg_distance, -rear.cg_distance, -rear.cg_distance])
    y = np.array([0.5 * vehicle.axle_at(corner).track * side_of(corner) for corner in CORNERS])
    return x, y


def simulate_road(
    vehicle: Vehicle, demand: Demand, sample_step: float, points: Points = DEFAULT_POINTS
) -> Run:
    """The run along the demand's road; the way is that of the point mass."""
    road = demand.road or Road.flat()
    time, step, every = _grid(demand.duration, sample_step)
    motion = point_mass_motion(
        vehicle, demand.drive, demand.brake, demand.initial_speed, time[-1], time.size - 1
    )
    under = motion.x[:, np.newaxis] + wheel_positions(vehicle)[0]
    sides = [LEFT if side_of(corner) > 0 else RIGHT for corner in CORNERS]
    u = np.column_stack([road.height(side, under[:, i]) for i, side in enumerate(sides)])
    slope = np.column_stack([road.slope(side, under[:, i]) for i, side in enumerate(sides)])
    channels = _through_tyres(vehicle, u, slope * motion.v[:, np.newaxis], step, points)
    channels |= per_corner("road.{}.z", u)
    channels |= {"chassis.x": motion.x, "chassis.v_x": motion.v, "chassis.a_x": motion.a}
    sampled = {name: values[::every] for name, values in channels.items()}
    sampled |= per_corner("drive.{}.torque", demand.drive.at(time[::every], "left"))
    sampled |= per_corner("brake.{}.torque", demand.brake.at(time[::every], "left"))
    return Run(NAME, time[::every], sampled)


def simulate_posts(
    vehicle: Vehicle, posts: PostMotion, sample_step: float, points: Points = DEFAULT_POINTS
) -> Run:
    """The run on a rig with moving posts, from the motion's first instant, which becomes t = 0."""
    begin = posts.time[0]
    time, step, every = _grid(posts.time[-1] - begin, sample_step)
    spline = CubicSpline(posts.time - begin, posts.height)
    u, u_rate = spline(time), spline(time, 1)
    channels = _through_tyres(vehicle, u, u_rate, step, points) | per_corner("post.{}.z", u)
    sampled = {name: values[::every] for name, values in channels.items()}
    return Run(NAME, time[::every], sampled)


def simulate_rims(
    vehicle: Vehicle,
    time: NDArray[np.float64],
    u: NDArray[np.float64],
    points: Points = DEFAULT_POINTS,
) -> Run:
    """The run of a car moved by its wheel centres u (k, 4), m, at `time` (k,)."""
    baseline = Baseline.of(vehicle)
    spline = CubicSpline(time, u)
    count = int(np.ceil((time[-1] - time[0]) / _grid_step(float(np.median(np.diff(time)))) - 1e-6))
    grid = np.linspace(time[0], time[-1], count + 1)
    motion = baseline.rims.respond(spline(grid), spline(grid, 1), (grid[-1] - grid[0]) / count)
    u_rate, u_acceleration = spline(time, 1), spline(time, 2)
    q = np.hstack([CubicHermiteSpline(grid, motion.q, motion.rate)(time), u])
    rate_spline = CubicHermiteSpline(grid, motion.rate, motion.acceleration)
    rate = np.hstack([rate_spline(time), u_rate])
    acceleration = np.hstack([rate_spline(time, 1), u_acceleration])
    channels = _channels(vehicle, baseline, Motion(q, rate, acceleration), points)
    force = q @ baseline.jounce.T @ baseline.stiffness + rate @ baseline.jounce.T @ baseline.damping
    channels |= _loads(vehicle, force + baseline.wheel_mass * u_acceleration)
    return Run(NAME, time, channels)


def _through_tyres(
    vehicle: Vehicle, u: NDArray, u_rate: NDArray, step: float, points: Points
) -> Channels:
    """Channels of the baseline on moving contact points."""
    baseline = Baseline.of(vehicle)
    motion = baseline.tyres.respond(u, u_rate, step)
    compression = u - motion.q[:, WHEELS]
    compression_rate = u_rate - motion.rate[:, WHEELS]
    force = baseline.tyre_stiffness * compression + baseline.tyre_damping * compression_rate
    return _channels(vehicle, baseline, motion, points) | _loads(vehicle, force)


def _channels(vehicle: Vehicle, baseline: Baseline, motion: Motion, points: Points) -> Channels:
    """Channels that follow from the motion of all seven coordinates."""
    channels = {}
    for i, name in enumerate(("chassis.z", "chassis.pitch", "chassis.roll")):
        channels[name] = motion.q[:, i]
        channels[f"{name}_rate"] = motion.rate[:, i]
    travel, travel_rate = motion.q @ baseline.jounce.T, motion.rate @ baseline.jounce.T
    channels |= per_corner("wheel.{}.z", motion.q[:, WHEELS])
    channels |= per_corner("suspension.{}.travel", travel)
    preload = static_loads(vehicle).preload
    for i, corner in enumerate(CORNERS):
        suspension = vehicle.axle_at(corner).suspension
        spring_force = preload[corner] + suspension.stiffness * travel[:, i]
        channels[f"suspension.{corner}.spring_force"] = spring_force
        channels[f"suspension.{corner}.damper_force"] = suspension.damping * travel_rate[:, i]
    for point, (x, y, _) in points.items():
        channels[f"{point}.a_z"] = motion.acceleration[:, CHASSIS] @ np.array([1.0, -x, y])
    return channels


def _loads(vehicle: Vehicle, from_rest: NDArray) -> Channels:
    """Tyre loads from their changes (k, 4) since rest, N."""
    at_rest = static_loads(vehicle).tyre_load
    return per_corner("tyre.{}.load", from_rest + np.array([at_rest[c] for c in CORNERS]))


def per_corner(name: str, values: NDArray) -> Channels:
    """Columns of values (k, 4) under a channel's name with the corner in its place."""
    return {name.format(corner): values[:, i] for i, corner in enumerate(CORNERS)}


def _grid(duration: float, sample_step: float) -> tuple[NDArray[np.float64], float, int]:
    """Times of the integration, its step, and how many steps there are between samples."""
    step = _grid_step(sample_step)
    every = round(sample_step / step)
    samples = math.floor(duration / sample_step + 1e-9)
    return step * np.arange(samples * every + 1, dtype=np.float64), step, every


def _grid_step(sample_step: float) -> float:
    """The longest step up to LONGEST_STEP that divides the time between samples, s."""
    return sample_step / math.ceil(sample_step / LONGEST_STEP - 1e-9)


def _each(per_axle: list[float]) -> NDArray[np.float64]:
    """A value per axle as one per corner (4,)."""
    return np.repeat(np.array(per_axle, dtype=float), 2)
