"""The same car stepped by Exudyn: a kinematic tree with its own connectors and loads.

Spring-dampers, bars and tyres are Exudyn's connectors. What they take over time (`histories`) is
loads, which a Python function sets before each step, about a tenth of the time. Exudyn's own
inverse of the mass matrix is asked for, body by body.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...engine.detailed.exudyn_module import require_exudyn
from ...engine.vehicle import Inertia, Vehicle
from .car_points import GRAVITY, Corner, corners_of
from .histories import Histories

exudyn, items = require_exudyn()

Array = NDArray[np.float64]

CHASSIS, FIRST_ARM = 3, 4
"""Links of the tree: x, z and pitch carry nothing, roll carries the chassis."""


class ExudynCar:
    """A car that follows histories in Exudyn's solver."""

    def __init__(self, vehicle: Vehicle, given: Histories, step: float):
        # A system lives as long as its container.
        self._container = exudyn.SystemContainer()
        self._system = self._container.AddSystem()
        self._steps = len(given.road)
        self._step = step
        corners = corners_of(vehicle)
        node, tree = self._add_tree(vehicle, corners, given.states[0])
        self._ground = self._system.AddMarker(
            items.MarkerBodyPosition(bodyNumber=self._system.AddObject(items.ObjectGround()))
        )
        self._loads: list[tuple[int, str]] = []
        self._histories: list[list[Any]] = []
        for k, corner in enumerate(corners):
            self._add_corner(tree, k, corner, given)
        for left in (0, 2):
            self._add_bar(node, left, corners[left], given)
        self._given = list(zip(*self._histories, strict=True))
        self._system.SetPreStepUserFunction(self._before_step)
        kind = exudyn.OutputVariableType
        self._sensors = [
            self._system.AddSensor(
                items.SensorNode(
                    nodeNumber=node, storeInternal=True, writeToFile=False, outputVariableType=seen
                )
            )
            for seen in (kind.Coordinates, kind.Coordinates_t)
        ]
        self._system.Assemble()

    def states(self) -> Array:
        """States (n + 1, 16) at the ends of the steps."""
        self._system.SolveDynamic(self._settings(), solverType=exudyn.DynamicSolverType.RK44)
        seen = [self._system.GetSensorStoredData(sensor)[:, 1:] for sensor in self._sensors]
        return np.concatenate(seen, axis=1)

    def _settings(self) -> Any:
        settings = exudyn.SimulationSettings()
        time, solution = settings.timeIntegration, settings.solution
        time.numberOfSteps, time.endTime = self._steps, self._steps * self._step
        time.explicit.computeEndOfStepAccelerations = False
        time.explicit.computeMassMatrixInversePerBody = True
        time.explicit.eliminateConstraints = False
        solution.file.write = False
        solution.sensors.writePeriod = self._step
        return settings

    def _add_tree(self, vehicle: Vehicle, corners: list[Corner], start: Array) -> tuple[int, int]:
        """Numbers of the node with the eight coordinates and of the tree on it."""
        joints = exudyn.JointType
        node = self._system.AddNode(
            items.NodeGenericODE2(
                numberOfODE2Coordinates=8,
                referenceCoordinates=[0.0] * 8,
                initialCoordinates=start[:8].tolist(),
                initialCoordinates_t=start[8:].tolist(),
            )
        )
        chassis, origin, nothing = vehicle.chassis, np.zeros(3), np.zeros((3, 3))
        rest = np.array([0.0, 0.0, chassis.cg_height])
        tree = self._system.AddObject(
            items.ObjectKinematicTree(
                nodeNumber=node,
                gravity=[0.0, 0.0, -GRAVITY],
                jointTypes=[
                    *(joints.PrismaticX, joints.PrismaticZ, joints.RevoluteY, joints.RevoluteX),
                    *[joints.RevoluteY] * 4,
                ],
                linkParents=[-1, 0, 1, 2, *[CHASSIS] * 4],
                jointTransformations=exudyn.Matrix3DList([np.eye(3)] * 8),
                jointOffsets=exudyn.Vector3DList([rest, *[origin] * 3, *(c.p_P for c in corners)]),
                linkInertiasCOM=exudyn.Matrix3DList(
                    [*[nothing] * 3, _tensor(chassis.inertia), *(c.inertia for c in corners)]
                ),
                linkCOMs=exudyn.Vector3DList([*[origin] * 4, *(c.p_G - c.p_P for c in corners)]),
                linkMasses=[0.0, 0.0, 0.0, chassis.mass, *(c.axle.wheel.mass for c in corners)],
            )
        )
        return node, tree

    def _add_corner(self, tree: int, k: int, corner: Corner, given: Histories) -> None:
        """Spring-damper, tyre and longitudinal force of one corner."""
        system, suspension, tyre = self._system, corner.axle.suspension, corner.axle.tyre
        wheel, mount = (
            system.AddMarker(
                items.MarkerKinematicTreeRigid(
                    objectNumber=tree, linkNumber=link, localPosition=point
                )
            )
            for link, point in ((FIRST_ARM + k, corner.p_C - corner.p_P), (CHASSIS, corner.p_A))
        )
        system.AddObject(
            items.ObjectConnectorSpringDamper(
                markerNumbers=[wheel, mount],
                referenceLength=suspension.mount_height,
                stiffness=suspension.stiffness,
                damping=suspension.damping,
                force=-corner.preload,
            )
        )
        system.AddObject(
            items.ObjectConnectorCartesianSpringDamper(
                markerNumbers=[self._ground, wheel],
                stiffness=[0.0, 0.0, tyre.stiffness],
                damping=[0.0, 0.0, tyre.damping],
            )
        )
        along, zero = given.longitudinal[:, k], np.zeros(self._steps)
        force = np.column_stack([along, zero, given.upward(corner, k)])
        moment = np.column_stack([zero, -corner.axle.wheel.radius * along, zero])
        for kind, history in ((items.LoadForceVector, force), (items.LoadTorqueVector, moment)):
            load = system.AddLoad(kind(markerNumber=wheel, loadVector=[0.0, 0.0, 0.0]))
            self._follow(load, "loadVector", history)

    def _add_bar(self, node: int, left: int, corner: Corner, given: Histories) -> None:
        """Stabilizer bar between two arms, and the torques on them where there are any."""
        system, bar = self._system, corner.axle.stabilizer_bar
        arms = [
            system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=FIRST_ARM + k))
            for k in (left, left + 1)
        ]
        system.AddObject(
            items.ObjectConnectorCoordinateSpringDamper(
                markerNumbers=arms, stiffness=bar.stiffness, damping=bar.damping
            )
        )
        for arm, torque in zip(arms, given.arm_torque[:, left : left + 2].T, strict=True):
            if np.any(torque):
                load = system.AddLoad(items.LoadCoordinate(markerNumber=arm, load=0.0))
                self._follow(load, "load", torque)

    def _follow(self, load: int, field: str, history: Array) -> None:
        """Let a load's field take the values (n, ...) of the steps."""
        self._loads.append((load, field))
        self._histories.append(history.tolist())

    def _before_step(self, system: Any, end: float) -> bool:
        """Set the loads of the step that ends at a time; True lets Exudyn go on."""
        step = min(max(round(end / self._step) - 1, 0), self._steps - 1)
        for (load, field), value in zip(self._loads, self._given[step], strict=True):
            system.SetLoadParameter(load, field, value)
        return True


def _tensor(inertia: Inertia) -> Array:
    return np.array(
        [[inertia.xx, 0.0, inertia.xz], [0.0, inertia.yy, 0.0], [inertia.xz, 0.0, inertia.zz]]
    )
