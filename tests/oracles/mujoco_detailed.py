"""The detailed car a second time: MuJoCo's free bodies, every joint and force by hand.

MuJoCo carries one free body a rigid group: attitudes, mass matrix and weight are its own. What the
joints let happen and what every other element does is written out in the inertial frame. At rest

    N^T f = 0,    N : motions that no joint hinders,    f : all forces but the joints'
"""

import mujoco
import numpy as np
from ridetune.engine.detailed.rigid import frame_about, rigid_groups
from ridetune.engine.frames import GRAVITY
from scipy.linalg import null_space


class MujocoDetailedCar:
    """Free bodies with the car's forces on them."""

    def __init__(self, car):
        self.car, self.groups = car, rigid_groups(car)
        self.index = {name: k for k, g in enumerate(self.groups) for name in g.names}
        spec = mujoco.MjSpec()
        spec.option.gravity = [0.0, 0.0, -GRAVITY]
        for group in self.groups:
            body = spec.worldbody.add_body(name=group.names[0], pos=group.cg)
            body.add_freejoint()
            I = group.inertia
            body.mass, body.explicitinertial = group.mass, True
            body.fullinertia = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._joints()
        self._bushings()
        self._lines()
        self._wheels()

    def _arms(self, pairs, points):
        """Indices (2, n) of both bodies and the points from their CGs (2, n, 3), design axes."""
        ends = np.array([[self.index[name] for name in pair] for pair in pairs]).T
        cgs = np.array([group.cg for group in self.groups])
        return ends, np.asarray(points) - cgs[ends]

    def _joints(self):
        self.joints = joints = [j for j in self.car.joints if j.kind != "fixed"]
        points = np.array([joint.point for joint in joints])
        self.j_ends, self.j_arms = self._arms([j.bodies for j in joints], points)
        self.j_frame = np.array([frame_about(np.array(j.axis or (0, 0, 1.0))) for j in joints])

    def _bushings(self):
        bushings = self.car.bushings
        laws = [self.car.law_named[bushing.law] for bushing in bushings]
        points = np.array([bushing.point for bushing in bushings])
        self.b_ends, self.b_arms = self._arms([b.bodies for b in bushings], points)
        self.b_k = np.array([law.stiffness for law in laws])
        self.b_s = np.array([law.scale for law in laws])
        self.b_c = self.b_k * np.array([[law.time_constant] for law in laws])

    def _lines(self):
        lines = (*self.car.springs, *self.car.dampers)
        points = np.array([line.ends for line in lines]).transpose(1, 0, 2)
        self.l_ends, self.l_arms = self._arms([line.bodies for line in lines], points)
        self.l_design = np.linalg.norm(points[0] - points[1], axis=1)
        self.l_strut = [self.car.strut(line.corner) for line in lines]

    def _wheels(self):
        wheels = self.car.wheels
        self.w = np.array([self.index[wheel.body] for wheel in wheels])
        self.w_arm = np.array([w.centre for w in wheels]) - [self.groups[k].cg for k in self.w]

    # --- forces -------------------------------------------------------------------------------

    def _state(self):
        d, n = self.data, len(self.groups)
        R = d.xmat[1:].reshape(n, 3, 3)
        qvel = d.qvel.reshape(n, 6)
        w = np.einsum("nij,nj->ni", R, qvel[:, 3:])
        return d.xpos[1:], R, qvel[:, :3], w

    def _ends(self, ends, arms):
        x, R, v, w = self.now
        turned = np.einsum("enij,enj->eni", R[ends], arms)
        return turned, x[ends] + turned, v[ends] + np.cross(w[ends], turned)

    def _pull(self, ends, turned, force):
        """A force (n, 3) on the first ends and its opposite on the second."""
        for end, sign in ((0, 1.0), (1, -1.0)):
            np.add.at(self.force, ends[end], sign * force)
            np.add.at(self.torque, ends[end], sign * np.cross(turned[end], force))

    def _twist(self, ends, torque):
        np.add.at(self.torque, ends[0], torque)
        np.add.at(self.torque, ends[1], -torque)

    def admissible(self):
        """Motions (6 groups, n) of CGs and spins that no joint hinders where the bodies are."""
        _, R, _, _ = self.now
        turned, points, _ = self._ends(self.j_ends, self.j_arms)
        turned[0] += points[1] - points[0]  # a slide is held where the second body is
        A, B = (R[end] @ self.j_frame for end in self.j_ends)
        rows = []
        for k, joint in enumerate(self.joints):
            x, y, z = A[k].T
            held = [x, y] if joint.kind == "cylindrical" else [x, y, z]
            for axis in held:
                rows.append(self._row(k, axis, [np.cross(turned[end, k], axis) for end in (0, 1)]))
            if joint.kind in ("revolute", "cylindrical"):
                rows += [self._row(k, 0.0 * axis, [axis, axis]) for axis in (x, y)]
            if joint.kind == "universal":
                square = np.cross(x, B[k][:, 1])
                rows.append(self._row(k, 0.0 * x, [square, square]))
        return null_space(np.array(rows))

    def _row(self, k, along, about):
        row = np.zeros((len(self.groups), 6))
        for end, sign in ((0, -1.0), (1, 1.0)):
            row[self.j_ends[end, k]] += sign * np.hstack([along, about[end]])
        return row.ravel()

    def _bushing_forces(self):
        _, R, _, w = self.now
        ends, speed = self.b_ends, self.car.bushing_speed
        turned, p, v = self._ends(ends, self.b_arms)
        A = R[ends[0]]
        relative = np.einsum("nji,njk->nik", A, R[ends[1]])
        first = np.arctan2(-relative[:, 1, 2], relative[:, 2, 2])
        second = np.arcsin(relative[:, 0, 2])
        third = np.arctan2(-relative[:, 0, 1], relative[:, 0, 0])
        angle = np.stack([first, second, third], 1)
        # The displacement turns with the first body, and so does its rate.
        rate = v[1] - v[0] - np.cross(w[ends[0]], p[1] - p[0])
        local = lambda a: np.einsum("nji,nj->ni", A, a)  # noqa: E731
        u = np.hstack([local(p[1] - p[0]), angle])
        u_rate = np.hstack([local(rate), local(w[ends[1]] - w[ends[0]])])
        f = self.b_k * u * (1 + (u / self.b_s) ** 2)
        f += self.b_c * u_rate / np.sqrt(1 + (u_rate / speed) ** 2)
        back = np.einsum("nij,nkj->nki", A, f.reshape(-1, 2, 3))
        self._pull(ends, turned, back[:, 0])
        self._twist(ends, back[:, 1])

    def _line_forces(self):
        turned, p, v = self._ends(self.l_ends, self.l_arms)
        apart = p[1] - p[0]
        length = np.linalg.norm(apart, axis=1)
        along = apart / length[:, None]
        rate = np.einsum("ni,ni->n", v[1] - v[0], along)
        tension = np.zeros(8)
        for k, strut in enumerate(self.l_strut):
            longer = length[k] - self.l_design[k]
            if k < 4:
                tension[k] = strut.spring.stiffness * longer - strut.spring.preload
                continue
            c = strut.damper.rebound if rate[k] > 0 else strut.damper.bump
            tension[k] = c * rate[k] / np.sqrt(1 + (rate[k] / strut.damper.speed) ** 2)
            for stop, sign in ((strut.rebound_stop, 1.0), (strut.bump_stop, -1.0)):
                d = max(sign * longer - stop.gap, 0.0)
                tension[k] += sign * (stop.stiffness * d + stop.cubic * d**3)
        self._pull(self.l_ends, turned, tension[:, None] * along)

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

    def _tyre_forces(self):
        x, R, v, w = self.now
        t, k = self.car.tyre, self.w
        arm = np.einsum("nij,nj->ni", R[k], self.w_arm)
        speed = v[k] + np.cross(w[k], arm)
        load = t.stiffness * (t.free_radius - x[k, 2] - arm[:, 2]) - t.damping * speed[:, 2]
        force = np.maximum(load, 0.0)[:, None] * np.array([0.0, 0.0, 1.0])
        self.force[k] += force
        self.torque[k] += np.cross(arm, force)

    # --- equations ----------------------------------------------------------------------------

    def place(self, x, R):
        """Put the CGs (n, 3) and attitudes (n, 3, 3) of the bodies there, at rest."""
        pose = self.data.qpos.reshape(-1, 7)
        pose[:, :3] = x
        for quaternion, matrix in zip(pose[:, 3:], R, strict=True):
            mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(matrix).ravel())
        self.data.qvel[:] = 0.0
        mujoco.mj_forward(self.model, self.data)
        self.now = self._state()

    def applied(self):
        """Forces and torques (6 n,) on the CGs: weight, MuJoCo's, and all but the joints'."""
        n = len(self.groups)
        self.force = -self.data.qfrc_bias.reshape(n, 6)[:, :3].copy()
        self.torque = np.zeros((n, 3))
        self._bushing_forces()
        self._line_forces()
        self._bar_torques()
        self._tyre_forces()
        return np.hstack([self.force, self.torque]).ravel()
