"""The car's points and static loads, worked out once more from the vehicle's data alone.

Nothing here comes from the engine's equations: it serves the tests as an oracle and other programs
as the same car.

Points: P pivot, C wheel centre, G centre of gravity, A mount, given in the chassis's frame B as
they lie at rest. q = (x, z, pitch, roll, a_fl, a_fr, a_rl, a_rr).
"""

from dataclasses import dataclass
from math import tan

import numpy as np
from numpy.typing import NDArray

from ...engine.vehicle import Axle, Vehicle

Array = NDArray[np.float64]

GRAVITY = 9.81
CORNERS = ("fl", "fr", "rl", "rr")


@dataclass(frozen=True)
class Corner:
    """Points of one corner in B at rest, m, and what acts there at rest, N."""

    axle: Axle
    front: bool
    p_C: Array
    p_P: Array
    p_A: Array
    p_G: Array
    preload: float
    tyre_load: float

    @property
    def inertia(self) -> Array:
        """Inertia tensor of wheel, arm and moving parts at G, kg m2."""
        inertia = self.axle.wheel.inertia
        return np.diag([inertia.xx, inertia.yy, inertia.zz])


def corners_of(vehicle: Vehicle) -> list[Corner]:
    """The four corners; preloads and static tyre loads from moment balances, not from formulas."""
    h, placed = vehicle.chassis.cg_height, []
    for name in CORNERS:
        front, side = name[0] == "f", 1 if name[1] == "l" else -1
        axle = vehicle.front if front else vehicle.rear
        inwards, d = (-1 if front else 1), axle.pivot.distance
        x_C = axle.cg_distance if front else -axle.cg_distance
        p_C = np.array([x_C, side * axle.track / 2, axle.wheel.radius - h])
        p_P = np.array([x_C + inwards * d, p_C[1], d * tan(axle.pivot.angle) - h])
        p_A = p_C + [0, 0, axle.suspension.mount_height]
        # F0 = W0 - m g (1 - c/d) holds for either sign of d if c counts the way d does.
        along, outwards, up = axle.wheel.cg_offset
        p_G = p_C + [inwards * along, side * outwards, up]
        placed.append((axle, front, p_C, p_P, p_A, p_G))

    # The car as one body: vertical forces and moments about y of the tyre loads balance weight.
    # Left and right are alike, so a wheel carries half of its axle's load.
    masses = np.array([corner[0].wheel.mass for corner in placed])
    weight = GRAVITY * (vehicle.chassis.mass + masses.sum())
    moment = GRAVITY * sum(m * corner[5][0] for m, corner in zip(masses, placed, strict=True))
    loads = np.linalg.solve([[2, 2], [2 * placed[0][2][0], 2 * placed[2][2][0]]], [weight, moment])

    corners = []
    for axle, front, p_C, p_P, p_A, p_G in placed:
        load = float(loads[0 if front else 1])
        # The arm alone, moments about the pivot: tyre load up, weight and preload down.
        arm_C, arm_G = p_C[0] - p_P[0], p_G[0] - p_P[0]
        preload = float(load - axle.wheel.mass * GRAVITY * arm_G / arm_C)
        corners.append(Corner(axle, front, p_C, p_P, p_A, p_G, preload, load))
    return corners
