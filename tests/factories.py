"""Vehicles and states for tests: the documented reference car, and random physical ones.

Every random thing takes a numpy Generator. Random cars span what the vehicle check accepts of
real cars: any drive, hub motors, inboard brakes, product of inertia, offset centres of gravity,
pivots outside the wheelbase.
"""

from dataclasses import dataclass, replace

import numpy as np
from ridetune.engine.vehicle import (
    Axle,
    Brakes,
    Chassis,
    Inertia,
    Inertia3,
    Pivot,
    StabilizerBar,
    Suspension,
    Tyre,
    Vehicle,
    Wheel,
    check,
)


def paper_vehicle():
    """The reference vehicle of the model's description, typed from there."""
    inertia, tyre = Inertia3(0.6, 1.1, 0.6), Tyre(196261.0, 50.0, 0.01)
    return Vehicle(
        name="reference",
        chassis=Chassis(1090.0, Inertia(420.0, 1550.0, 1700.0, 0.0), 0.56),
        front=Axle(
            cg_distance=1.30,
            track=1.50,
            wheel=Wheel(36.0, 0.30, inertia),
            suspension=Suspension(24000.0, 1700.0, 0.40),
            stabilizer_bar=StabilizerBar(22000.0, 150.0),
            pivot=Pivot(1.60, np.radians(4.0)),
            tyre=tyre,
            driven=False,
        ),
        rear=Axle(
            cg_distance=1.36,
            track=1.51,
            wheel=Wheel(39.0, 0.30, inertia),
            suspension=Suspension(27000.0, 1900.0, 0.40),
            stabilizer_bar=StabilizerBar(9000.0, 100.0),
            pivot=Pivot(1.10, np.radians(10.0)),
            tyre=tyre,
            driven=True,
        ),
    )


def random_axle(rng, *, driven, outside=0.15, offsets=True):
    """An axle of a car between a small one and a van; `outside` is the share of negative d."""
    radius = rng.uniform(0.26, 0.38)
    a, b, c = rng.uniform(0.3, 1.0, 3)
    offset = rng.uniform([-0.05, -0.08, -0.05], [0.15, 0.08, 0.05]) if offsets else np.zeros(3)
    sign = -1 if rng.random() < outside else 1
    return Axle(
        cg_distance=rng.uniform(0.9, 1.8),
        track=rng.uniform(1.3, 1.8),
        # Moments as sums of pairs obey the triangle inequality.
        wheel=Wheel(rng.uniform(20, 70), radius, Inertia3(a + b, a + c, b + c), tuple(offset)),
        suspension=Suspension(
            rng.uniform(12e3, 60e3), rng.uniform(500, 4000), rng.uniform(0.25, 0.6)
        ),
        stabilizer_bar=StabilizerBar(rng.uniform(0, 40e3), rng.uniform(0, 300)),
        pivot=Pivot(sign * rng.uniform(0.4, 3.0), rng.uniform(-0.2, 0.5)),
        tyre=Tyre(rng.uniform(120e3, 350e3), rng.uniform(0, 500), rng.uniform(0, 0.03)),
        driven=driven,
        torque_reaction=str(rng.choice(["chassis", "arm"])),
    )


def random_vehicle(rng, *, braked=None, outside=0.15, offsets=True):
    """A physical car; with brakes (True), without (False) or as it falls (None)."""
    front_driven, rear_driven = [(True, False), (False, True), (True, True)][rng.integers(3)]
    # Moments as sums of pairs obey the triangle inequality, xz**2 < b c keeps it.
    a, b = rng.uniform(250, 900), rng.uniform(900, 2500)
    c = rng.uniform(0.05, 0.3) * a
    xz = rng.uniform(-0.15, 0.15) * a
    if braked is None:
        braked = rng.random() < 0.7
    brakes = Brakes(rng.uniform(0.3, 0.9), str(rng.choice(["arm", "chassis"]))) if braked else None
    vehicle = Vehicle(
        name="random",
        chassis=Chassis(
            rng.uniform(700, 2200), Inertia(a + c, b + c, a + b, xz), rng.uniform(0.45, 0.9)
        ),
        front=random_axle(rng, driven=front_driven, outside=outside, offsets=offsets),
        rear=random_axle(rng, driven=rear_driven, outside=outside, offsets=offsets),
        brakes=brakes,
    )
    check(vehicle)
    return vehicle


DAMPERS = {
    "front.suspension.rebound_ratio": 2.5,
    "front.suspension.knee_speed": 0.4,
    "rear.suspension.rebound_ratio": 2.0,
    "rear.suspension.knee_speed": 0.2,
}
"""Two-slope dampers as road cars have them, SI."""


def with_random_dampers(vehicle, rng):
    """The car with two-slope dampers, each axle with a knee or without."""
    axles = {
        name: replace(
            axle,
            suspension=replace(
                axle.suspension,
                rebound_ratio=rng.uniform(0.3, 4.0),
                knee_speed=rng.choice([None, rng.uniform(0.05, 2.0)]),
            ),
        )
        for name, axle in (("front", vehicle.front), ("rear", vehicle.rear))
    }
    return replace(vehicle, **axles)


def mirrored(values):
    """The same four corner values of the car in the mirror: left and right change places."""
    return np.asarray(values, dtype=float)[..., [1, 0, 3, 2]]


def mirrored_coordinates(q):
    """Coordinates, rates or accelerations (8,) in the mirror: roll changes sign too."""
    q = np.asarray(q, dtype=float)
    return np.concatenate([q[:3], -q[3:4], mirrored(q[4:])])


@dataclass(frozen=True)
class RoadState:
    """A state of the direct mode with its inputs: the keyword arguments of an acceleration."""

    q: np.ndarray
    qd: np.ndarray
    inputs: dict

    def mirror(self):
        """The same situation in the mirror."""
        inputs = {name: mirrored(values) for name, values in self.inputs.items()}
        return RoadState(mirrored_coordinates(self.q), mirrored_coordinates(self.qd), inputs)


@dataclass(frozen=True)
class RimsState:
    """A state of the rims mode with its inputs: the arguments of its accelerations."""

    pose: np.ndarray
    rates: np.ndarray
    v: float
    u: np.ndarray
    u_rate: np.ndarray
    u_acc: np.ndarray
    a_x: float
    braking: float

    @property
    def arguments(self):
        """All of them in order."""
        return (
            *(self.pose, self.rates, self.v, self.u, self.u_rate, self.u_acc),
            *(self.a_x, self.braking),
        )

    def mirror(self):
        """The same situation in the mirror."""
        flip = np.array([1.0, 1.0, -1.0])
        return RimsState(
            self.pose * flip,
            self.rates * flip,
            self.v,
            *(mirrored(values) for values in (self.u, self.u_rate, self.u_acc)),
            self.a_x,
            self.braking,
        )


def random_road_state(rng, vehicle):
    """Positions, rates and inputs of lively driving, far beyond small angles' linear range."""
    arm_lengths = np.abs([vehicle.front.pivot.distance] * 2 + [vehicle.rear.pivot.distance] * 2)
    q = np.concatenate(
        [
            rng.uniform(-20, 20, 1),
            rng.uniform(-0.06, 0.06, 1),
            rng.uniform(-0.1, 0.1, 2),
            rng.uniform(-0.1, 0.1, 4) / arm_lengths,
        ]
    )
    qd = np.concatenate(
        [random_speed(rng), rng.uniform(-1, 1, 3), rng.uniform(-1.5, 1.5, 4) / arm_lengths]
    )
    driven = np.repeat([vehicle.front.driven, vehicle.rear.driven], 2)
    inputs = {
        "road_height": rng.uniform(-0.05, 0.05, 4),
        "road_rate": rng.uniform(-1, 1, 4),
        "drive": np.where(driven, rng.uniform(-300, 900, 4), 0.0),
        "brake": rng.uniform(0, 1500, 4) * (vehicle.brakes is not None),
    }
    return RoadState(q, qd, inputs)


def random_rims_state(rng, vehicle):
    """Pose, rates and prescribed wheel motion as a recording of lively driving has them."""
    braking = float(rng.choice([0.0, 1.0, rng.random()])) if vehicle.brakes else 0.0
    return RimsState(
        pose=np.concatenate([rng.uniform(-0.06, 0.06, 1), rng.uniform(-0.05, 0.05, 2)]),
        rates=rng.uniform(-0.6, 0.6, 3),
        v=random_speed(rng)[0],
        u=rng.uniform(-0.03, 0.03, 4),
        u_rate=rng.uniform(-1, 1, 4),
        u_acc=rng.uniform(-30, 30, 4),
        a_x=rng.uniform(-8, 5),
        braking=braking,
    )


def random_speed(rng):
    """A speed (1,): standing, creeping where rolling resistance turns on, or driving."""
    return rng.choice([0.0, rng.uniform(-0.3, 0.3), rng.uniform(1, 40)], size=1)
