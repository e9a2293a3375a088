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

from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from .channels import WHEEL_CHANNELS, Run

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

TIE = 0.05
"""Orders whose correlations differ by less are told apart by roll."""

AS_GIVEN: Order = (0, 1, 2, 3)


def exchanged_wheels(run: Run, distance: Array, wheelbase: float) -> list[str]:
    """A sentence where the wheels' columns are probably exchanged.

    distance : (samples,) travelled, m; what is driven backwards is not looked at
    wheelbase : m
    """
    rises = _rises(run, distance)
    behind = round(wheelbase / CELL)
    if rises.shape[1] < behind + SHORTEST / CELL or np.any(np.ptp(rises, axis=1) == 0.0):
        return []
    follows = np.corrcoef(rises[:, :-behind], rises[:, behind:])[:4, 4:]
    likeness = {
        order: 0.5 * float(follows[order[0], order[2]] + follows[order[1], order[3]])
        for order in permutations(AS_GIVEN)
    }
    best = max(likeness.values())
    if best < ALIKE or likeness[AS_GIVEN] > FAR_LESS * best:
        return []
    order = _by_roll(run, [one for one, value in likeness.items() if value > best - TIE])
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


def _rises(run: Run, distance: Array) -> Array:
    """Rise of each wheel over RISE, (4, cells), at equal distances along the road."""
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


def _by_roll(run: Run, orders: list[Order]) -> Order:
    """Of orders equally likely the one whose wheels roll as the chassis does, or the first."""
    if "chassis.roll" not in run:
        return orders[0]
    rolled = run["chassis.roll"] - np.mean(run["chassis.roll"])

    def along(order: Order) -> float:
        fl, fr, rl, rr = (run[WHEEL_CHANNELS[column]] for column in order)
        return float((fl - fr + rl - rr) @ rolled)

    return max(orders, key=along)
