"""Wheels that are recorded far too small, as by a mistaken unit.

Below SLOW a car follows the plane through its wheel centres. On a flat road it also rises, dives
and rolls on its springs, and the wheels with it on the tyres: by as much more as a tyre is stiffer
than a spring, 20 times at the most. A body that goes with its wheels and moves 100 times as much,
which is midway between that and the 1000 of mm for m, has them in a wrong unit.
"""

import numpy as np

from ..channels import OUTPUT_CHANNELS, WHEEL_CHANNELS
from ..filters import low_pass, too_coarse
from ..run import Run
from ..units import listed

SLOW = 1.0
"""Hz"""

TOGETHER = 0.6
"""Correlation from which body and wheels go together; noise of idle wheels tells nothing."""

TOO_SMALL = 100.0
"""Body over wheel motion, slow and altogether, that no car has."""

IDLE = 1e-7
"""Standard deviation of wheels that never move, m."""

PERIODS = 4.0
"""Periods at SLOW that a record must last for a correlation to tell anything."""


def wheels_too_small(run: Run) -> list[str]:
    """A sentence where all of the body that goes with the wheels moves too much for them.

    An angle counts as metres at 1 m, about half a wheelbase or a track.
    """
    step = float(np.mean(np.diff(run.time)))
    if too_coarse(step, SLOW) or run.duration < PERIODS / SLOW:
        return []
    fl, fr, rl, rr = (run[name] for name in WHEEL_CHANNELS)
    planes = (fl + fr + rl + rr, rl + rr - fl - fr, fl + rl - fr - rr)
    small, ratios = [], []
    for name, plane in zip(OUTPUT_CHANNELS, planes, strict=True):
        if name not in run or not np.all(np.isfinite(run[name])):
            continue
        both = np.column_stack([run[name], plane / 4.0])
        slow = low_pass(run.time, both, SLOW)
        slow = slow - slow.mean(axis=0)
        body, wheels = np.std(slow, axis=0)
        if wheels <= IDLE or np.mean(slow[:, 0] * slow[:, 1]) < TOGETHER * body * wheels:
            continue
        ratio = float(min(body / wheels, np.divide(*np.std(both, axis=0))))
        if ratio < TOO_SMALL:
            return []
        small.append(name)
        ratios.append(ratio)
    if not small:
        return []
    return [
        f"In run {run.name} {listed(small)} go with the wheels and move"
        f" {min(ratios):.3g} times as much; the unit of the wheel.*.z is probably wrong, such as mm"
        " for numbers in m: correct it."
    ]
