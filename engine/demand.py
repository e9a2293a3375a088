"""What a manoeuvre asks of one car: torques over time, a road or the motion of a rig's posts.

The car's way along the road, as far as it decides where the road begins, changes and ends, is that
of a point mass under the same torques (x: distance of the CG, v = dx/dt):

    M dv/dt = sum T_i/r_i - tanh(v/v0) (sum B_i/r_i + sum fr_i W0_i)
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from .equilibrium import loads_at_rest
from .frames import CORNERS, CREEP_SPEED, GRAVITY
from .roads.road import Road
from .vehicle import Vehicle

SAME_INSTANT = 1e-9
"""Knots closer than this are one to the point mass's motion, s."""


@dataclass(frozen=True, eq=False)
class PiecewiseLinear:
    """Four functions of time, linear between knots and held outside them.

    time : (k,) knots, s, not decreasing, k >= 2; a doubled knot is a jump
    values : (k, 4) in the order of CORNERS
    """

    time: NDArray[np.float64]
    values: NDArray[np.float64]

    @classmethod
    def zero(cls, duration: float) -> "PiecewiseLinear":
        """No torque at all."""
        return cls(np.array([0.0, duration]), np.zeros((2, 4)))

    @property
    def knots(self) -> NDArray[np.float64]:
        """Times at which the slope or the value may jump, each once."""
        return np.unique(self.time)

    def at(self, t: ArrayLike, side: Literal["left", "right"] = "right") -> NDArray[np.float64]:
        """Values (..., 4) just before (`left`) or just after (`right`) the times t."""
        t = np.asarray(t, dtype=float)
        first = np.searchsorted(self.time, t, side=side) - 1
        first = np.clip(first, 0, self.time.size - 2)
        begin, end = self.time[first], self.time[first + 1]
        width = np.where(end > begin, end - begin, 1.0)
        past = (t > end) | ((t == end) & (side == "right"))
        share = np.where(end > begin, np.clip((t - begin) / width, 0.0, 1.0), past)
        share = share[..., np.newaxis]
        return (1.0 - share) * self.values[first] + share * self.values[first + 1]


@dataclass(frozen=True, eq=False)
class PostMotion:
    """Heights of a rig's four posts, sampled finely enough for a C2 spline through them.

    time : (k,) s, increasing
    height : (k, 4) m, in the order of CORNERS, from the height at rest
    """

    time: NDArray[np.float64]
    height: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Demand:
    """Everything that acts on one car from outside during a manoeuvre.

    drive : torque on each wheel, N m
    brake : brake torque on each wheel as a positive number, N m
    road : None on a rig; posts : None on a road
    """

    duration: float
    initial_speed: float
    drive: PiecewiseLinear
    brake: PiecewiseLinear
    road: Road | None
    posts: PostMotion | None = None

    @property
    def size(self) -> int:
        """How many numbers its road and posts take."""
        road = 0 if self.road is None else self.road.coefficients.size
        return road + (0 if self.posts is None else self.posts.height.size)


@dataclass(frozen=True, eq=False)
class PointMassMotion:
    """The car as a point mass at uniform times (n,): distance m, speed m/s, acceleration m/s2."""

    time: NDArray[np.float64]
    x: NDArray[np.float64]
    v: NDArray[np.float64]
    a: NDArray[np.float64]

    def distance(self, t: float) -> float:
        """x at time t, m."""
        return float(np.interp(t, self.time, self.x))


def rolling_resistance(vehicle: Vehicle) -> float:
    """Rolling resistance of the whole car at rest over its weight: sum fr_i W0_i / sum W0_i."""
    loads = loads_at_rest(vehicle).tyre_load
    resisted = sum(vehicle.axle_at(c).tyre.rolling_resistance * loads[c] for c in CORNERS)
    return resisted / sum(loads[c] for c in CORNERS)


def point_mass_motion(
    vehicle: Vehicle,
    drive: PiecewiseLinear,
    brake: PiecewiseLinear,
    initial_speed: float,
    duration: float,
    steps: int = 2000,
) -> PointMassMotion:
    """Motion of the car's mass along X under given torques from x = 0 at steps + 1 times."""
    per_mass = np.array([1.0 / vehicle.axle_at(c).wheel.radius for c in CORNERS])
    per_mass /= vehicle.total_mass
    knots = np.union1d(drive.knots, brake.knots)
    inner = knots[(knots > SAME_INSTANT) & (knots < duration - SAME_INSTANT)]
    apart = np.diff(inner, prepend=0.0) > SAME_INSTANT
    ends = np.concatenate(([0.0], inner[apart], [duration]))
    pieces = []
    for torque in (drive, brake):
        pieces.append(tuple((torque.at(ends[:-1] + SAME_INSTANT) @ per_mass).tolist()))
        pieces.append(tuple((torque.at(ends[1:] - SAME_INSTANT) @ per_mass).tolist()))
    rolling = rolling_resistance(vehicle) * GRAVITY
    return _point_mass(tuple(ends.tolist()), *pieces, rolling, initial_speed, steps)


@lru_cache(maxsize=32)
def _point_mass(
    ends: tuple[float, ...],
    drive_begin: tuple[float, ...],
    drive_end: tuple[float, ...],
    brake_begin: tuple[float, ...],
    brake_end: tuple[float, ...],
    rolling: float,
    initial_speed: float,
    steps: int,
) -> PointMassMotion:
    """The motion from accelerations (m/s2) that are linear between `ends`, piece by piece.

    The suspension's parameters play no part, so moving a slider finds the motion in the cache.
    """
    time = np.linspace(0.0, ends[-1], steps + 1)
    states = np.empty((3, time.size))
    state = np.array([0.0, initial_speed])
    for i, (begin, end) in enumerate(zip(ends, ends[1:], strict=False)):

        def rate_of_speed(t, v):
            share = (t - begin) / (end - begin)
            drive = drive_begin[i] + share * (drive_end[i] - drive_begin[i])
            brake = brake_begin[i] + share * (brake_end[i] - brake_begin[i])
            return drive - math.tanh(v / CREEP_SPEED) * (brake + rolling)

        solution = solve_ivp(
            lambda t, y: [y[1], rate_of_speed(t, y[1])],
            (begin, end),
            state,
            method="LSODA",
            rtol=1e-8,
            atol=1e-9,
            dense_output=True,
        )
        inside = (time >= begin) & (time <= end)
        if inside.any():
            states[:2, inside] = solution.sol(time[inside])
            states[2, inside] = np.vectorize(rate_of_speed)(time[inside], states[1, inside])
        state = solution.y[:, -1]
    states.flags.writeable = False
    time.flags.writeable = False
    return PointMassMotion(time, *states)
