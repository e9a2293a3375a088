"""A bound on how fast a car's motions on a road or a rig can change, from its record alone.

Linearised in the design position at rest, M q'' + C q' + K q = 0. For an eigenvalue s whose vector
q is scaled so that q* M q = 1,

    s^2 + c s + k = 0,   c = q* C q,   k = q* K q,   hence   |s| <= (|c| + sqrt(|c|^2 + 4 |k|)) / 2

and bounds on |c| and |k| for all such q do. With c the chassis's coordinates, a_i the arms' and the
names of (4) and (5) in docs/model.md,

    q* M q = sum |A_i|^2 + c* S c,   A_i = sqrt(M_i) (a_i + m_i . c / M_i),   S >= diag(I)

where I are the sprung mass's own inertias: eliminating an arm leaves nothing negative of its
corner's mass matrix. An element of rate k that feels g . q = g_c . c + g_a a_i feels both parts,

    |g . q| <= sqrt(u) |A_i| + sqrt(w) |c|_S,   u = g_a^2 / M_i,   w = |g_c - g_a m_i / M_i|^2 / I

and for all elements together, by (a + b)^2 <= (1 + t) a^2 + (1 + 1/t) b^2 with t = R / P,

    sum k |g . q|^2 <= P + R,   P = greatest of any corner's sum k u,   R = sum k w of all corners

Springs feel g_a = s_x, tyres the wheel centre's rise (1, -X, Y) and -s_x, dampers of both likewise,
those of the suspension with the steeper of their slopes; a bar feels two arms, at most 2 k / M_i of
each. What the constant forces at rest add to K is

    sum over corners of (W0 (r_w - h) - m g C_z) (p^2 + r^2) + 2 B_i p a_i + (B_i - F_i) a_i^2
    B_i = W0 s_z - m g p_z,   F_i = F0 (s_z + s_z^2 / L0)

(the second-order rise of wheel centre and corner, and travel of the spring), taken by its size with
2 |p a_i| <= t |p|^2 + |a_i|^2 / t, t = sqrt(I_yy / M_i). Rolling resistance and brakes push along h
in proportion to x' alone: |q* h x'| <= |h| |x'|, in the norms that belong to M.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..frames import CREEP_SPEED, GRAVITY
from ..kernels.buffer import BODY_ROWS
from ..kernels.records import Body, Corner

Array = NDArray[np.float64]


def fastest_on_road(cars: Array, brake: Array) -> Array:
    """No eigenvalue of the cars (C, CAR_ROWS) under brake torques (4,) or (C, 4), N m, at rest is
    greater than this (C,), 1/s.
    """
    body = Body(*cars[:, :BODY_ROWS].T)
    corners = cars[:, BODY_ROWS:].reshape(len(cars), 4, -1)
    return _Linearised(body, Corner(*np.ascontiguousarray(corners.T)), np.transpose(brake)).bound()


class _Linearised:
    """Cars as the bound sees them; what belongs to a corner is (4, C), to the body (C,)."""

    def __init__(self, body: Any, corner: Any, brake: Array):
        self.body, self.corner = body, corner
        self.brake = brake.reshape(4, -1)
        mass, x, z = corner.mass, corner.cg_x, corner.cg_z
        self.cg_z = corner.pivot_z + z
        self.inertia = corner.yy + mass * (x * x + z * z)
        self.own = (body.mass, body.mass, body.yy, body.xx)
        self.coupling = (
            mass * z / self.inertia,
            -mass * x / self.inertia,
            (mass * (self.cg_z * z + (corner.pivot_x + x) * x) + corner.yy) / self.inertia,
            -mass * (corner.pivot_y + corner.cg_y) * x / self.inertia,
        )

    def bound(self) -> Array:
        """(|c| + sqrt(|c|^2 + 4 |k|)) / 2."""
        body, corner = self.body, self.corner
        damping = self._pushed_along() + self._felt(
            np.maximum(corner.jounce_damping, corner.rebound_damping),
            corner.tyre_damping,
            body.front_bar_damping,
            body.rear_bar_damping,
        )
        stiffness = self._felt(
            corner.stiffness,
            corner.tyre_stiffness,
            body.front_bar_stiffness,
            body.rear_bar_stiffness,
            *self._constant_forces(),
        )
        return 0.5 * (damping + np.sqrt(damping * damping + 4.0 * stiffness))

    def _felt(
        self,
        strut: Array,
        tyre: Array,
        front_bar: Array,
        rear_bar: Array,
        arm: Any = 0.0,
        rest: Any = 0.0,
    ) -> Array:
        """P + R of rates of struts, tyres and bars, of a rate on every arm's angle, and a rest of
        the chassis alone.
        """
        corner, zero = self.corner, (0.0, 0.0, 0.0, 0.0)
        rise = (0.0, 1.0, -corner.pivot_x - corner.arm_x, corner.pivot_y)
        square = corner.arm_x * corner.arm_x
        bars = np.stack([front_bar, front_bar, rear_bar, rear_bar])
        of_arms = (square * (strut + tyre) + arm + 2.0 * bars) / self.inertia
        of_chassis = (square * strut + arm) * self._on_chassis(zero, 1.0)
        of_chassis += tyre * self._on_chassis(rise, -corner.arm_x)
        apart = [one[::2] - one[1::2] for one in self.coupling]
        bar = np.stack([front_bar, rear_bar]) * self._square(apart)
        return of_arms.max(axis=0) + of_chassis.sum(axis=0) + bar.sum(axis=0) + rest

    def _on_chassis(self, of_chassis: Sequence[Any], of_arm: Any) -> Array:
        """w of elements that feel these parts of the motion."""
        return self._square(
            [one - of_arm * m for one, m in zip(of_chassis, self.coupling, strict=True)]
        )

    def _square(self, parts: Sequence[Any]) -> Array:
        """Sum of squares over the sprung mass's own inertias."""
        x, z, pitch, roll = (one * one / own for one, own in zip(parts, self.own, strict=True))
        return x + z + pitch + roll

    def _constant_forces(self) -> tuple[Array, Array]:
        """What they add to the rate of every arm's angle, and to R of the chassis alone."""
        body, corner = self.body, self.corner
        weight = GRAVITY * corner.mass
        centre_z = corner.pivot_z + corner.arm_z
        attitude = np.abs((corner.static_load * centre_z - weight * self.cg_z).sum(axis=0))
        both = corner.static_load * corner.arm_z - weight * corner.cg_z
        element = corner.preload * (corner.arm_z + corner.arm_z**2 / corner.rest_length)
        t = np.sqrt(body.yy / self.inertia)
        arm = np.abs(both - element) + np.abs(both) / t
        rest = attitude / np.minimum(body.yy, body.xx)
        return arm, rest + (np.abs(both) * t).sum(axis=0) / body.yy

    def _pushed_along(self) -> Array:
        """|h| |x'|."""
        corner = self.corner
        force = self.brake / corner.radius + corner.rolling_resistance * corner.static_load
        torque = force * (corner.arm_z - corner.radius) + corner.brake_reaction * self.brake
        below = corner.pivot_z + corner.arm_z - corner.radius
        ahead, turning = force.sum(axis=0), (force * below).sum(axis=0)
        carried = [(torque * one).sum(axis=0) for one in self.coupling]
        of_chassis = (ahead - carried[0], -carried[1], turning - carried[2], -carried[3])
        size = (torque * torque / self.inertia).sum(axis=0) + self._square(of_chassis)
        return np.sqrt(size / self.body.mass) / CREEP_SPEED
