"""Bodies, points and energies of the 8-DOF car, on MuJoCo's tree and on rotation matrices.

MuJoCo gives two things only, the mass matrix M(q) and the bias h(q, qd) (gravity, centrifugal and
gyroscopic terms) of a tree of five bodies; points and energies are written out beside it.

Tree and points are those of `mujoco_tree` and `car_points`, which the benchmark shares; frame E is
inertial.
"""

import mujoco
import numpy as np
from ridetune.app.bench.car_points import GRAVITY, corners_of
from ridetune.app.bench.mujoco_tree import tree_of

X, Z, PITCH, ROLL = 0, 1, 2, 3
EX, EY, EZ = np.eye(3)


def about_x(angle):
    """Rotation matrix about x; complex angles are allowed, for derivatives."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def about_y(angle):
    """Rotation matrix about y; complex angles are allowed, for derivatives."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


class CarTree:
    """One vehicle's bodies in a state, set by `place`."""

    def __init__(self, vehicle):
        self.vehicle = vehicle
        self.corners = corners_of(vehicle)
        self.total_mass = vehicle.chassis.mass + sum(c.axle.wheel.mass for c in self.corners)
        self.model = tree_of(vehicle, self.corners).compile()
        self.data = mujoco.MjData(self.model)

    def place(self, q, qd):
        """Set the state; afterwards M, bias and Jacobians belong to it."""
        self.data.qpos[:] = q
        self.data.qvel[:] = qd
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)

    def mass_matrix(self):
        """M at the placed state (8, 8)."""
        columns = np.zeros((8, 8))
        for column, unit in zip(columns, np.eye(8), strict=True):
            mujoco.mj_mulM(self.model, self.data, column, unit)
        return columns.T

    def bias(self):
        """Gravity, centrifugal and gyroscopic terms h at the placed state (8,)."""
        return self.data.qfrc_bias.copy()

    def point_jacobian(self, point, body):
        """d(point)/dq (3, 8) of a point of E that moves with a body ("chassis" or a corner)."""
        jacobian = np.zeros((3, 8))
        index = self.model.body(body).id
        mujoco.mj_jac(self.model, self.data, jacobian, None, point, index)
        return jacobian

    def point_acceleration(self, point, body, qd, qdd):
        """Acceleration (3,) in E of a point of E that moves with a body."""
        rate = np.zeros((3, 8))
        mujoco.mj_jacDot(self.model, self.data, rate, None, point, self.model.body(body).id)
        return self.point_jacobian(point, body) @ qdd + rate @ qd

    # --- positions by hand ------------------------------------------------------------------

    def origin(self, q):
        """Chassis's centre of gravity in E."""
        return np.array([q[X], 0, self.vehicle.chassis.cg_height + q[Z]])

    def on_chassis(self, q, p_B):
        """A point of B in E."""
        return self.origin(q) + about_y(q[PITCH]) @ about_x(q[ROLL]) @ p_B

    def on_arm(self, q, i, p_B):
        """A point of arm i, given by its place in B at rest, in E."""
        p_P = self.corners[i].p_P
        return self.on_chassis(q, p_P + about_y(q[4 + i]) @ (p_B - p_P))

    def rotation_of_arm(self, q, i):
        """Rotation matrix of arm i in E."""
        return about_y(q[PITCH]) @ about_x(q[ROLL]) @ about_y(q[4 + i])

    def wheel_centre(self, q, i):
        """Wheel centre i in E."""
        return self.on_arm(q, i, self.corners[i].p_C)

    def mount(self, q, i):
        """Upper spring mount i in E."""
        return self.on_chassis(q, self.corners[i].p_A)

    # --- energy -----------------------------------------------------------------------------

    def kinetic_energy(self, q, qd):
        """Kinetic energy of the five bodies, J."""
        self.place(q, qd)
        return 0.5 * qd @ self.mass_matrix() @ qd

    def gravity_energy(self, q):
        """Energy of weight, J; q may be complex."""
        masses = [self.vehicle.chassis.mass, *(c.axle.wheel.mass for c in self.corners)]
        points = [self.origin(q), *(self.on_arm(q, i, self.corners[i].p_G) for i in range(4))]
        return GRAVITY * sum(m * p[2] for m, p in zip(masses, points, strict=True))

    def suspension_energy(self, q):
        """Energy of springs, preloads and bars, J, 0 at rest; q may be complex."""
        energy = 0.0
        for i, corner in enumerate(self.corners):
            element = self.mount(q, i) - self.wheel_centre(q, i)
            stretch = np.sqrt(np.sum(element * element)) - corner.axle.suspension.mount_height
            stiffness = corner.axle.suspension.stiffness
            energy = energy + 0.5 * stiffness * stretch**2 - corner.preload * stretch
        for left, right in ((4, 5), (6, 7)):
            bar = self.corners[left - 4].axle.stabilizer_bar
            energy = energy + 0.5 * bar.stiffness * (q[left] - q[right]) ** 2
        return energy

    def tyre_energy(self, q, road_height):
        """Energy of tyre springs and static loads, J, 0 at rest; q may be complex."""
        energy = 0.0
        for i, corner in enumerate(self.corners):
            squeeze = road_height[i] - (self.wheel_centre(q, i)[2] - corner.axle.wheel.radius)
            energy = (
                energy + 0.5 * corner.axle.tyre.stiffness * squeeze**2 + corner.tyre_load * squeeze
            )
        return energy

    def potential_energy(self, q, road_height=(0, 0, 0, 0)):
        """All potential energy, J."""
        return self.gravity_energy(q) + self.suspension_energy(q) + self.tyre_energy(q, road_height)
