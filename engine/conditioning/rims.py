"""String potentiometers and the chassis's motion to the wheel centres' heights.

A potentiometer between wheel centre and mount, straight above it at rest by H, reads L0 - L. With
the wheel centre at c in the body's axes, at c_0 at rest,

    (1)  wheel z = z + e_Z . c - c_0z,      e_Z = (-sin p, cos p sin r, cos p cos r)

`vertical`: the wheel moves along the body's z axis, c = c_0 + (0, 0, travel). It needs nothing that
a fit has yet to find. What it leaves out is of second order: an arm that carries the wheel by D
along the car turns the potentiometer, which then reads D^2 / (2 H) less than the wheel rises, and
pitch adds D sin p. D is the arm's slope times the rise, a tenth of it or so.

`arm`: exact for the vehicle's pivots. With s the wheel centre from the pivot at rest and m = s +
(0, 0, H), the length L and the arm's angle a belong together by

    (2)  A cos a + B sin a = (|m|^2 + |s|^2 - L^2) / 2,     A = m . s,  B = -H s_x
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from ..channels import OUTPUT_CHANNELS
from ..errors import ConditioningError
from ..frames import CORNERS, Corner, side_of
from ..run import Run
from ..vehicle import Vehicle
from .done import Array, Done, history, require

Geometry = Literal["vertical", "arm"]


@dataclass(frozen=True, slots=True)
class RimFromTravel:
    """Heights of the wheel centres by string potentiometers, z, pitch and roll.

    corners : of which wheels
    geometry : how the wheel moves in the chassis
    """

    kind: ClassVar[str] = "rim-from-travel"
    corners: tuple[Corner, ...] = CORNERS
    geometry: Geometry = "vertical"

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run with the wheels."""
        if vehicle is None:
            raise ConditioningError(
                "where the wheels are is not known; give a vehicle, of which it takes track, "
                "cg_distance and radius."
            )
        if not self.corners:
            raise ConditioningError("no corner is named; name fl, fr, rl or rr.")
        require(
            run, [*(f"suspension.{corner}.travel" for corner in self.corners), *OUTPUT_CHANNELS]
        )
        z, pitch, roll = (history(run, name) for name in OUTPUT_CHANNELS)
        found, apart, bands = {}, 0.0, []
        for corner in self.corners:
            travel = history(run, f"suspension.{corner}.travel")
            both = {
                "vertical": _vertical(vehicle, corner, travel),
                "arm": _on_arm(vehicle, corner, travel),
            }
            rises = {
                name: z + _height(centre, pitch, roll) - centre_at_rest(vehicle, corner)[2]
                for name, centre in both.items()
            }
            found[f"wheel.{corner}.z"] = rises[self.geometry]
            apart = max(apart, float(np.max(np.abs(rises["arm"] - rises["vertical"]))))
        bands = [record.band_hz for record in run.conditioning if "chassis.z" in record.channels]
        where = "straight up and down" if self.geometry == "vertical" else "on the vehicle's arms"
        return Done(
            found,
            numbers={"arm_less_vertical_m": apart},
            band_hz=bands[-1] if bands else (None, None),
            sentences=(
                f"Wheels move {where}; the other way differs by {1e3 * apart:.2g} mm at most with "
                "the vehicle's pivots.",
            ),
        )


def centre_at_rest(vehicle: Vehicle, corner: Corner) -> Array:
    """A wheel centre at rest from the CG, (3,) in the body's axes, m."""
    axle = vehicle.axle_at(corner)
    ahead = axle.cg_distance if corner[0] == "f" else -axle.cg_distance
    across = side_of(corner) * 0.5 * axle.track
    return np.array([ahead, across, axle.wheel.radius - vehicle.chassis.cg_height])


def _vertical(vehicle: Vehicle, corner: Corner, travel: Array) -> Array:
    """Wheel centre (3, samples) that moves along the body's z axis."""
    return centre_at_rest(vehicle, corner)[:, np.newaxis] + np.stack(
        [0 * travel, 0 * travel, travel]
    )


def _on_arm(vehicle: Vehicle, corner: Corner, travel: Array) -> Array:
    """Wheel centre (3, samples) that moves on its arm."""
    axle = vehicle.axle_at(corner)
    high = axle.suspension.mount_height
    inwards = axle.pivot.distance
    x = inwards if corner[0] == "f" else -inwards
    z = axle.wheel.radius - inwards * np.tan(axle.pivot.angle)
    a, b = x**2 + z**2 + high * z, -high * x
    squares = x**2 + (z + high) ** 2 + x**2 + z**2
    share = 0.5 * (squares - (high - travel) ** 2) / np.hypot(a, b)
    if np.any(np.abs(share) > 1.0) or np.any(travel >= high):
        raise ConditioningError(
            f"suspension.{corner}.travel goes beyond what the vehicle's arm can reach; check its "
            "unit and its rest value, or the pivot."
        )
    rest = np.arctan2(b, a)
    angle = rest - np.sign(rest) * np.arccos(share)
    moved = np.stack(
        [
            x * (np.cos(angle) - 1.0) + z * np.sin(angle),
            np.zeros_like(angle),
            z * (np.cos(angle) - 1.0) - x * np.sin(angle),
        ]
    )
    return centre_at_rest(vehicle, corner)[:, np.newaxis] + moved


def _height(place: Array, pitch: Array, roll: Array) -> Array:
    """Height over the CG of a place (3, samples) in the body's axes, m."""
    sp, cp, sr, cr = np.sin(pitch), np.cos(pitch), np.sin(roll), np.cos(roll)
    return -sp * place[0] + cp * sr * place[1] + cp * cr * place[2]
