"""Whether the runs agree with what was known before them.

The cost at its minimum is a parabola; without the prior of parameter k, of residual q and slope w
in the optimiser's variable x, its minimum lies at

    x_k + (q / w) b / (1 - b),    b = w^2 (H^-1)_kk,

H the second derivative with all priors: b is the prior's share of what is known of x_k. That value
has the error that runs and other priors leave it, and the prior has 1 / w; the two are independent.
"""

from collections.abc import Sequence

import numpy as np

from .fit import PriorCheck
from .residuals import Residuals
from .search import Found
from .uncertainty import Information, uncertainty
from .units import after_number
from .variables import Variable

DISAGREE = 3.0
"""Combined standard errors beyond which the runs and a prior disagree."""

ALL_OF_IT = 0.999
"""Share of a prior from which on the runs say nothing."""


def prior_checks(residuals: Residuals, found: Found, said: Information) -> tuple[PriorCheck, ...]:
    """Every prior against the runs.

    said : by the runs
    """
    problem = residuals.problem
    inverse = np.linalg.pinv(found.curvature, hermitian=True)
    rows, weights = residuals.prior_rows(found.x), residuals.prior_slopes()
    told = residuals.of_priors()
    checks = []
    for row, prior in enumerate(problem.priors):
        k = int(np.flatnonzero(weights[row])[0])
        one, weight = problem.free[k], float(weights[row, k])
        share = weight**2 * float(inverse[k, k])
        others = uncertainty(sum((*told[:row], *told[row + 1 :]), start=said))
        error = float(others.std_error[k])
        if share > ALL_OF_IT or not np.isfinite(error):
            checks.append(PriorCheck(prior.name, prior.mean, prior.deviation, None, None, None))
            continue
        away = float(rows[row]) / weight / (1.0 - share)
        x = one.variable(prior.mean) + away
        checks.append(
            PriorCheck(
                name=prior.name,
                mean=prior.mean,
                deviation=prior.deviation,
                without=one.value(x),
                without_std_error=error * abs(one.slope(x)),
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
