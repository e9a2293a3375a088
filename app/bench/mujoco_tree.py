"""The car's five bodies as MuJoCo's tree, for the tests as an oracle and for the benchmark."""

from collections.abc import Sequence
from importlib import import_module
from math import atan2, cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...engine.vehicle import Inertia, Inertia3, Vehicle
from .car_points import CORNERS, GRAVITY, Corner

mujoco: Any = import_module("mujoco")  # made at run time, out of sight of the type checker

Array = NDArray[np.float64]


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
