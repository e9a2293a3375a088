"""MuJoCo's detailed car through a manoeuvre: tyres and road a second time, and its time steps.

Semi-implicit Euler steps of MuJoCo; the tyres' deflections go with du/dt = v_slip - |v_x| u / s,
exact over a step of constant speeds. The road is the mean of its heights over the contact patch.
"""

import mujoco
import numpy as np
from ridetune.engine.detailed.point_mass import point_mass
from ridetune.engine.frames import CORNERS, CREEP_SPEED

from .detailed_forces import cross
from .mujoco_detailed import STEP

PATCH_POINTS = 24
"""Midpoints over the contact patch."""

ROAD_GRID = 2e-3
"""m, between the points of the averaged road, which is linear between them."""


class DetailedDrive:
    """One run of an oracle that stands at rest; `run` returns its channels."""

    def __init__(self, oracle, manoeuvre):
        self.oracle, self.car = oracle, oracle.car
        self.demand = manoeuvre.demand(point_mass(self.car))
        self.corners = [CORNERS.index(wheel.corner) for wheel in self.car.wheels]
        against = [wheel.driven_against for wheel in self.car.wheels]
        self.driven = [k for k, name in enumerate(against) if name]
        self.reacting = [oracle.index[against[k]] for k in self.driven]
        self.carriers = [oracle.index[wheel.carrier] for wheel in self.car.wheels]
        self.chassis = oracle.index[self.car.chassis]
        cg = oracle.groups[self.chassis].cg
        self.point = np.array(self.car.measured_point) - cg
        tyre = self.car.tyre
        both = (tyre.longitudinal, tyre.lateral)
        self.relaxation = np.array([slip.relaxation_length for slip in both])
        self.stiffness = np.array([slip.slip_stiffness for slip in both]) / self.relaxation
        self.u = np.zeros((4, 2))
        self._average_road()
        self._roll(manoeuvre.initial_speed)

    def _average_road(self):
        """Mean heights of both sides on a grid along X."""
        road, length = self.demand.road, self.car.tyre.patch_length
        self.grid = np.arange(road.start - length, road.end + length + ROAD_GRID, ROAD_GRID)
        over = ((np.arange(PATCH_POINTS) + 0.5) / PATCH_POINTS - 0.5) * length
        self.heights = [
            np.mean([road.height(side, self.grid + dx) for dx in over], axis=0) for side in (0, 1)
        ]
        self.sides = [0 if wheel.corner[1] == "l" else 1 for wheel in self.car.wheels]

    def _roll(self, speed):
        """Everything moves along, the wheels roll."""
        model, data = self.oracle.model, self.oracle.data
        for k, (parent, _) in self.oracle.parents.items():
            if parent is None:
                data.qvel[model.body_dofadr[self.oracle.ids[k]]] = speed
        for k in self.oracle.forces.wheels:
            address = model.body_dofadr[self.oracle.ids[k]]
            axis = model.jnt_axis[model.body_jntadr[self.oracle.ids[k]]]
            data.qvel[address] = np.sign(axis[1]) * speed / self.car.tyre.rolling_radius

    def under(self, x):
        """Height and slope (4,) of the averaged road at the wheels' X (4,)."""
        position = (x - self.grid[0]) / ROAD_GRID
        cell = np.clip(position.astype(int), 0, len(self.grid) - 2)
        pairs = [
            (self.heights[s][k], self.heights[s][k + 1])
            for s, k in zip(self.sides, cell, strict=True)
        ]
        low, high = np.array(pairs).T
        share = np.clip(position - cell, 0.0, 1.0)
        return low + share * (high - low), (high - low) / ROAD_GRID

    def _tractions(self, velocity, axle, spin):
        """Forces along the road and torques (4, 3) on the wheels, deflections one step further."""
        t, up = self.car.tyre, np.array([0.0, 0.0, 1.0])
        forward = cross(axle, up)
        forward /= np.linalg.norm(forward, axis=1)[:, None]
        aside = cross(up, forward)
        along, across = np.sum(velocity * forward, axis=1), np.sum(velocity * aside, axis=1)
        slip = np.stack([along - t.rolling_radius * spin, across], axis=1)
        decay = np.abs(along)[:, None] / self.relaxation * STEP
        gained = np.where(decay > 1e-9, -np.expm1(-decay) / np.maximum(decay, 1e-12), 1.0)
        u = self.u * np.exp(-decay) + STEP * slip * gained
        pulled = np.linalg.norm(self.stiffness * u, axis=1)
        load = self.oracle.forces.load
        u *= np.minimum(1.0, t.friction * load / np.maximum(pulled, 1e-9))[:, None]
        self.u, F = u, self.stiffness * u
        force = -F[:, :1] * forward - F[:, 1:] * aside
        rolling = t.rolling_resistance * load * t.rolling_radius * np.tanh(along / CREEP_SPEED)
        return force, cross(-t.rolling_radius * up, force) - rolling[:, None] * axle

    def _brake(self, most, axle, spin):
        """Torques (4, 3) on the wheels, the carriers' spin counted off."""
        w = self.oracle.now[3][self.carriers]
        slow = self.car.tyre.rolling_radius * (spin - np.sum(w * axle, axis=1)) / CREEP_SPEED
        return -(most * np.tanh(slow))[:, None] * axle

    def _step(self, demanded, most):
        oracle, forces = self.oracle, self.oracle.forces
        oracle.move()
        forces.now = oracle.now
        arm, velocity, axle, spin = forces.wheel_motion()
        centre = oracle.now[0][forces.wheels, 0] + arm[:, 0]
        height, slope = self.under(centre - self.car.measured_point[0])
        forces.at(oracle.now, height, slope * velocity[:, 0])
        force, torque = self._tractions(velocity, axle, spin)
        drive = demanded[:, None] * axle
        brake = self._brake(most, axle, spin)
        forces.push_wheels(arm, force, torque + drive + brake)
        np.subtract.at(forces.torque, self.carriers, brake)
        for k, body in zip(self.driven, self.reacting, strict=True):
            forces.torque[body] -= drive[k]
        oracle.data.xfrc_applied[oracle.ids, :3] = forces.force
        oracle.data.xfrc_applied[oracle.ids, 3:] = forces.torque
        mujoco.mj_step2(oracle.model, oracle.data)

    def _sample(self):
        x, R, v, w = (one[self.chassis] for one in self.oracle.now)
        arm = R @ self.point
        wheels = self.oracle.forces.wheels
        rims = self.oracle.now[0][wheels, 2] + self.oracle.forces.wheel_motion()[0][:, 2]
        return [
            *(x + arm)[[0, 2]],
            -np.arcsin(R[2, 0]),
            np.arctan2(R[2, 1], R[2, 2]),
            (v + cross(w, arm))[0],
            *rims,
        ]

    def run(self, sample_step=5e-3):
        """Times (n,) and channels by name, displacements from the start."""
        every = round(sample_step / STEP)
        times = STEP * np.arange(round(self.demand.duration / STEP) + 1)
        rows = []
        drive = self.demand.drive.at(times)[:, self.corners]
        brake = self.demand.brake.at(times)[:, self.corners]
        for k, torques in enumerate(zip(drive, brake, strict=True)):
            self._step(*torques)
            if k % every == 0:
                rows.append(self._sample())
        rows = np.array(rows)
        rows[:, [0, 1, 2, 3, 5, 6, 7, 8]] -= rows[0, [0, 1, 2, 3, 5, 6, 7, 8]]
        names = ["chassis.x", "chassis.z", "chassis.pitch", "chassis.roll", "chassis.v_x"]
        names += [f"wheel.{wheel.corner}.z" for wheel in self.car.wheels]
        return sample_step * np.arange(len(rows)), dict(zip(names, rows.T, strict=True))
