"""Motion of points from the coordinates of rigid bodies: CG and Tait-Bryan angles xyz.

    R = Rx(a) Ry(b) Rz(c),    w = a' x + b' Rx y + c' Rx Ry z

Arrays end in the three components; what stands before (samples, bodies) is carried along.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Axes(NamedTuple):
    """The three axes about which the angles turn, in the inertial frame, each (..., 3)."""

    first: Array
    second: Array
    third: Array


def axes(angles: Array) -> Axes:
    """x, Rx y and Rx Ry z for angles (..., 3)."""
    a, b = angles[..., 0], angles[..., 1]
    none, one = np.zeros_like(a), np.ones_like(a)
    return Axes(
        np.stack([one, none, none], -1),
        np.stack([none, np.cos(a), np.sin(a)], -1),
        np.stack([np.sin(b), -np.sin(a) * np.cos(b), np.cos(a) * np.cos(b)], -1),
    )


def rotation(angles: Array) -> Array:
    """R (..., 3, 3) for angles (..., 3)."""
    a, b, c = angles[..., 0], angles[..., 1], angles[..., 2]
    sa, ca, sb, cb, sc, cc = np.sin(a), np.cos(a), np.sin(b), np.cos(b), np.sin(c), np.cos(c)
    rows = [
        [cb * cc, -cb * sc, sb],
        [ca * sc + sa * sb * cc, ca * cc - sa * sb * sc, -sa * cb],
        [sa * sc - ca * sb * cc, sa * cc + ca * sb * sc, ca * cb],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def spin(angles: Array, rates: Array) -> Array:
    """Angular velocity w (..., 3)."""
    one, two, three = axes(angles)
    return rates[..., :1] * one + rates[..., 1:2] * two + rates[..., 2:] * three


def spin_rate(angles: Array, rates: Array, seconds: Array) -> Array:
    """Angular acceleration (..., 3); seconds : second derivatives of the angles."""
    one, two, three = axes(angles)
    first, second, third = (rates[..., k : k + 1] for k in range(3))
    turning = first * second * np.cross(one, two)
    turning = turning + third * np.cross(first * one + second * two, three)
    return spin(angles, seconds) + turning


def point(q: Array, offset: Array) -> Array:
    """Position (..., 3) of a body's point at `offset` (3,) from its CG in its own frame."""
    return q[..., :3] + rotation(q[..., 3:]) @ offset


def point_velocity(q: Array, qd: Array, offset: Array) -> Array:
    """Velocity (..., 3) of that point."""
    arm = rotation(q[..., 3:]) @ offset
    return qd[..., :3] + np.cross(spin(q[..., 3:], qd[..., 3:]), arm)


def point_acceleration(q: Array, qd: Array, qdd: Array, offset: Array) -> Array:
    """Acceleration (..., 3) of that point."""
    arm = rotation(q[..., 3:]) @ offset
    w = spin(q[..., 3:], qd[..., 3:])
    swinging = np.cross(spin_rate(q[..., 3:], qd[..., 3:], qdd[..., 3:]), arm)
    return qdd[..., :3] + swinging + np.cross(w, np.cross(w, arm))
