"""The engine's right-hand side for one free car, as other integrators call it."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...engine.demand import Demand
from ...engine.jit import compiled
from ...engine.kernels.buffer import ROWS, SLOPE, STAGE, STATES, take_car
from ...engine.kernels.free import free_slopes
from ...engine.kernels.lanes import ONE_CAR

Array = NDArray[np.float64]


@compiled
def _rate(lanes, t, y, buffer, knots, torques, road, start, spacing):
    """dy/dt (16,); torques (k, 8) : drive and brake torques at the knots, linear between them."""
    acting = np.zeros(16)
    last = len(knots) - 2
    k = min(max(np.searchsorted(knots, t) - 1, 0), last)
    share = min(max((t - knots[k]) / (knots[k + 1] - knots[k]), 0.0), 1.0)
    for column in range(8):
        acting[8 + column] = (1.0 - share) * torques[k, column] + share * torques[k + 1, column]
    buffer[STAGE : STAGE + STATES] = y
    free_slopes(buffer, len(lanes), acting, (road, start, spacing))
    return buffer[SLOPE : SLOPE + STATES].copy()


@compiled
def _take(buffer, car):
    take_car(buffer, 1, 0, car)


def rate_of(car: Array, demand: Demand) -> Callable[[float, Array], Array]:
    """dy/dt = f(t, y) of one car (CAR_ROWS,) on a road whose torques do not jump."""
    assert demand.road is not None
    road = demand.road
    knots = np.union1d(demand.drive.knots, demand.brake.knots)
    torques = np.concatenate([demand.drive.at(knots), demand.brake.at(knots)], axis=1)
    buffer = np.zeros(ROWS)
    _take(buffer, car)

    def rate(t: float, y: Array) -> Array:
        return _rate(
            ONE_CAR, t, y, buffer, knots, torques, road.coefficients, road.start, road.spacing
        )

    return rate
