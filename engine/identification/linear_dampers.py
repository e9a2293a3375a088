"""What of a fit hangs on the dampers being linear, as the vehicle has them.

Dampers with more force in rebound than in jounce pull the body down on a rough road; a fit to
linear ones takes that for the doing of what else moves the body so, such as the pivots.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..frames import AXLES
from ..parameters import RATIO_BOUNDS
from .residuals import Residuals
from .search import RELEASED, Found, gauss_newton
from .variables import FreeParameter

Array = NDArray[np.float64]

LINEAR = 1.0
"""Rebound ratio of a linear damper."""


def freed_ratios(residuals: Residuals, found: Found, held: NDArray[np.bool_]) -> dict[str, Array]:
    """How far the parameters' variables (n,) would go by the Gauss-Newton step, were the rebound
    ratio of one axle's linear damper free, too; by its path. That goes RELEASED far at most.

    held : what is at a bound, of all that the fit looked for, and stays there
    """
    problem, of_car = residuals.problem, len(residuals.problem.free)
    names = [f"{axle}.suspension.rebound_ratio" for axle in AXLES]
    free = {one.name for one in problem.free}
    kept = [
        name
        for axle, name in zip(AXLES, names, strict=True)
        if name not in free and problem.vehicle.axle(axle).suspension.linear
    ]
    if not kept:
        return {}
    ratios = tuple(FreeParameter(name, LINEAR, *RATIO_BOUNDS) for name in kept)
    wider = residuals.of(replace(problem, free=(*problem.free, *ratios)))
    x = np.insert(found.x, of_car, [one.variable(LINEAR) for one in ratios])
    rows, root = wider.reweighted(x, found.residuals)
    jacobian = wider.reweighted_slopes(wider.jacobian(x), root)
    moved = np.insert(~held, of_car, [False] * len(kept))
    steps = {}
    for place, name in enumerate(kept, start=of_car):
        step = gauss_newton(jacobian, rows, moved | (np.arange(len(x)) == place))
        steps[name] = step[:of_car] * RELEASED / max(abs(step[place]), RELEASED)
    return steps
