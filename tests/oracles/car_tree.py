"""Bodies, points and energies of the 8-DOF car, on MuJoCo's tree and on rotation matrices.

MuJoCo gives two things only, the mass matrix M(q) and the bias h(q, qd) (gravity, centrifugal and
gyroscopic terms) of a tree of five bodies; points and energies are written out beside it.

Points: P pivot, C wheel centre, G centre of gravity, A mount, given in the chassis's frame B as
they lie at rest. Frame E is inertial; q = (x, z, pitch, roll, a_fl, a_fr, a_rl, a_rr).
"""

from dataclasses import dataclass

import mujoco
import numpy as np

GRAVITY = 9.81
CORNERS = ("fl", "fr", "rl", "rr")
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


@dataclass(frozen=True)
class Corner:
    """Points of one corner in B at rest, and what acts there."""

    axle: object
    front: bool
    p_C: np.ndarray
    p_P: np.ndarray
    p_A: np.ndarray
    p_G: np.ndarray
    preload: float
    tyre_load: float

    @property
    def inertia(self):
        """Inertia tensor of wheel, arm and moving parts at G, kg m2."""
        wheel = self.axle.wheel
        return np.diag([wheel.inertia.xx, wheel.inertia.yy, wheel.inertia.zz])


def corners_of(vehicle):
    """The four corners; preloads and static tyre loads from moment balances, not from formulas."""
    h, placed = vehicle.chassis.cg_height, []
    for name in CORNERS:
        front, side = name[0] == "f", 1 if name[1] == "l" else -1
        axle = vehicle.front if front else vehicle.rear
        inwards, d = (-1 if front else 1), axle.pivot.distance
        x_C = axle.cg_distance if front else -axle.cg_distance
        p_C = np.array([x_C, side * axle.track / 2, axle.wheel.radius - h])
        p_P = np.array([x_C + inwards * d, p_C[1], d * np.tan(axle.pivot.angle) - h])
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
        load = loads[0 if front else 1]
        # The arm alone, moments about the pivot: tyre load up, weight and preload down.
        arm_C, arm_G = p_C[0] - p_P[0], p_G[0] - p_P[0]
        preload = load - axle.wheel.mass * GRAVITY * arm_G / arm_C
        corners.append(Corner(axle, front, p_C, p_P, p_A, p_G, preload, load))
    return corners


class CarTree:
    """One vehicle's bodies in a state, set by `place`."""

    def __init__(self, vehicle):
        self.vehicle = vehicle
        self.corners = corners_of(vehicle)
        self.total_mass = vehicle.chassis.mass + sum(c.axle.wheel.mass for c in self.corners)
        self.model = self._tree()
        self.data = mujoco.MjData(self.model)

    def _tree(self):
        spec = mujoco.MjSpec()
        spec.option.gravity = [0, 0, -GRAVITY]
        spec.option.disableflags = (
            mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
        )
        spec.compiler.balanceinertia = False
        spec.compiler.boundmass = spec.compiler.boundinertia = 0
        spec.compiler.fusestatic = False
        data = self.vehicle.chassis
        chassis = spec.worldbody.add_body(name="chassis", pos=[0, 0, data.cg_height])
        principal, quaternion = principal_inertia(data.inertia)
        set_inertia(chassis, data.mass, np.zeros(3), principal, quaternion)
        slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
        chassis.add_joint(name="x", type=slide, axis=[1, 0, 0])
        chassis.add_joint(name="z", type=slide, axis=[0, 0, 1])
        chassis.add_joint(name="pitch", type=hinge, axis=[0, 1, 0])
        chassis.add_joint(name="roll", type=hinge, axis=[1, 0, 0])
        for name, corner in zip(CORNERS, self.corners, strict=True):
            arm = chassis.add_body(name=name, pos=corner.p_P)
            set_inertia(
                arm, corner.axle.wheel.mass, corner.p_G - corner.p_P, np.diag(corner.inertia)
            )
            arm.add_joint(name=f"arm_{name}", type=hinge, axis=[0, 1, 0])
        return spec.compile()

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


def principal_inertia(inertia):
    """Principal moments and the quaternion (w, x, y, z) of their frame, turned about y.

    Turned by b about y the xz element is xz cos 2b + (xx - zz)/2 sin 2b; b makes it zero.
    """
    angle = 0.5 * np.arctan2(-2 * inertia.xz, inertia.xx - inertia.zz)
    tensor = np.array(
        [[inertia.xx, 0, inertia.xz], [0, inertia.yy, 0], [inertia.xz, 0, inertia.zz]]
    )
    turned = about_y(angle).T @ tensor @ about_y(angle)
    return np.diag(turned), np.array([np.cos(angle / 2), 0, np.sin(angle / 2), 0])


def set_inertia(body, mass, offset, principal, quaternion=(1, 0, 0, 0)):
    """Give a body its mass and inertia without MuJoCo's own eigenvalue search (1e-12 only)."""
    body.mass, body.ipos, body.iquat, body.inertia = mass, offset, quaternion, principal
    body.explicitinertial = True
