"""Wheel channels in each other's columns, found from the recording alone.

On a road the rear wheels pass over what the front wheels passed over, a wheelbase later. With s the
distance travelled and u(s) a wheel centre's height, u_rl(s + L) is close to u_fl(s) and u_rr(s + L)
to u_fr(s); across the car and the other way round the likeness is far smaller. Of all ways to hand
the four columns to the four wheels the right one therefore stands out, whatever the car's springs
and dampers. A car mirrored left and right passes the same test: the sign of roll tells the two
apart.

Heights are averaged over CELL, which takes off the sensors' noise, and compared by their rise over
RISE, which keeps what left and right tracks do not share and hills do not hide.
"""

import operator
from collections.abc import Iterable
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from ..channels import WHEEL_CHANNELS
from ..run import Run

Array = NDArray[np.float64]
Order = tuple[int, ...]
"""Which column holds each wheel's height, wheels in the order of the corners."""

CELL, RISE = 0.25, 0.5
"""m"""

SHORTEST = 50.0
"""Distance driven, m, below which two tracks can be alike by chance."""

ALIKE = 0.7
"""Correlation a wheelbase apart from which an order is believed."""

FAR_LESS = 0.85
"""The order as given is doubted when its correlation is below this share of the best one's."""

TIE, ROLL_TIE = 0.05, 0.3
"""Orders whose correlations differ by less are told apart by roll, and where those of roll differ
by less, by how many columns they move."""

NEAR = 0.2
"""Share of the wheelbase by which speed or wheelbase may be off: the order as given must not be
alike within it either. On a sine road every distance is alike somewhere."""

AS_GIVEN: Order = (0, 1, 2, 3)


def wheel_rises(run: Run) -> Array | None:
    """Rise of each wheel over RISE, (4, cells), at equal distances along the road.

    None without chassis.v_x: a_x integrated makes a rig drive. What is driven backwards is not
    looked at.
    """
    if "chassis.v_x" not in run:
        return None
    distance = cumulative_trapezoid(run["chassis.v_x"], run.time, initial=0.0)
    furthest = np.maximum.accumulate(distance)
    forward = np.flatnonzero(np.diff(furthest, prepend=-np.inf) > 0.0)
    travelled = furthest[forward]
    edges = np.arange(travelled[0], travelled[-1], CELL)
    areas = (
        cumulative_trapezoid(run[name][forward], travelled, initial=0.0) for name in WHEEL_CHANNELS
    )
    heights = np.array([np.diff(np.interp(edges, travelled, area)) / CELL for area in areas])
    cells = round(RISE / CELL)
    return heights[:, cells:] - heights[:, :-cells]


def exchanged_wheels(run: Run, rises: Array, wheelbase: float) -> list[str]:
    """A sentence where the wheels' columns are probably exchanged.

    rises : of `wheel_rises`
    wheelbase : m
    """
    behind = round(wheelbase / CELL)
    furthest = round(NEAR * wheelbase / CELL)
    if rises.shape[1] < behind + furthest + SHORTEST / CELL or np.any(np.ptp(rises, axis=1) == 0.0):
        return []
    likeness = _likeness(rises, behind, permutations(AS_GIVEN))
    best = max(likeness.values())
    if best < ALIKE or likeness[AS_GIVEN] > FAR_LESS * best:
        return []
    lags = range(behind - furthest, behind + furthest + 1)
    if max(_likeness(rises, lag, [AS_GIVEN])[AS_GIVEN] for lag in lags) > FAR_LESS * best:
        return []
    order = _likeliest(run, [one for one, value in likeness.items() if value > best - TIE])
    read = [
        f"{WHEEL_CHANNELS[wheel]} in column {WHEEL_CHANNELS[column]}"
        for wheel, column in enumerate(order)
        if column != wheel
    ]
    return [
        f"In run {run.name} the rear wheels do not pass over what the front wheels did a wheelbase "
        f"before; they would (correlation {likeness[order]:.2f} instead of "
        f"{likeness[AS_GIVEN]:.2f}) with {', '.join(read)}: check which column is which wheel."
    ]


def _likeness(rises: Array, lag: int, orders: Iterable[Order]) -> dict[Order, float]:
    """By order, the mean correlation of the sides' front rises with the rear ones `lag` later."""
    follows = np.corrcoef(rises[:, :-lag], rises[:, lag:])[:4, 4:]
    return {
        order: 0.5 * float(follows[order[0], order[2]] + follows[order[1], order[3]])
        for order in orders
    }


def _likeliest(run: Run, orders: list[Order]) -> Order:
    """Of orders that follow equally well those whose wheels roll as the chassis does, if roll tells
    at all; of these the one that moves the fewest columns.
    """
    rolls = {order: _rolls_along(run, order) for order in orders}
    best = max(rolls.values())
    return min(
        (order for order in orders if rolls[order] > best - ROLL_TIE),
        key=lambda order: sum(map(operator.ne, order, AS_GIVEN)),
    )


def _rolls_along(run: Run, order: Order) -> float:
    """Correlation of the chassis's roll with that of its wheels; 0 without either."""
    fl, fr, rl, rr = (run[WHEEL_CHANNELS[column]] for column in order)
    wheels = fl - fr + rl - rr
    if "chassis.roll" not in run or np.ptp(wheels) == 0.0 or np.ptp(run["chassis.roll"]) == 0.0:
        return 0.0
    return float(np.corrcoef(wheels, run["chassis.roll"])[0, 1])
