"""Side-view kinematics: about which point a wheel carrier turns as its wheel travels.

With the chassis held, both wheels of an axle are lifted together by the road. From the carrier's
motion between two heights, (vx, vz) of the wheel centre and w about +y, the point at rest lies at

    (x, z) = (vz / w, -vx / w)    from the wheel centre,

the lateral instant centre. As in the concept model (docs/model.md) it is given by its longitudinal
distance d from the contact point towards the middle of the car and the angle phi, d tan(phi) above
the ground. Bushings give way under the springs' load, as they do on the road.
"""

from dataclasses import dataclass
from math import atan2

import numpy as np
from numpy.typing import NDArray

from ..errors import SimulationError
from ..frames import AxleName, axle_of
from .builder import Model
from .equilibrium import coordinates, settle, static_settings
from .pose import point, rotation

Array = NDArray[np.float64]

CLAMP = 1e9
"""Stiffness of the springs that hold the chassis, N/m and N m/rad."""

INCREMENT = 2e-3
"""Road height between the two positions of one instant centre, m."""

SMALL_STEP = 5e-3
"""Greatest step of the road, m; the tyres are squeezed by thrice as much."""

LOCKED = 0.2
"""Least rise of a wheel for a rise of the road: below it the suspension is locked."""


@dataclass(frozen=True, slots=True)
class InstantCentre:
    """Pivot of an axle's carriers at one wheel travel.

    travel : of the wheel centre from rest, jounce, m
    distance : d, m;  angle : phi, rad
    """

    travel: float
    distance: float
    angle: float


def instant_centres(
    model: Model, axle: AxleName, heights: tuple[float, ...] = (-0.03, -0.015, 0.0, 0.015, 0.03)
) -> list[InstantCentre]:
    """Instant centres of an axle with its road raised by some heights, m.

    model : a new one; it is left with a chassis that is held
    """
    rest = clamped(model)
    return [_instant_centre(model, axle, height, rest) for height in heights]


def clamped(model: Model) -> Array:
    """Hold the chassis of a new model where it rests; displacements (groups, 6) there."""
    rest = settle(model)
    for k in range(6):
        model.hold_coordinate(model.chassis, k, CLAMP, float(rest[model.chassis, k]))
    model.system.Assemble()
    model.hold(True)
    return rest


def _instant_centre(model: Model, axle: AxleName, height: float, rest: Array) -> InstantCentre:
    """One instant centre, by central differences, of the left wheel."""
    lower, upper = around(model, axle, height)
    wheel = next(one for one in model.car.wheels if axle_of(one.corner) == axle)
    carrier = model.index[wheel.carrier]
    offset = model.in_body(wheel.carrier, wheel.centre)

    def centre(q: Array) -> Array:
        return point((q + model.design)[carrier], offset)

    moved = centre(upper) - centre(lower)
    turn = rotation(upper[carrier, 3:]) @ rotation(lower[carrier, 3:]).T
    turned = float(turn[0, 2] - turn[2, 0]) / 2.0
    place = (centre(upper) + centre(lower)) / 2.0
    inwards = -1.0 if axle == "front" else 1.0
    distance = float(moved[2]) / turned * inwards
    # The contact point is the ground: with the chassis held it is the road that rises.
    above_ground = float(place[2]) - height - float(moved[0]) / turned
    return InstantCentre(
        travel=float(place[2] - centre(rest)[2]),
        distance=distance,
        angle=atan2(above_ground, abs(distance)) * (1.0 if distance > 0.0 else -1.0),
    )


def around(model: Model, axle: AxleName, height: float) -> tuple[Array, Array]:
    """Displacements (groups, 6) of a clamped model with an axle's road just below and above.

    Raises SimulationError for a suspension that does not let its wheels follow.
    """
    lower = _raised(model, axle, height - INCREMENT / 2.0)
    upper = _raised(model, axle, height + INCREMENT / 2.0)
    wheels = [model.index[wheel.body] for wheel in model.car.wheels_of(axle)]
    if not np.all(upper[wheels, 2] - lower[wheels, 2] > LOCKED * INCREMENT):
        raise SimulationError(
            f"The {axle} suspension is locked: its wheels do not rise with the road; check the"
            " joints and points of its links."
        )
    return lower, upper


def _raised(model: Model, axle: AxleName, height: float) -> Array:
    """Displacements (groups, 6) at rest with the road under an axle at some height.

    The road goes there from where it is in small steps: a large one would lift the tyres off,
    which leaves the wheels free.
    """
    tyres = [
        tyre
        for tyre, wheel in zip(model.tyres, model.car.wheels, strict=True)
        if axle_of(wheel.corner) == axle
    ]
    start = float(model.system.GetObjectParameter(tyres[0], "offset")[2])
    steps = max(int(np.ceil(abs(height - start) / SMALL_STEP)), 1)
    for reached in start + (height - start) * np.arange(1, steps + 1) / steps:
        for tyre in tyres:
            model.system.SetObjectParameter(tyre, "offset", [0.0, 0.0, float(reached)])
        try:
            model.system.SolveStatic(static_settings(model), updateInitialValues=True)
        except model.exudyn.ExudynError as error:
            raise SimulationError(
                f"The {axle} suspension does not follow a road {1e3 * reached:.1f} mm high: the"
                " static solution fails; check the joints and points of its links."
            ) from error
    return coordinates(model)
