"""The 8-DOF car a second time: MuJoCo's tree, every applied force by hand in the inertial frame.

The forces are written out with the points' positions and enter through the Jacobians of the
points they act at:

    M qdd = -h + sum_k J_k^T f_k + Q_arms

and, with the wheel centres' height and the chassis's x prescribed (rims), through the KKT system
of the same equation. Nothing here knows how the engine eliminates, orders or simplifies.
"""

import numpy as np
from ridetune.app.bench.car_points import CORNERS, GRAVITY

from .car_tree import EX, EY, EZ, PITCH, ROLL, CarTree, X, about_x, about_y

REST_SPEED = 0.1


class MujocoCar(CarTree):
    """Accelerations of one vehicle in the direct (road) and the prescribed (rims) mode."""

    def spring_and_damper(self, q, qd, i):
        """Length of spring-damper i, m, its force along itself, N, and the damper's part."""
        data = self.corners[i].axle.suspension
        p_C, p_A = self.wheel_centre(q, i), self.mount(q, i)
        J = self.point_jacobian(p_A, "chassis") - self.point_jacobian(p_C, CORNERS[i])
        length = np.linalg.norm(p_A - p_C)
        along = (p_A - p_C) / length
        damper = self.damper_force(data, -along @ J @ qd)
        spring = self.corners[i].preload + data.stiffness * (data.mount_height - length)
        return length, (spring + damper) * along, damper

    @staticmethod
    def damper_force(data, jounce_rate):
        """Force of a damper at a jounce rate; C is the mean of both slopes, N."""
        slopes = np.array([1.0, data.rebound_ratio]) * 2 * data.damping / (1 + data.rebound_ratio)
        force = slopes[0] * max(jounce_rate, 0.0) + slopes[1] * min(jounce_rate, 0.0)
        return (
            force if data.knee_speed is None else force / (1 + abs(jounce_rate) / data.knee_speed)
        )

    def suspension_forces(self, q, qd):
        """Generalized forces (8,) of springs, dampers and stabilizer bars."""
        total = np.zeros(8)
        for i, name in enumerate(CORNERS):
            _, on_mount, _ = self.spring_and_damper(q, qd, i)
            total += self.point_jacobian(self.mount(q, i), "chassis").T @ on_mount
            total -= self.point_jacobian(self.wheel_centre(q, i), name).T @ on_mount
        for left, right in ((4, 5), (6, 7)):
            bar = self.corners[left - 4].axle.stabilizer_bar
            torque = bar.stiffness * (q[left] - q[right]) + bar.damping * (qd[left] - qd[right])
            total[left] -= torque
            total[right] += torque
        return total

    def tyre_loads(self, q, qd, road_height, road_rate, lift_off=False):
        """Vertical tyre loads W (4,), N."""
        loads = np.zeros(4)
        for i, (name, corner) in enumerate(zip(CORNERS, self.corners, strict=True)):
            p_C = self.wheel_centre(q, i)
            rise = p_C[2] - corner.axle.wheel.radius
            rate = self.point_jacobian(p_C, name)[2] @ qd
            tyre = corner.axle.tyre
            loads[i] = (
                corner.tyre_load
                + tyre.stiffness * (road_height[i] - rise)
                + tyre.damping * (road_rate[i] - rate)
            )
        return np.maximum(loads, 0.0) if lift_off else loads

    def at_wheel(self, q, i, force):
        """Generalized force of a force at wheel centre i, for vertical ones the tyre's too."""
        return self.point_jacobian(self.wheel_centre(q, i), CORNERS[i]).T @ force

    def at_contact(self, q, i, force):
        """Generalized force of a force r below wheel centre i along Z."""
        below = self.wheel_centre(q, i) - self.corners[i].axle.wheel.radius * EZ
        return self.point_jacobian(below, CORNERS[i]).T @ force

    def brake_reaction(self):
        """Where a braking torque is taken up: "arm" or "chassis"."""
        return self.vehicle.brakes.reaction if self.vehicle.brakes else "arm"

    def wheel_torque(self, q, i, torque, reaction):
        """Generalized force of a torque on wheel i: traction at the contact, reaction on the arm.

        Taken up by the chassis it turns the arm against the chassis; inside the arm it does not.
        """
        force = self.at_contact(q, i, torque / self.corners[i].axle.wheel.radius * EX)
        if reaction == "chassis":
            force[4 + i] += torque
        return force

    def pivot_force(self, q, qd, qdd, i, on_tyre):
        """Force (3,) of arm i on the chassis at the pivot in E: Newton's law for the arm.

        on_tyre (3,) : force of the road on the wheel in E
        """
        mass, name = self.corners[i].axle.wheel.mass, CORNERS[i]
        p_G = self.on_arm(q, i, self.corners[i].p_G)
        momentum = mass * self.point_acceleration(p_G, name, qd, qdd)
        _, on_mount, _ = self.spring_and_damper(q, qd, i)
        return on_tyre - on_mount - mass * GRAVITY * EZ - momentum

    def accelerations(
        self, q, qd, *, road_height, road_rate, drive, brake, lift_off=False
    ):  # fmt: skip
        """Direct mode: qdd (8,) under road heights, their rates, drive and brake torques (4,)."""
        self.place(q, qd)
        way = np.tanh(qd[X] / REST_SPEED)
        force = self.suspension_forces(q, qd) - self.bias()
        loads = self.tyre_loads(q, qd, road_height, road_rate, lift_off)
        for i, corner in enumerate(self.corners):
            force += self.at_wheel(q, i, loads[i] * EZ)
            rolling = corner.axle.tyre.rolling_resistance * loads[i] * way
            force += self.at_contact(q, i, -rolling * EX)
            force += self.wheel_torque(q, i, drive[i], corner.axle.torque_reaction)
            force += self.wheel_torque(q, i, -brake[i] * way, self.brake_reaction())
        return np.linalg.solve(self.mass_matrix(), force)

    # --- prescribed wheel centres -----------------------------------------------------------

    def arms_at(self, pose, u):
        """Arm angles (4,) that put the wheel centres u above their height at rest."""
        arms, change = np.zeros(4), np.zeros(4)
        for _ in range(20):
            q = np.array([0.0, *pose, *arms])
            self.place(q, np.zeros(8))
            for i, corner in enumerate(self.corners):
                height = self.wheel_centre(q, i)[2] - corner.axle.wheel.radius
                change[i] = (u[i] - height) / self.at_wheel(q, i, EZ)[4 + i]
            arms = arms + change
            if np.abs(change).max() < 1e-9:  # Newton's next change is below round-off
                return arms
        raise ValueError("a wheel centre cannot reach its height")

    def wheel_centre_drift(self, q, qd, i):
        """Acceleration (3,) of wheel centre i in E for qdd = 0."""
        R_pitch = about_y(q[PITCH])
        R = R_pitch @ about_x(q[ROLL])
        pitch_axis, roll_axis, arm_axis = EY, R_pitch @ EX, R[:, 1]
        omega = qd[PITCH] * pitch_axis + qd[ROLL] * roll_axis
        alpha = qd[PITCH] * qd[ROLL] * np.cross(pitch_axis, roll_axis)
        omega_arm = omega + qd[4 + i] * arm_axis
        alpha_arm = alpha + qd[4 + i] * np.cross(omega, arm_axis)
        to_P = R @ self.corners[i].p_P
        to_C = self.wheel_centre(q, i) - self.origin(q) - to_P
        return (
            np.cross(alpha, to_P)
            + np.cross(omega, np.cross(omega, to_P))
            + np.cross(alpha_arm, to_C)
            + np.cross(omega_arm, np.cross(omega_arm, to_C))
        )

    def rims_state(self, pose, rates, v, u, u_rate):
        """q, qd (8,) with the wheel centres at height u and vertical velocity u_rate."""
        q = np.array([0.0, *pose, *self.arms_at(pose, u)])
        qd = np.array([v, *rates, 0.0, 0.0, 0.0, 0.0])
        self.place(q, qd)
        for i in range(4):
            J = self.at_wheel(q, i, EZ)
            qd[4 + i] = (u_rate[i] - J @ qd) / J[4 + i]
        self.place(q, qd)
        return q, qd

    def unit_traction(self, q, braking):
        """Generalized force (8,) of one newton of traction, and each wheel's share (4,)."""
        driven = [c.axle.driven for c in self.corners]
        force, shares = np.zeros(8), np.zeros(4)
        for i, corner in enumerate(self.corners):
            radius = corner.axle.wheel.radius
            if driven[i]:
                share = (1 - braking) / sum(driven)
                shares[i] += share
                force += self.wheel_torque(q, i, radius * share, corner.axle.torque_reaction)
            if braking:
                front = self.vehicle.brakes.front_share
                share = braking * (front if corner.front else 1 - front) / 2
                shares[i] += share
                force += self.wheel_torque(q, i, radius * share, self.brake_reaction())
        return force, shares

    def rims_accelerations(
        self, pose, rates, v, u, u_rate, u_acc, a_x, braking=0.0, traction="exact"
    ):
        """Rims mode: qdd (8,), vertical (4,) and traction plus rolling forces (4,) on the wheels.

        Unknowns (qdd, N, total traction); rows: the equations of motion, the four wheel centres'
        vertical accelerations, and either x'' = a_x (exact) or Eq. 4 for the traction (paper).
        """
        q, qd = self.rims_state(pose, rates, v, u, u_rate)
        way = np.tanh(v / REST_SPEED)
        resistance = way * np.array([c.axle.tyre.rolling_resistance for c in self.corners])
        direction, shares = self.unit_traction(q, braking)

        system, right = np.zeros((13, 13)), np.zeros(13)
        system[:8, :8] = self.mass_matrix()
        right[:8] = self.suspension_forces(q, qd) - self.bias()
        for i in range(4):
            lift = self.at_wheel(q, i, EZ)
            system[:8, 8 + i] = -lift - self.at_contact(q, i, -resistance[i] * EX)
            system[8 + i, :8] = lift
            right[8 + i] = u_acc[i] - self.wheel_centre_drift(q, qd, i)[2]
        system[:8, 12] = -direction
        if traction == "exact":
            system[12, X], right[12] = 1.0, a_x
        else:
            system[12, 12], system[12, 8:12] = 1.0, -resistance
            right[12] = self.total_mass * a_x
        solution = solve_scaled(system, right)
        vertical, total = solution[8:12], solution[12]
        return solution[:8], vertical, shares * total - resistance * vertical


def solve_scaled(system, right):
    """Solve after equilibration: newtons beside metres per second squared."""
    rows = 1 / np.abs(system).max(axis=1)
    columns = 1 / np.abs(system * rows[:, None]).max(axis=0)
    scaled = system * rows[:, None] * columns
    return columns * np.linalg.solve(scaled, right * rows)
