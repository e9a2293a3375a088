"""The detailed car a second time: a tree of MuJoCo's bodies and joints, forces written by hand.

Ideal joints are MuJoCo's hinges, slides and balls; what closes a loop (one ball joint of the front
axle) is its `connect` constraint. MuJoCo carries attitudes, mass matrix, weight and the generalized
forces f of everything else. With J of the closed loop, its reaction r and null space N, at rest

    N^T f = 0,    K = -N^T d(f + J^T r)/dq N,    M = N^T M_tree N
"""

import mujoco
import numpy as np
from ridetune.engine.detailed.pose import rotation
from ridetune.engine.detailed.rigid import frame_about, rigid_groups
from ridetune.engine.frames import GRAVITY
from scipy.linalg import eigh, null_space
from scipy.spatial.transform import Rotation

from .detailed_forces import DetailedForces, cross

JOINT = mujoco.mjtJoint

INCREMENT = 1e-6
"""Of a unit motion in central differences."""

STEP = 2e-4
"""s: the stiffest bushing rings at 811 Hz."""


def resting(model, q):
    """The car where Exudyn's model has its groups, coordinates q (groups, 6)."""
    car = MujocoDetailedCar(model.car)
    frames = np.swapaxes(np.array(model.frames), 1, 2)
    car.place(q[:, :3], rotation(q[:, 3:]) @ frames)
    return car


class MujocoDetailedCar:
    """The car's tree and the forces on it. `now` is x, R, v, w of the groups' CGs."""

    def __init__(self, car):
        self.car, self.groups = car, rigid_groups(car)
        self.index = {name: k for k, g in enumerate(self.groups) for name in g.names}
        self.forces = DetailedForces(car, self.groups, self.index)
        self.parents, closures = self._spanned()
        spec = mujoco.MjSpec()
        spec.option.gravity = [0.0, 0.0, -GRAVITY]
        spec.option.timestep = STEP
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        spec.option.solver = mujoco.mjtSolver.mjSOL_PGS
        bodies = {}
        for k, (parent, joint) in self.parents.items():
            bodies[k] = self._add_body(spec, bodies.get(parent, spec.worldbody), k, parent, joint)
        for joint in closures:
            self._close(spec, joint)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.ids = np.array([self.model.body(g.names[0]).id for g in self.groups])

    def _spanned(self):
        """Parent and joint of every group, parents first, and the joints that close loops."""
        joints = [j for j in self.car.joints if j.kind != "fixed"]
        joints.sort(key=lambda joint: joint.kind == "ball")  # what closes a loop is to be a ball
        tree, closures = [], []
        together = list(range(len(self.groups)))
        for joint in joints:
            a, b = (together[k] for k in self._ends(joint))
            (closures if a == b else tree).append(joint)
            together = [a if one == b else one for one in together]
        parents = {}
        # No wheel is a root, so that its spin is one hinge's angle.
        spinning = set(self.forces.wheels)
        by_mass = sorted(range(len(self.groups)), key=lambda k: -self.groups[k].mass)
        for root in sorted(by_mass, key=spinning.__contains__):
            if root in parents:
                continue
            parents[root], found = (None, None), [root]
            for parent in found:
                for joint in tree:
                    if parent in self._ends(joint):
                        child = sum(self._ends(joint)) - parent
                        if child not in parents:
                            parents[child] = parent, joint
                            found.append(child)
        return parents, closures

    def _ends(self, joint):
        return [self.index[name] for name in joint.bodies]

    def _axes(self, k, joint):
        """Kinds and axes of what carries group k; a universal's first axis is its first body's."""
        if joint.kind == "ball":
            return [(JOINT.mjJNT_BALL, np.array([0.0, 0.0, 1.0]))]
        x, y, z = frame_about(np.array(joint.axis)).T
        if joint.kind == "universal":
            both = [(JOINT.mjJNT_HINGE, x), (JOINT.mjJNT_HINGE, y)]
            return both if k == self._ends(joint)[1] else both[::-1]
        return [(JOINT.mjJNT_SLIDE, z)] * (joint.kind == "cylindrical") + [(JOINT.mjJNT_HINGE, z)]

    def _add_body(self, spec, onto, k, parent, joint):
        group = self.groups[k]
        place = group.cg - (0.0 if parent is None else self.groups[parent].cg)
        body = onto.add_body(name=group.names[0], pos=place)
        I = group.inertia
        body.mass, body.ipos, body.explicitinertial = group.mass, np.zeros(3), True
        body.fullinertia = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
        if joint is None:
            body.add_freejoint()
            return body
        for kind, axis in self._axes(k, joint):
            body.add_joint(type=kind, axis=axis, pos=np.array(joint.point) - group.cg)
        return body

    def _close(self, spec, joint):
        assert joint.kind == "ball"
        a, b = self._ends(joint)
        closure = spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT)
        closure.objtype = mujoco.mjtObj.mjOBJ_BODY
        closure.name1, closure.name2 = self.groups[a].names[0], self.groups[b].names[0]
        closure.data[:3] = np.array(joint.point) - self.groups[a].cg
        closure.solref = [2.0 * STEP, 1.0]
        closure.solimp = [0.9999, 0.9999, 0.001, 0.5, 2.0]

    # --- state --------------------------------------------------------------------------------

    def place(self, x, R):
        """Put the CGs (n, 3) and attitudes (n, 3, 3) there, at rest, as far as joints let them."""
        for k, (parent, joint) in self.parents.items():
            at = self.model.jnt_qposadr[self.model.body_jntadr[self.ids[k]]]
            q = self._free(x[k], R[k]) if joint is None else self._joined(k, parent, joint, x, R)
            self.data.qpos[at : at + len(q)] = q
        self.data.qvel[:] = 0.0
        self.move()

    def _free(self, x, R):
        return [*x, *Rotation.from_matrix(R).as_quat(scalar_first=True)]

    def _joined(self, k, parent, joint, x, R):
        relative = R[parent].T @ R[k]
        axes = self._axes(k, joint)
        if joint.kind == "ball":
            return Rotation.from_matrix(relative).as_quat(scalar_first=True)
        if joint.kind == "universal":
            F = np.column_stack([axes[0][1], axes[1][1], np.cross(axes[0][1], axes[1][1])])
            return Rotation.from_matrix(F.T @ relative @ F).as_euler("XYZ")[:2]
        z = axes[-1][1]
        angle = Rotation.from_matrix(relative).as_rotvec() @ z
        if joint.kind == "revolute":
            return [angle]
        arms = [np.array(joint.point) - self.groups[one].cg for one in (parent, k)]
        return [(R[parent].T @ (x[k] - x[parent]) + relative @ arms[1] - arms[0]) @ z, angle]

    def move(self):
        """Bring positions and velocities of the bodies up to the coordinates."""
        model, data = self.model, self.data
        mujoco.mj_step1(model, data)
        x, centre = data.xipos[self.ids], data.subtree_com[model.body_rootid[self.ids]]
        w, v = data.cvel[self.ids, :3], data.cvel[self.ids, 3:]
        self.now = x, data.xmat[self.ids].reshape(-1, 3, 3), v + cross(w, x - centre), w

    # --- small motions ------------------------------------------------------------------------

    def applied(self):
        """Generalized forces of everything but the closed loop, weight and gyroscopics included."""
        self.data.xfrc_applied[self.ids] = self.forces.at(self.now)
        mujoco.mj_fwdActuation(self.model, self.data)
        mujoco.mj_fwdAcceleration(self.model, self.data)
        return self.data.qfrc_smooth.copy()

    def loop_jacobian(self):
        """J (3, nv) of what closes the loop."""
        return self.data.efc_J.reshape(self.data.nefc, self.model.nv).copy()

    def admissible(self):
        """Motions (nv, n) that leave the loop closed."""
        return null_space(self.loop_jacobian())

    def frequencies(self):
        """Undamped natural frequencies about where the car rests, Hz, slowest first."""
        rest, N = self.data.qpos.copy(), self.admissible()
        reaction = np.linalg.lstsq(self.loop_jacobian().T, -self.applied(), rcond=None)[0]
        mass = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, mass)

        def pushed(motion):
            self.data.qpos[:] = rest
            mujoco.mj_integratePos(self.model, self.data.qpos, motion, INCREMENT)
            self.move()
            return self.applied() + self.loop_jacobian().T @ reaction

        K = N.T @ np.array([pushed(-n) - pushed(n) for n in N.T]).T / (2.0 * INCREMENT)
        self.data.qpos[:] = rest
        self.move()
        squares = eigh((K + K.T) / 2.0, N.T @ mass @ N, eigvals_only=True)
        return np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi)
