"""Laws of drive and brake torque: data in a manoeuvre file, torques on the wheels of a car.

The drive torque is the same on all n driven wheels, and the traction is T_i / r_i. An acceleration
a of the whole car on level ground therefore takes, with M the total mass and fr the rolling
resistance,

    T_i = r_i M (a + fr g) / n

and a deceleration of level b takes brake torques B_i = r_i M (b - fr g) s_i, with s_i half the
brakes' share of the wheel's axle.
"""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from .demand import PiecewiseLinear, rolling_resistance
from .errors import ManoeuvreError
from .frames import CORNERS, CREEP_SPEED, GRAVITY
from .vehicle import Range, Vehicle

LONGEST = 600.0
"""Longest manoeuvre, s."""

Time = Annotated[float, Range("s", 0.0, LONGEST)]
Speed = Annotated[float, Range("m/s", 0.0, 100.0)]
Torque = Annotated[float, Range("N m", -1e6, 1e6)]
BrakeTorque = Annotated[float, Range("N m", 0.0, 1e6)]
Ramp = Annotated[float, Range("s", 0.0, 60.0)]


@dataclass(frozen=True, slots=True)
class ReachSpeed:
    """Constant torque that takes the car to `speed` within `time`, then none: the clutch is open.

    start : when the torque begins to rise, s
    ramp : it rises from `start` and falls from `start` + `time`, each within this time, s; so its
        impulse is that of a rectangle `time` long
    """

    kind: ClassVar[str] = "reach-speed"
    speed: Speed
    time: Annotated[float, Range("s", 0.1, LONGEST)]
    start: Time = 0.0
    ramp: Ramp = 0.1

    def __post_init__(self) -> None:
        """Refuse a ramp that does not fit."""
        if self.ramp > self.time:
            raise ManoeuvreError(
                f"ramp ({self.ramp:g} s) is longer than time ({self.time:g} s); shorten the ramp."
            )

    def wheel_torque(
        self, vehicle: Vehicle, initial_speed: float, duration: float
    ) -> PiecewiseLinear:
        """Torque on each wheel over time, N m."""
        acceleration = (self.speed - initial_speed) / self.time
        full = drive_torque(vehicle, acceleration)
        off = self.start + self.time
        time = np.array([self.start, self.start + self.ramp, off, off + self.ramp])
        return PiecewiseLinear(time, np.array([0.0, 1.0, 1.0, 0.0])[:, np.newaxis] * full)

    def end(self) -> float:
        """When the torque is gone, s."""
        return self.start + self.time + self.ramp


@dataclass(frozen=True, slots=True)
class HoldSpeed:
    """Just the torque that balances rolling resistance at the initial speed, from the beginning to
    the end: T = r M fr g tanh(v/v0) / n, so that a standing car stands.
    """

    kind: ClassVar[str] = "hold-speed"

    def wheel_torque(
        self, vehicle: Vehicle, initial_speed: float, duration: float
    ) -> PiecewiseLinear:
        """Torque on each wheel over time, N m."""
        full = drive_torque(vehicle, 0.0) * math.tanh(initial_speed / CREEP_SPEED)
        return PiecewiseLinear(np.array([0.0, duration]), np.stack([full, full]))

    def end(self) -> None:
        """The torque never ends."""
        return None


@dataclass(frozen=True, slots=True)
class DriveTable:
    """Total drive torque of all driven wheels: none before the first time, then linear, then held.

    time : s, not decreasing; a time given twice is a jump
    torque : N m, one for each time
    """

    kind: ClassVar[str] = "table"
    time: tuple[Time, ...]
    torque: tuple[Torque, ...]

    def __post_init__(self) -> None:
        """Refuse a table out of order."""
        _check_table(self.time, self.torque)

    def wheel_torque(
        self, vehicle: Vehicle, initial_speed: float, duration: float
    ) -> PiecewiseLinear:
        """Torque on each wheel over time, N m."""
        share = _driven(vehicle) / len(vehicle.driven_corners)
        return _none_before(self.time, np.outer(self.torque, share))

    def end(self) -> float | None:
        """When the torque is gone for good, s; None where the last one is not zero."""
        if self.torque[-1] != 0.0:
            return None
        acting = np.flatnonzero(self.torque)
        return self.time[acting[-1] + 1] if acting.size else 0.0


@dataclass(frozen=True, slots=True)
class Deceleration:
    """Brake torque for a constant level of deceleration, rolling resistance included.

    level : m/s2
    start : when the torque begins to rise, s
    time : how long until it falls again, s; without it, to the end of the manoeuvre
    ramp : s
    front_share : share of the front axle, used where the vehicle states no brakes
    """

    kind: ClassVar[str] = "deceleration"
    level: Annotated[float, Range("m/s^2", 0.0, 20.0)]
    start: Time = 0.0
    time: Annotated[float, Range("s", 0.0, LONGEST)] | None = None
    ramp: Ramp = 0.1
    front_share: Annotated[float, Range("1", 0.0, 1.0)] | None = None

    def wheel_torque(self, vehicle: Vehicle, duration: float) -> PiecewiseLinear:
        """Brake torque on each wheel over time, N m, not negative."""
        force = vehicle.total_mass * max(self.level - rolling_resistance(vehicle) * GRAVITY, 0.0)
        full = force * _radii(vehicle) * brake_shares(vehicle, self.front_share)
        rise = [self.start, self.start + self.ramp]
        if self.time is None:
            return PiecewiseLinear(np.array(rise), np.stack([0.0 * full, full]))
        off = max(self.start + self.time, rise[1])
        time = np.array([*rise, off, off + self.ramp])
        return PiecewiseLinear(time, np.array([0.0, 1.0, 1.0, 0.0])[:, np.newaxis] * full)


@dataclass(frozen=True, slots=True)
class BrakeTable:
    """Total brake torque of the four wheels: none before the first time, then linear, then held.

    time : s, not decreasing; a time given twice is a jump
    torque : N m, positive, one for each time
    front_share : share of the front axle, used where the vehicle states no brakes
    """

    kind: ClassVar[str] = "table"
    time: tuple[Time, ...]
    torque: tuple[BrakeTorque, ...]
    front_share: Annotated[float, Range("1", 0.0, 1.0)] | None = None

    def __post_init__(self) -> None:
        """Refuse a table out of order."""
        _check_table(self.time, self.torque)

    def wheel_torque(self, vehicle: Vehicle, duration: float) -> PiecewiseLinear:
        """Brake torque on each wheel over time, N m, not negative."""
        share = brake_shares(vehicle, self.front_share)
        return _none_before(self.time, np.outer(self.torque, share))


DriveLaw = ReachSpeed | HoldSpeed | DriveTable
BrakeLaw = Deceleration | BrakeTable


def drive_torque(vehicle: Vehicle, acceleration: float) -> NDArray[np.float64]:
    """Torque (4,) on the wheels, N m, that accelerates the whole car on level ground."""
    force = vehicle.total_mass * (acceleration + rolling_resistance(vehicle) * GRAVITY)
    return _driven(vehicle) * _radii(vehicle) * force / len(vehicle.driven_corners)


def brake_shares(vehicle: Vehicle, default: float | None) -> NDArray[np.float64]:
    """Share (4,) of the braking force at each wheel."""
    front = vehicle.brakes.front_share if vehicle.brakes is not None else default
    if front is None:
        raise ManoeuvreError(
            f"The manoeuvre brakes, but the vehicle '{vehicle.name}' has no brakes; give the"
            ' vehicle "brakes": {"front_share": 0.65} or the manoeuvre brake.front_share.'
        )
    return np.array([front, front, 1.0 - front, 1.0 - front]) / 2.0


def _check_table(time: tuple[float, ...], torque: tuple[float, ...]) -> None:
    """Raise ManoeuvreError unless the knots are as many as the torques and in order."""
    if len(time) != len(torque) or len(time) < 2:
        raise ManoeuvreError(
            f"time has {len(time)} and torque {len(torque)} values; give as many of each, two at"
            " least."
        )
    if any(later < earlier for earlier, later in zip(time, time[1:], strict=False)):
        raise ManoeuvreError("time must not decrease; put the knots in order.")


def _none_before(time: tuple[float, ...], torque: NDArray) -> PiecewiseLinear:
    """Torques (k, 4) of a table; one that begins later than the manoeuvre jumps from zero there."""
    if time[0] == 0.0:
        return PiecewiseLinear(np.array(time), torque)
    return PiecewiseLinear(np.array([time[0], *time]), np.vstack([np.zeros(4), torque]))


def _driven(vehicle: Vehicle) -> NDArray[np.float64]:
    """1 at each driven wheel (4,), else 0."""
    return np.array([float(corner in vehicle.driven_corners) for corner in CORNERS])


def _radii(vehicle: Vehicle) -> NDArray[np.float64]:
    """Radius of each wheel (4,), m."""
    return np.array([vehicle.axle_at(corner).wheel.radius for corner in CORNERS])
