"""A detailed car as an Exudyn system: bodies, joints and force elements, in the design position.

One node of six coordinates a rigid group: the CG's position and Tait-Bryan angles xyz. They are
singular where the second angle is 90 degrees, which a wheel that spins about y would pass; so the
body frame of a wheel lies with its z along the axle, and the spin is the third angle.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..frames import GRAVITY
from .exudyn_module import require_exudyn
from .laws import brake_law, bushing_law, damper_law, tyre_law
from .records import CONSTRAINED, DetailedCar
from .rigid import Group, frame_about, joint_frame, rigid_groups

Array = NDArray[np.float64]

UPRIGHT = np.eye(3)
AXLE = np.array([0.0, 1.0, 0.0])
SPINNING = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Body frame of a wheel in the design frame: z along the axle, the first angle -90 degrees."""

LEANING = (-np.pi / 2, 0.0, 0.0)
HOLD = 1e3
"""Stiffness, N/m and N m/rad, that holds what the static solution leaves free."""


class Model:
    """The assembled system.

    groups : rigid groups;  index : group by body name
    exudyn : the module;  system : its MainSystem
    wheels (4,) : group of each wheel in the order of the car's wheels
    tyres, brakes : per wheel, numbers of the connectors
    tractions, torques : per wheel, numbers of the loads
    reactions : per wheel, number of the load on the body that takes its torque, or None
    design (groups, 6) : coordinates in the design position
    """

    def __init__(self, car: DetailedCar):
        self.car = car
        self.exudyn, self.items = require_exudyn()
        self._container = self.exudyn.SystemContainer()  # a system lives as long as it
        self.system = self._container.AddSystem()
        self._recorded: list[Any] = []  # expressions live as long as the connectors
        self.groups = rigid_groups(car)
        self.index = {name: k for k, group in enumerate(self.groups) for name in group.names}
        self.wheels = [self.index[wheel.body] for wheel in car.wheels]
        self.frames = [SPINNING if k in self.wheels else UPRIGHT for k in range(len(self.groups))]
        leans = [LEANING if k in self.wheels else (0.0, 0.0, 0.0) for k in range(len(self.groups))]
        self.design = np.array(
            [[*group.cg, *lean] for group, lean in zip(self.groups, leans, strict=True)]
        )
        self._nodes, self._bodies = [], []
        self.ground = self.system.AddObject(self.items.ObjectGround())
        for k, group in enumerate(self.groups):
            self._add_body(k, group)
        self._add_joints()
        self._add_bushings()
        self._add_lines()
        self._add_bars()
        self._add_wheels()
        self.brakes = self._add_brakes()
        self._holds = self._add_holds()
        self.system.Assemble()

    @property
    def chassis(self) -> int:
        """Group of the chassis."""
        return self.index[self.car.chassis]

    def hold(self, active: bool) -> None:
        """Hold what has no stiffness of its own (x, y, yaw, the wheels' spin), or let it go."""
        for number in self._holds:
            self.system.SetObjectParameter(number, "activeConnector", active)

    def in_body(self, body: str, point: Array | tuple) -> Array:
        """A point of the design frame from the CG of a body's group, in the group's axes (3,)."""
        k = self.index[body]
        return self.frames[k].T @ (np.array(point) - self.groups[k].cg)

    def marker(self, body: str, point: Array | tuple, frame: Array = UPRIGHT) -> int:
        """Number of a marker at a point on a body, its axes the columns of `frame`."""
        k = self.index[body]
        place = np.eye(4)
        place[:3, :3] = self.frames[k].T @ frame
        place[:3, 3] = self.in_body(body, point)
        return self.system.AddMarker(
            self.items.MarkerBodyRigid(bodyNumber=self._bodies[k], localHT=place)
        )

    def _add_body(self, k: int, group: Group) -> None:
        node = self.system.AddNode(
            self.items.NodeRigidBodyRxyz(referenceCoordinates=self.design[k])
        )
        inertia = self.frames[k].T @ group.inertia @ self.frames[k]
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
        body = self.system.AddObject(
            self.items.ObjectRigidBody(
                mass=group.mass,
                inertia=[xx, yy, zz, yz, xz, xy],
                nodeNumber=node,
            )
        )
        weight = self.system.AddMarker(self.items.MarkerBodyMass(bodyNumber=body))
        self.system.AddLoad(
            self.items.LoadMassProportional(markerNumber=weight, loadVector=[0.0, 0.0, -GRAVITY])
        )
        self._nodes.append(node)
        self._bodies.append(body)

    def _add_joints(self) -> None:
        for joint in self.car.joints:
            if joint.kind == "fixed":
                continue
            frame = joint_frame(joint)
            held = [int(k in CONSTRAINED[joint.kind]) for k in range(6)]
            self.system.AddObject(
                self.items.ObjectJointGeneric(
                    markerNumbers=[self.marker(body, joint.point, frame) for body in joint.bodies],
                    constrainedAxes=held,
                )
            )

    def _record(self, law: Callable[..., Any], item: str, function: str) -> Any:
        """An expression of a law for one kind of connector."""
        record = self.exudyn.advancedUtilities.CreateSymbolicUserFunction
        self._recorded.append(record(self.system, law, function, itemTypeName=item))
        return self._recorded[-1]

    def _add_bushings(self) -> None:
        item, function = "ObjectConnectorRigidBodySpringDamper", "springForceTorqueUserFunction"
        laws = {
            law.name: self._record(
                bushing_law(law, self.car.bushing_speed, self.exudyn.symbolic), item, function
            )
            for law in self.car.bushing_laws
        }
        for bushing in self.car.bushings:
            self.system.AddObject(
                self.items.ObjectConnectorRigidBodySpringDamper(
                    markerNumbers=[self.marker(body, bushing.point) for body in bushing.bodies],
                    springForceTorqueUserFunction=laws[bushing.law],
                )
            )

    def _add_lines(self) -> None:
        item, function = "ObjectConnectorSpringDamper", "springForceUserFunction"
        laws = {
            line.corner: self._record(
                damper_law(self.car.strut(line.corner), self.exudyn.symbolic), item, function
            )
            for line in self.car.dampers
        }
        for line in (*self.car.springs, *self.car.dampers):
            spring = self.car.strut(line.corner).spring
            markers = [
                self.marker(body, end) for body, end in zip(line.bodies, line.ends, strict=True)
            ]
            law = (
                {"stiffness": spring.stiffness, "force": -spring.preload}
                if line in self.car.springs
                else {"springForceUserFunction": laws[line.corner]}
            )
            self.system.AddObject(
                self.items.ObjectConnectorSpringDamper(
                    markerNumbers=markers,
                    referenceLength=float(np.linalg.norm(np.subtract(*line.ends))),
                    **law,
                )
            )

    def _add_bars(self) -> None:
        for bar in self.car.stabilizer_bars:
            frame = frame_about(AXLE)
            self.system.AddObject(
                self.items.ObjectConnectorTorsionalSpringDamper(
                    markerNumbers=[self.marker(body, bar.point, frame) for body in bar.bodies],
                    stiffness=bar.stiffness,
                    damping=bar.damping,
                )
            )

    def _add_wheels(self) -> None:
        law = self._record(
            tyre_law(self.car.tyre, self.exudyn.symbolic),
            "ObjectConnectorCartesianSpringDamper",
            "springForceUserFunction",
        )
        origin = self.system.AddMarker(self.items.MarkerBodyPosition(bodyNumber=self.ground))
        self.tyres, self.tractions, self.torques, self.reactions = [], [], [], []
        for wheel in self.car.wheels:
            centre = self.marker(wheel.body, wheel.centre)
            self.tyres.append(
                self.system.AddObject(
                    self.items.ObjectConnectorCartesianSpringDamper(
                        markerNumbers=[origin, centre], springForceUserFunction=law
                    )
                )
            )
            self.tractions.append(
                self.system.AddLoad(self.items.LoadForceVector(markerNumber=centre))
            )
            self.torques.append(
                self.system.AddLoad(self.items.LoadTorqueVector(markerNumber=centre))
            )
            self.reactions.append(self._reaction(wheel.driven_against))

    def _reaction(self, body: str | None) -> int | None:
        if body is None:
            return None
        marker = self.marker(body, self.groups[self.index[body]].cg)
        return self.system.AddLoad(self.items.LoadTorqueVector(markerNumber=marker))

    def _add_brakes(self) -> list[int]:
        """Numbers of the connectors between carriers and wheels."""
        law = self._record(
            brake_law(self.car.tyre.rolling_radius, self.exudyn.symbolic),
            "ObjectConnectorTorsionalSpringDamper",
            "springTorqueUserFunction",
        )
        frame = frame_about(AXLE)
        return [
            self.system.AddObject(
                self.items.ObjectConnectorTorsionalSpringDamper(
                    markerNumbers=[
                        self.marker(body, wheel.centre, frame)
                        for body in (wheel.carrier, wheel.body)
                    ],
                    springTorqueUserFunction=law,
                )
            )
            for wheel in self.car.wheels
        ]

    def hold_coordinate(self, group: int, coordinate: int, stiffness: float, at: float) -> int:
        """Number of a new spring that holds a coordinate at a displacement from the design."""
        marker = self.system.AddMarker(
            self.items.MarkerNodeCoordinate(nodeNumber=self._nodes[group], coordinate=coordinate)
        )
        return self.system.AddObject(
            self.items.ObjectConnectorCoordinateSpringDamper(
                markerNumbers=[self._still, marker], stiffness=stiffness, offset=at
            )
        )

    def _add_holds(self) -> list[int]:
        """Springs on x, y and yaw of the chassis and on the wheels' spin."""
        node = self.system.AddNode(self.items.NodePointGround())
        self._still = self.system.AddMarker(
            self.items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0)
        )
        held = [(self.chassis, k) for k in (0, 1, 5)] + [(wheel, 5) for wheel in self.wheels]
        return [self.hold_coordinate(group, k, HOLD, 0.0) for group, k in held]
