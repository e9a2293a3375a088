"""Axes, corners and coordinates, stated once for the whole project.

Axes after ISO 8855: X forward, Y left, Z up; pitch is positive nose down, roll is positive with
the left side up. The body frame B sits at the sprung mass's centre of gravity and is parallel to
the inertial frame in the design position, the car at rest on flat ground.
"""

from typing import Literal

GRAVITY = 9.81
"""Gravity in the model, m/s2."""

CREEP_SPEED = 0.1
"""v0 of tanh(v/v0), m/s: rolling resistance and brakes fade out below it, so that a car at rest
stays at rest."""

Corner = Literal["fl", "fr", "rl", "rr"]
AxleName = Literal["front", "rear"]

CORNERS: tuple[Corner, ...] = ("fl", "fr", "rl", "rr")
AXLES: tuple[AxleName, ...] = ("front", "rear")

COORDINATES = (
    "chassis.x",
    "chassis.z",
    "chassis.pitch",
    "chassis.roll",
    "arm.fl.angle",
    "arm.fr.angle",
    "arm.rl.angle",
    "arm.rr.angle",
)
"""The eight generalized coordinates in the order of every state vector."""


def axle_of(corner: Corner) -> AxleName:
    """Name of the axle a corner belongs to."""
    return "front" if corner[0] == "f" else "rear"


def side_of(corner: Corner) -> int:
    """+1 for a left corner, -1 for a right one: the sign of its y coordinate."""
    return 1 if corner[1] == "l" else -1
