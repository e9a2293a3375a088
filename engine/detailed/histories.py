"""What a run of the detailed car keeps, and the project's channels read from it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..run import Run
from ..simulation.output_channels import Points
from .builder import Model
from .pose import point, point_acceleration, point_velocity, rotation, spin

Array = NDArray[np.float64]


class WheelSample(NamedTuple):
    """What acts at the four wheels in the order of the car's wheels, each (4,).

    load : tyre load, N;  road : height under the wheel, m
    drive, brake : torques, N m, the brake's as a positive number
    """

    load: Array
    road: Array
    drive: Array
    brake: Array


AT_WHEELS = ("tyre.{}.load", "road.{}.z", "drive.{}.torque", "brake.{}.torque")
"""Channels of a `WheelSample`, in its order."""


class Histories:
    """States of the rigid groups that the channels need, at the sample times.

    samples : how many at most;  sample_step : s
    points : chassis points with accelerometers, from the measured point, m
    """

    def __init__(self, model: Model, samples: int, sample_step: float, points: Points):
        self._model = model
        self._step = sample_step
        self._points = points
        ends = [model.index[body] for line in model.car.dampers for body in line.bodies]
        self._kept = sorted({model.chassis, *model.wheels, *ends})
        self._place = {group: k for k, group in enumerate(self._kept)}
        self._q, self._qd, self._qdd = (np.zeros((samples, len(self._kept), 6)) for _ in range(3))
        self._wheels = np.zeros((samples, len(WheelSample._fields), 4))
        self.count = 0

    def keep(self, wheels: WheelSample) -> None:
        """Add the model's present state."""
        data = self._model.system.systemData
        k = self.count
        self._q[k] = self._positions()[self._kept]
        self._qd[k] = data.GetODE2Coordinates_t().reshape(-1, 6)[self._kept]
        self._qdd[k] = data.GetODE2Coordinates_tt().reshape(-1, 6)[self._kept]
        self._wheels[k] = wheels
        self.count += 1

    def _positions(self) -> Array:
        """Coordinates (groups, 6) of the model's present state."""
        data = self._model.system.systemData
        return data.GetODE2Coordinates().reshape(-1, 6) + self._model.design

    def farthest_astray(self) -> tuple[str, float]:
        """The body that is now farthest from its place in the car, and how far, m."""
        q, home = self._positions(), self._model.design[:, :3]
        chassis = self._model.chassis
        away = home - home[chassis]
        expected = q[chassis, :3] + away @ rotation(q[chassis, 3:]).T
        distance = np.linalg.norm(q[:, :3] - expected, axis=1)
        distance = np.where(np.isfinite(distance), distance, np.inf)
        worst = int(np.argmax(distance))
        return self._model.groups[worst].names[0], float(distance[worst])

    def run(self, name: str) -> Run:
        """The channels so far, displacements from rest, which is the first sample."""
        kept = slice(0, self.count)
        q, qd, qdd = self._q[kept], self._qd[kept], self._qdd[kept]
        channels = self._chassis(q, qd, qdd)
        model = self._model
        for k, wheel in enumerate(model.car.wheels):
            corner, group = wheel.corner, self._place[model.wheels[k]]
            centre = point(q[:, group], model.in_body(wheel.body, wheel.centre))
            channels[f"wheel.{corner}.z"] = centre[:, 2] - centre[0, 2]
            for row, kind in enumerate(AT_WHEELS):
                channels[kind.format(corner)] = self._wheels[kept, row, k]
        for line in model.car.dampers:
            ends = [
                point(q[:, self._place[model.index[body]]], model.in_body(body, end))
                for body, end in zip(line.bodies, line.ends, strict=True)
            ]
            length = np.linalg.norm(ends[0] - ends[1], axis=1)
            channels[f"suspension.{line.corner}.travel"] = length[0] - length
        return Run(name, self._step * np.arange(self.count, dtype=np.float64), channels)

    def _chassis(self, q: Array, qd: Array, qdd: Array) -> dict[str, Array]:
        """Motion of the measured point and attitude of the chassis."""
        model, k = self._model, self._place[self._model.chassis]
        offset = model.in_body(model.car.chassis, model.car.measured_point)
        q, qd, qdd = q[:, k], qd[:, k], qdd[:, k]
        place, velocity = point(q, offset), point_velocity(q, qd, offset)
        turn, rates = rotation(q[:, 3:]), spin(q[:, 3:], qd[:, 3:])
        pitch = -np.arcsin(turn[:, 2, 0])
        roll = np.arctan2(turn[:, 2, 1], turn[:, 2, 2])
        # From R = Rz(yaw) Ry(pitch) Rx(roll), yaw small: w = yaw' z + pitch' y + roll' x.
        channels = {
            "chassis.x": place[:, 0] - place[0, 0],
            "chassis.z": place[:, 2] - place[0, 2],
            "chassis.pitch": pitch - pitch[0],
            "chassis.roll": roll - roll[0],
            "chassis.v_x": velocity[:, 0],
            "chassis.z_rate": velocity[:, 2],
            "chassis.pitch_rate": rates[:, 1],
            "chassis.roll_rate": rates[:, 0],
            "chassis.a_x": point_acceleration(q, qd, qdd, offset)[:, 0],
        }
        for name, away in self._points.items():
            acceleration = point_acceleration(q, qd, qdd, offset + np.array(away))
            channels |= {f"{name}.a_{axis}": acceleration[:, k] for k, axis in enumerate("xyz")}
        return channels
