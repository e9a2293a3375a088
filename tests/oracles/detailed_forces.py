"""Every force of the detailed car but weight and ideal joints, written out by hand.

All in the inertial frame, as forces and torques on the CGs of the rigid groups. Body frames are
parallel to the design frame in the design position.
"""

import numpy as np


def cross(a, b):
    """Vector product along the last axis; np.cross takes four times as long on short arrays."""
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]


def turn(R, a):
    """R a for stacks of matrices (..., 3, 3) and vectors (..., 3)."""
    return (R @ a[..., None])[..., 0]


class DetailedForces:
    """Forces of one car's elements from the motion of its groups.

    groups : rigid groups;  index : group by body name
    """

    def __init__(self, car, groups, index):
        self.car, self.groups, self.index = car, groups, index
        self.force = np.zeros((len(groups), 3))
        self.torque = np.zeros((len(groups), 3))
        self._bushings()
        self._lines()
        wheels = car.wheels
        self.wheels = np.array([index[wheel.body] for wheel in wheels])
        self._w_arm = np.array([w.centre for w in wheels]) - [groups[k].cg for k in self.wheels]

    def _pairs(self, pairs, points):
        """Groups (2, n), points from their CGs (2, n, 3) and the sum over elements (groups, n)."""
        ends = np.array([[self.index[name] for name in pair] for pair in pairs]).T
        cgs = np.array([group.cg for group in self.groups])
        first, second = (np.arange(len(cgs))[:, None] == end for end in ends)
        return ends, np.asarray(points) - cgs[ends], np.stack([first, second]).astype(float)

    def _bushings(self):
        bushings = self.car.bushings
        laws = [self.car.law_named[bushing.law] for bushing in bushings]
        points = np.array([bushing.point for bushing in bushings])
        self._b = self._pairs([b.bodies for b in bushings], points)
        self._k = np.array([law.stiffness for law in laws])
        self._s = np.array([law.scale for law in laws])
        self._c = self._k * np.array([[law.time_constant] for law in laws])

    def _lines(self):
        lines = (*self.car.springs, *self.car.dampers)
        points = np.array([line.ends for line in lines]).transpose(1, 0, 2)
        self._l = self._pairs([line.bodies for line in lines], points)
        self._design = np.linalg.norm(points[0] - points[1], axis=1)
        springs = [self.car.strut(line.corner).spring for line in self.car.springs]
        self._spring = np.array([(one.stiffness, one.preload) for one in springs]).T
        struts = [self.car.strut(line.corner) for line in self.car.dampers]
        self._damper = np.array(
            [(s.damper.bump, s.damper.rebound, s.damper.speed) for s in struts]
        ).T
        self._stops = [
            (sign, *np.array([(one.gap, one.stiffness, one.cubic) for one in stops]).T)
            for sign, stops in (
                (1.0, [s.rebound_stop for s in struts]),
                (-1.0, [s.bump_stop for s in struts]),
            )
        ]

    def at(self, motion, height=0.0, rate=0.0):
        """Forces and torques (groups, 6) for x, R, v, w of the groups; the road at `height`."""
        self.now = motion
        self.force[:], self.torque[:] = 0.0, 0.0
        self._bushing_forces()
        self._line_forces()
        self._bar_torques()
        self._tyre_forces(height, rate)
        return np.hstack([self.force, self.torque])

    def wheel_motion(self):
        """Arms, velocities of the centres and axles (4, 3) of the wheels, and their spins (4,)."""
        _, R, v, w = self.now
        k = self.wheels
        arm, axle = turn(R[k], self._w_arm), R[k][:, :, 1]
        return arm, v[k] + cross(w[k], arm), axle, np.sum(w[k] * axle, axis=1)

    def push_wheels(self, arm, force, torque):
        """Add forces at the wheels' centres and torques (4, 3) on the wheels."""
        self.force[self.wheels] += force
        self.torque[self.wheels] += cross(arm, force) + torque

    def _ends(self, ends, arms):
        x, R, v, w = self.now
        turned = turn(R[ends], arms)
        return turned, x[ends] + turned, v[ends] + cross(w[ends], turned)

    def _pull(self, sums, turned, force, torque=0.0):
        """A force and a torque (n, 3) on the first ends and their opposites on the second."""
        moment = cross(turned, force)
        self.force += (sums[0] - sums[1]) @ force
        self.torque += sums[0] @ (moment[0] + torque) - sums[1] @ (moment[1] + torque)

    def _bushing_forces(self):
        _, R, _, w = self.now
        ends, arms, sums = self._b
        turned, p, v = self._ends(ends, arms)
        A, back = R[ends[0]], R[ends[0]].transpose(0, 2, 1)
        relative = back @ R[ends[1]]
        first = np.arctan2(-relative[:, 1, 2], relative[:, 2, 2])
        second = np.arcsin(relative[:, 0, 2])
        third = np.arctan2(-relative[:, 0, 1], relative[:, 0, 0])
        apart = p[1] - p[0]
        # The displacement turns with the first body, and so does its rate.
        rate = v[1] - v[0] - cross(w[ends[0]], apart)
        u = np.hstack([turn(back, apart), np.stack([first, second, third], 1)])
        u_rate = np.hstack([turn(back, rate), turn(back, w[ends[1]] - w[ends[0]])])
        through = u_rate / self.car.bushing_speed
        f = self._k * u * (1.0 + (u / self._s) ** 2) + self._c * u_rate / np.sqrt(1.0 + through**2)
        self._pull(sums, turned, turn(A, f[:, :3]), turn(A, f[:, 3:]))

    def _line_forces(self):
        ends, arms, sums = self._l
        turned, p, v = self._ends(ends, arms)
        apart = p[1] - p[0]
        length = np.sqrt(np.sum(apart * apart, axis=1))
        along = apart / length[:, None]
        rate = np.sum((v[1] - v[0]) * along, axis=1)[4:]
        longer = length - self._design
        stiffness, preload = self._spring
        bump, rebound, speed = self._damper
        c = np.where(rate > 0.0, rebound, bump)
        damper = c * rate / np.sqrt(1.0 + (rate / speed) ** 2)
        for sign, gap, linear, cubic in self._stops:
            d = np.maximum(sign * longer[4:] - gap, 0.0)
            damper += sign * (linear * d + cubic * d**3)
        tension = np.hstack([stiffness * longer[:4] - preload, damper])
        self._pull(sums, turned, tension[:, None] * along)

    def _bar_torques(self):
        _, R, _, w = self.now
        for bar in self.car.stabilizer_bars:
            a, b = (self.index[name] for name in bar.bodies)
            y = R[a][:, 1]
            relative = R[a].T @ R[b]
            angle = np.arctan2(relative[0, 2], relative[0, 0])
            torque = (bar.stiffness * angle + bar.damping * (w[b] - w[a]) @ y) * y
            self.torque[a] += torque
            self.torque[b] -= torque

    def _tyre_forces(self, height, rate):
        x, t = self.now[0], self.car.tyre
        arm, velocity, _, _ = self.wheel_motion()
        squeeze = t.free_radius + height - x[self.wheels, 2] - arm[:, 2]
        load = t.stiffness * squeeze + t.damping * (rate - velocity[:, 2])
        self.load = np.maximum(load, 0.0)
        self.push_wheels(arm, self.load[:, None] * np.array([0.0, 0.0, 1.0]), 0.0)
