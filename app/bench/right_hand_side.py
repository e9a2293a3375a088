"""The engine's right-hand side for one free car, as other integrators call it."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...engine.demand import Demand
from ...engine.jit import compiled, inlined
from ...engine.kernels.buffer import CAR, ROWS, STAGE, STATES, stage_state
from ...engine.kernels.contact import find_contacts, read_road
from ...engine.kernels.integrate import free_car, slope_of
from ...engine.kernels.lanes import ONE_CAR

Array = NDArray[np.float64]


@inlined
def free_slope(buffer, LANES, acting, road, start, spacing):
    """Derivative of the first lane's stage state; acting : one row of stage inputs (16,)."""
    find_contacts(buffer, LANES)
    read_road(buffer, LANES, acting, road, start, spacing)
    _, fl, fr, rl, rr, a = free_car(buffer, LANES, 0)
    return slope_of(stage_state(buffer, LANES, 0), a.chassis, a.fl, a.fr, a.rl, a.rr)


@compiled
def _rate(lanes, t, y, buffer, knots, torques, road, start, spacing):
    """dy/dt (16,); torques (k, 8) : drive and brake torques at the knots, linear between them."""
    acting = np.zeros(16)
    last = len(knots) - 2
    k = min(max(np.searchsorted(knots, t) - 1, 0), last)
    share = min(max((t - knots[k]) / (knots[k + 1] - knots[k]), 0.0), 1.0)
    for column in range(8):
        acting[8 + column] = (1.0 - share) * torques[k, column] + share * torques[k + 1, column]
    LANES = len(lanes)
    for row in range(STATES):
        buffer[STAGE + row] = y[row]
    slope = free_slope(buffer, LANES, acting, road, start, spacing)
    rate = np.empty(STATES)
    for row in range(STATES):
        rate[row] = slope[row]
    return rate


def rate_of(car: Array, demand: Demand) -> Callable[[float, Array], Array]:
    """dy/dt = f(t, y) of one car (CAR_ROWS,) on a road whose torques do not jump."""
    assert demand.road is not None
    road = demand.road
    knots = np.union1d(demand.drive.knots, demand.brake.knots)
    torques = np.concatenate([demand.drive.at(knots), demand.brake.at(knots)], axis=1)
    buffer = np.zeros(ROWS)
    buffer[CAR:] = car

    def rate(t: float, y: Array) -> Array:
        return _rate(
            ONE_CAR, t, y, buffer, knots, torques, road.coefficients, road.start, road.spacing
        )

    return rate
