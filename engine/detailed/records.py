"""The detailed car as data: one frozen record for each section of its JSON file.

Points and axes are in the design frame: x forward, y left, z up, origin on the ground below the
front axle, the car in its design position. Everything is in SI and radians. An element between two
bodies names both; what it does to the second it does to the first with the opposite sign.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from ..frames import AxleName, Corner, axle_of
from ..vehicle import Range

Coordinate = Annotated[float, Range("m", -10.0, 10.0)]
Point = tuple[Coordinate, Coordinate, Coordinate]
Direction = Annotated[float, Range("1", -1.0, 1.0)]
Axis = tuple[Direction, Direction, Direction]
Pair = tuple[str, str]
Stiffness = Annotated[float, Range("N/m", 0.0, 1e9)]
Cubic = Annotated[float, Range("N/m^3", 0.0, 1e13)]
Damping = Annotated[float, Range("N s/m", 0.0, 1e7)]
Gap = Annotated[float, Range("m", 0.0, 1.0)]
Length = Annotated[float, Range("m", 1e-3, 5.0)]
Moment = Annotated[float, Range("kg m^2", 1e-6, 1e5)]
Product = Annotated[float, Range("kg m^2", -1e5, 1e5)]
Each = Annotated[float, Range("N/m or N m/rad", 0.0, 1e9)]
Amplitude = Annotated[float, Range("m or rad", 1e-6, 100.0)]

JointKind = Literal["fixed", "ball", "universal", "revolute", "cylindrical"]

CONSTRAINED: dict[JointKind, tuple[int, ...]] = {
    "fixed": (0, 1, 2, 3, 4, 5),
    "ball": (0, 1, 2),
    "universal": (0, 1, 2, 5),
    "revolute": (0, 1, 2, 3, 4),
    "cylindrical": (0, 1, 3, 4),
}
"""What a joint holds of the relative motion in its frame, whose z is the joint's axis: translations
0 ... 2 and rotations 3 ... 5 about x, y, z."""


@dataclass(frozen=True, slots=True)
class Tensor:
    """Elements of an inertia tensor at the body's CG in the design frame."""

    xx: Moment
    yy: Moment
    zz: Moment
    xy: Product = 0.0
    xz: Product = 0.0
    yz: Product = 0.0

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The tensor (3, 3), kg m2."""
        return np.array(
            [
                [self.xx, self.xy, self.xz],
                [self.xy, self.yy, self.yz],
                [self.xz, self.yz, self.zz],
            ]
        )


@dataclass(frozen=True, slots=True)
class BodyData:
    """A rigid body; cg in the design frame."""

    name: str
    mass: Annotated[float, Range("kg", 0.01, 1e5)]
    cg: Point
    inertia: Tensor


@dataclass(frozen=True, slots=True)
class Joint:
    """An ideal joint; a ball and a fixed joint need no axis.

    A universal joint lets the second body turn about two axes square to `axis` and not about it.
    """

    kind: JointKind
    bodies: Pair
    point: Point
    axis: Axis | None = None


@dataclass(frozen=True, slots=True)
class BushingLaw:
    """Rubber, per axis of the design frame: three translations, three rotations.

        f = k u (1 + (u/s)^2) + k tau v / sqrt(1 + (v/v0)^2)

    stiffness : k, N/m and N m/rad;  scale : s, m and rad;  time_constant : tau, s
    """

    name: str
    stiffness: tuple[Each, Each, Each, Each, Each, Each]
    scale: tuple[Amplitude, Amplitude, Amplitude, Amplitude, Amplitude, Amplitude]
    time_constant: Annotated[float, Range("s", 0.0, 1.0)]


@dataclass(frozen=True, slots=True)
class Bushing:
    """A bushing of a law between two bodies at a point."""

    law: str
    bodies: Pair
    point: Point


@dataclass(frozen=True, slots=True)
class Spring:
    """A coil spring: preload in the design position, N, and stiffness."""

    stiffness: Stiffness
    preload: Annotated[float, Range("N", 0.0, 1e6)]


@dataclass(frozen=True, slots=True)
class Damper:
    """c v / sqrt(1 + (v/speed)^2), c by the direction of v."""

    bump: Damping
    rebound: Damping
    speed: Annotated[float, Range("m/s", 0.01, 100.0)]


@dataclass(frozen=True, slots=True)
class Stop:
    """k d + k3 d^3 once the damper has moved by `gap` from the design position, d beyond it."""

    gap: Gap
    stiffness: Stiffness
    cubic: Cubic


@dataclass(frozen=True, slots=True)
class Strut:
    """Spring, damper and stops of one axle's corners."""

    spring: Spring
    damper: Damper
    bump_stop: Stop
    rebound_stop: Stop


@dataclass(frozen=True, slots=True)
class Line:
    """A straight element of a corner between two points, the first on the first body."""

    corner: Corner
    bodies: Pair
    ends: tuple[Point, Point]


@dataclass(frozen=True, slots=True)
class StabilizerBar:
    """Both halves of a bar, left first, twist against each other about the design frame's y."""

    axle: AxleName
    bodies: Pair
    point: Point
    stiffness: Annotated[float, Range("N m/rad", 0.0, 1e6)]
    damping: Annotated[float, Range("N m s/rad", 0.0, 1e5)]


@dataclass(frozen=True, slots=True)
class Wheel:
    """A wheel that turns with `body` about y through `centre`.

    carrier : the body that holds its axle
    driven_against : the body that takes the reaction of its drive torque; None is not driven
    """

    corner: Corner
    body: str
    carrier: str
    centre: Point
    driven_against: str | None = None


@dataclass(frozen=True, slots=True)
class Brakes:
    """Front axle's share of the braking force; a brake holds its wheel against the carrier."""

    front_share: Annotated[float, Range("1", 0.0, 1.0)]


@dataclass(frozen=True, slots=True)
class SlipLaw:
    """Force = slip_stiffness * slip for small steady slip, after a way of relaxation_length."""

    slip_stiffness: Annotated[float, Range("N", 1.0, 1e7)]
    relaxation_length: Length


@dataclass(frozen=True, slots=True)
class TyreData:
    """What `tyre` describes.

    free_radius : wheel centre above the road without load;  rolling_radius : speed over spin
    patch_length : the road is averaged over it
    """

    free_radius: Length
    rolling_radius: Length
    stiffness: Stiffness
    damping: Damping
    rolling_resistance: Annotated[float, Range("1", 0.0, 1.0)]
    patch_length: Annotated[float, Range("m", 0.01, 1.0)]
    friction: Annotated[float, Range("1", 0.1, 5.0)]
    longitudinal: SlipLaw
    lateral: SlipLaw


@dataclass(frozen=True)
class DetailedCar:
    """The whole car.

    chassis : the body whose motion is the car's
    measured_point : where on it z, a_x, v_x and x are taken, the CG of the sprung mass (`concept`)
    bushing_speed : v0 of every bushing, m/s and rad/s
    """

    name: str
    chassis: str
    measured_point: Point
    tyre: TyreData
    front: Strut
    rear: Strut
    wheels: tuple[Wheel, ...]
    brakes: Brakes
    bushing_speed: Annotated[float, Range("m/s or rad/s", 1e-3, 100.0)]
    bushing_laws: tuple[BushingLaw, ...]
    bodies: tuple[BodyData, ...]
    joints: tuple[Joint, ...]
    bushings: tuple[Bushing, ...]
    springs: tuple[Line, ...]
    dampers: tuple[Line, ...]
    stabilizer_bars: tuple[StabilizerBar, ...]
    description: str = ""

    def wheels_of(self, axle: AxleName) -> tuple[Wheel, ...]:
        """The wheels of an axle."""
        return tuple(wheel for wheel in self.wheels if axle_of(wheel.corner) == axle)

    def middle(self, axle: AxleName) -> NDArray[np.float64]:
        """Mean of an axle's wheel centres (3,)."""
        return np.mean([wheel.centre for wheel in self.wheels_of(axle)], axis=0)

    @cached_property
    def body_named(self) -> dict[str, BodyData]:
        """Bodies by name."""
        return {body.name: body for body in self.bodies}

    @cached_property
    def law_named(self) -> dict[str, BushingLaw]:
        """Bushing laws by name."""
        return {law.name: law for law in self.bushing_laws}

    @property
    def total_mass(self) -> float:
        """Mass of all bodies, kg."""
        return sum(body.mass for body in self.bodies)

    def strut(self, corner: Corner) -> Strut:
        """Spring, damper and stops at a corner."""
        return self.front if axle_of(corner) == "front" else self.rear
