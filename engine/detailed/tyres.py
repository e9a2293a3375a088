"""Four tyres: what the road does to the wheels in one step.

The vertical load W acts between wheel centre and road and is solved with the car (`laws`). Forces
along the road follow the slip velocity of the contact against the road, (v_x - r w, v_y), through a
deflection u that builds up over the relaxation length s and works from standstill on:

    du/dt = v_slip - |v_x| u / s,    F = -(C / s) u,    |F| <= mu W

u is advanced once a step by the implicit Euler rule. F acts at the rolling radius below the wheel
centre; rolling resistance is a torque fr W r tanh(v_x/v0) against the wheel.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..frames import CREEP_SPEED
from .pose import axes
from .records import TyreData

Array = NDArray[np.float64]

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class WheelMotion:
    """Four wheels at one time, in the inertial frame.

    centre, velocity (4, 3) : of the wheel centres;  axle (4, 3) : unit vectors, left
    spin (4,) : about the axle, rad/s
    """

    centre: Array
    velocity: Array
    axle: Array
    spin: Array


def wheel_motion(q: Array, qd: Array, offset: Array) -> WheelMotion:
    """Motion of wheels from coordinates (4, 6), whose third angle turns about the axle.

    offset (4,) : the centre from the CG along the axle, m
    """
    first, second, axle = axes(q[:, 3:])
    swing = np.cross(qd[:, 3:4] * first + qd[:, 4:5] * second, axle)
    return WheelMotion(
        centre=q[:, :3] + offset[:, np.newaxis] * axle,
        velocity=qd[:, :3] + offset[:, np.newaxis] * swing,
        axle=axle,
        spin=qd[:, 5] + qd[:, 3] * axle[:, 0],
    )


class Tyres:
    """The tyres' deflections along and across, advanced step by step."""

    def __init__(self, tyre: TyreData):
        self.tyre = tyre
        slips = (tyre.longitudinal, tyre.lateral)
        self._relaxation = np.array([slip.relaxation_length for slip in slips])
        self._stiffness = np.array([slip.slip_stiffness for slip in slips]) / self._relaxation
        self._deflection = np.zeros((4, 2))

    def load(self, motion: WheelMotion, height: Array, rate: Array) -> Array:
        """Vertical loads W (4,), N, on a road of some height, m, that rises at a rate, m/s."""
        squeeze = self.tyre.free_radius + height - motion.centre[:, 2]
        damping = self.tyre.damping * (rate - motion.velocity[:, 2])
        return np.maximum(self.tyre.stiffness * squeeze + damping, 0.0)

    def advance(self, motion: WheelMotion, load: Array, step: float) -> tuple[Array, Array]:
        """Forces (4, 3) at the wheel centres and torques (4, 3) on the wheels after a step."""
        radius = self.tyre.rolling_radius
        forward = np.cross(motion.axle, UP)
        forward /= np.sqrt(np.sum(forward * forward, axis=1))[:, np.newaxis]
        aside = np.cross(UP, forward)
        along = np.sum(motion.velocity * forward, axis=1)
        across = np.sum(motion.velocity * aside, axis=1)
        slip = np.stack([along - radius * motion.spin, across], axis=1)
        fading = 1.0 + step * np.abs(along)[:, np.newaxis] / self._relaxation
        deflection = (self._deflection + step * slip) / fading
        pulled = self._stiffness * deflection
        strength = np.sqrt(np.sum(pulled * pulled, axis=1))
        grip = self.tyre.friction * load
        share = np.minimum(1.0, grip / np.maximum(strength, 1e-9))[:, np.newaxis]
        self._deflection = share * deflection
        force = -share * (pulled[:, :1] * forward + pulled[:, 1:] * aside)
        rolling = self.tyre.rolling_resistance * load * radius * np.tanh(along / CREEP_SPEED)
        torque = -radius * np.cross(UP, force) - rolling[:, np.newaxis] * motion.axle
        return force, torque
