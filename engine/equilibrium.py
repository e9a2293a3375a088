"""Static equilibrium: what the tyres and springs carry at rest, which fixes the preloads.

The whole car's moments about the ground under one axle give the other axle's load; no horizontal
force acts at rest. With the CG of a corner's moving parts `c` towards the middle of the car from
the wheel centre (l distances from the sprung mass's CG, L the wheelbase):

    W_front L = g (m_s l_r + 2 m_f (L - c_f) + 2 m_r c_r),   W_front + W_rear = g m_total

A trailing arm turns about a pivot that lies `d` towards the middle. Its moments give the force of
the spring, which stands over the wheel centre:

    W0 d - F0 d - m_i g (d - c) = 0,   F0 = W0 - m_i g (1 - c / d)

The moment of the pivot's own vertical force vanishes, whatever the sign of `d`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from .frames import AXLES, CORNERS, GRAVITY, AxleName, Corner, axle_of
from .vehicle import Condition, Vehicle, all_hold, require


@dataclass(frozen=True, slots=True)
class StaticLoads:
    """Forces at rest on flat ground, N.

    axle_load : on the ground under both wheels of an axle
    tyre_load : W0, on the ground under one wheel
    preload : F0, compression of one spring
    """

    axle_load: dict[AxleName, float]
    tyre_load: dict[Corner, float]
    preload: dict[Corner, float]


def static_loads(vehicle: Vehicle) -> StaticLoads:
    """Axle loads, tyre loads and spring preloads in the design position.

    Raises VehicleError where an axle would lift off at rest or its springs would have to pull.
    """
    loads = loads_at_rest(vehicle)
    require(_conditions(loads))
    return loads


def stands(loads: StaticLoads) -> Any:
    """Whether a car can stand on such loads, which `static_loads` refuses otherwise; of many cars
    (C,).
    """
    return all_hold(holds for holds, _ in _conditions(loads))


def loads_at_rest(vehicle: Vehicle) -> StaticLoads:
    """What `static_loads` checks, of one car or of many."""
    front, rear, wheelbase = vehicle.front, vehicle.rear, vehicle.wheelbase
    front_share = (
        vehicle.chassis.mass * rear.cg_distance
        + 2.0 * front.wheel.mass * (wheelbase - front.wheel.cg_offset[0])
        + 2.0 * rear.wheel.mass * rear.wheel.cg_offset[0]
    ) / (wheelbase * vehicle.total_mass)
    weight = GRAVITY * vehicle.total_mass
    axle_load: dict[AxleName, float] = {
        "front": front_share * weight,
        "rear": (1.0 - front_share) * weight,
    }
    preload: dict[AxleName, float] = {
        name: 0.5 * axle_load[name] - _carried_by_wheel(vehicle, name) for name in AXLES
    }
    return StaticLoads(
        axle_load=axle_load,
        tyre_load={corner: 0.5 * axle_load[axle_of(corner)] for corner in CORNERS},
        preload={corner: preload[axle_of(corner)] for corner in CORNERS},
    )


def _conditions(loads: StaticLoads) -> Iterator[Condition]:
    left: dict[AxleName, Corner] = {"front": "fl", "rear": "rl"}
    for name in AXLES:
        load, preload = loads.axle_load[name], loads.preload[left[name]]
        yield (
            load > 0.0,
            lambda: (
                f"At rest the {name} wheels would have to pull on the ground with {-load:.4g} N;"
                " correct the axles' cg_distance or wheel.cg_offset."
            ),
        )
        yield (
            preload > 0.0,
            lambda: (
                f"At rest each {name} spring would have to pull with {-preload:.4g} N, for the"
                f" wheel's own weight acts behind its arm; correct {name}.wheel.cg_offset,"
                f" {name}.wheel.mass or {name}.pivot.distance."
            ),
        )


def _carried_by_wheel(vehicle: Vehicle, name: AxleName) -> float:
    """Part of a corner's own weight that its wheel carries past the spring, N."""
    axle = vehicle.axle(name)
    lever = 1.0 - axle.wheel.cg_offset[0] / axle.pivot.distance
    return GRAVITY * axle.wheel.mass * lever
