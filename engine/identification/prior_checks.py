"""Whether the runs agree with what was known before them.

The cost has the gradient g at the solution x in the optimiser's variables, 0 but at a bound.
Without the prior of parameter k, of residual q and slope w, it is g - w q e_k, and by the second
derivative H from runs and other priors the minimum would be, bounds aside,

    x - H^-1 (g - w q e_k).

x_k there has the error that runs and other priors leave it, by the residuals there (those at the
minimum hold the very disagreement), and the prior has 1 / w; the two are independent.
"""

from collections.abc import Sequence

import numpy as np

from ..units import after_number
from .fit import PriorCheck
from .residuals import Residuals
from .search import Found
from .uncertainty import DIRECTION_TOLERANCE, Information, information, uncertainty
from .variables import Variable

DISAGREE = 3.0
"""Combined standard errors beyond which the runs and a prior disagree."""


def prior_checks(residuals: Residuals, found: Found, said: Information) -> tuple[PriorCheck, ...]:
    """Every prior against the runs.

    said : by the runs
    """
    problem = residuals.problem
    rows, weights = residuals.prior_rows(found.x), residuals.prior_slopes()
    told = residuals.of_priors()
    gradient = found.jacobian.T @ found.rows
    checks = []
    for row, prior in enumerate(problem.priors):
        k = int(np.flatnonzero(weights[row])[0])
        one, weight, q = problem.free[k], float(weights[row, k]), float(rows[row])
        others = (*told[:row], *told[row + 1 :])
        inverse = np.linalg.pinv(sum(others, start=said).root, rcond=DIRECTION_TOLERANCE)
        without = gradient.copy()
        without[k] -= weight * q
        step = -inverse @ (inverse.T @ without)
        there = information(residuals.of_runs(found.residuals + found.slopes @ step, found.slopes))
        error = float(uncertainty(sum(others, start=there)).std_error[k])
        if not np.isfinite(error):
            checks.append(PriorCheck(prior.name, prior.mean, prior.deviation, None, None, None))
            continue
        x = float(found.x[k] + step[k])
        value, _ = one.interval(x, 0.0, 0.0)
        away = x - one.variable(prior.mean)
        checks.append(
            PriorCheck(
                name=prior.name,
                mean=prior.mean,
                deviation=prior.deviation,
                without=value,
                without_std_error=error * (abs(value) if one.logarithmic else one.scale),
                apart=away / float(np.hypot(error, 1.0 / weight)),
            )
        )
    return tuple(checks)


def disagreements(checks: Sequence[PriorCheck], known: Sequence[Variable]) -> list[str]:
    """Sentences on priors that the runs contradict."""
    units = {one.name: after_number(one.unit) for one in known}
    return [
        f"The runs alone put {one.name} at {one.without:.4g} ± {one.without_std_error:.2g}"
        f"{units[one.name]}, {abs(one.apart):.1f} standard errors from its prior, {one.mean:.4g} ± "
        f"{one.deviation:.2g}{units[one.name]}; check the drawing and the runs, or leave the prior "
        "out."
        for one in checks
        if one.apart is not None and abs(one.apart) > DISAGREE
    ]
