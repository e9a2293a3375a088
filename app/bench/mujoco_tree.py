"""The car's five bodies as MuJoCo's tree, with the points and static loads that forces need.

Nothing here comes from the engine but the vehicle's data: the tree serves the tests as an oracle
and the benchmark as a peer.

Points: P pivot, C wheel centre, G centre of gravity, A mount, given in the chassis's frame B as
they lie at rest. q = (x, z, pitch, roll, a_fl, a_fr, a_rl, a_rr).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from math import atan2, cos, sin, tan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...engine.vehicle import Axle, Inertia, Inertia3, Vehicle

mujoco: Any = import_module("mujoco")  # made at run time, out of sight of the type checker

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
        return np.diag(_principal(self.axle.wheel.inertia))


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


def tree_of(vehicle: Vehicle, corners: Sequence[Corner]) -> Any:
    """The tree as an MjSpec to compile, with bodies `chassis` and those named in CORNERS.

    It feels gravity and nothing else; joints are x, z, pitch, roll and arm_{corner}.
    """
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, -GRAVITY]
    spec.option.disableflags = (
        mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
    )
    spec.compiler.balanceinertia = False
    spec.compiler.boundmass = spec.compiler.boundinertia = 0
    spec.compiler.fusestatic = False
    data = vehicle.chassis
    chassis = spec.worldbody.add_body(name="chassis", pos=[0, 0, data.cg_height])
    _set_inertia(chassis, data.mass, np.zeros(3), *_principal_frame(data.inertia))
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    chassis.add_joint(name="x", type=slide, axis=[1, 0, 0])
    chassis.add_joint(name="z", type=slide, axis=[0, 0, 1])
    chassis.add_joint(name="pitch", type=hinge, axis=[0, 1, 0])
    chassis.add_joint(name="roll", type=hinge, axis=[1, 0, 0])
    for name, corner in zip(CORNERS, corners, strict=True):
        wheel = corner.axle.wheel
        arm = chassis.add_body(name=name, pos=corner.p_P)
        _set_inertia(arm, wheel.mass, corner.p_G - corner.p_P, _principal(wheel.inertia))
        arm.add_joint(name=f"arm_{name}", type=hinge, axis=[0, 1, 0])
    return spec


def _principal(inertia: Inertia3) -> list[float]:
    return [inertia.xx, inertia.yy, inertia.zz]


def _principal_frame(inertia: Inertia) -> tuple[list[float], list[float]]:
    """Principal moments and the quaternion (w, x, y, z) of their frame, turned about y.

    Turned by b about y the xz element is xz cos 2b + (xx - zz)/2 sin 2b; b makes it zero.
    """
    xx, zz, xz = inertia.xx, inertia.zz, inertia.xz
    b = 0.5 * atan2(-2 * xz, xx - zz)
    c, s = cos(b), sin(b)
    moments = [
        c * c * xx - 2 * c * s * xz + s * s * zz,
        inertia.yy,
        s * s * xx + 2 * c * s * xz + c * c * zz,
    ]
    return moments, [cos(b / 2), 0, sin(b / 2), 0]


def _set_inertia(
    body: Any, mass: float, offset: Array, principal: list[float], quaternion: Any = (1, 0, 0, 0)
) -> None:
    """Give a body its mass and inertia without MuJoCo's own eigenvalue search (1e-12 only)."""
    body.mass, body.ipos, body.iquat, body.inertia = mass, offset, quaternion, principal
    body.explicitinertial = True
