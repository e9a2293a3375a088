"""Losses: how much a residual counts, by scipy's names.

The cost of residuals r, in units of the noise, is half the sum of C^2 rho(r^2 / C^2), C the scale:

    linear   rho(z) = z                   soft_l1  rho(z) = 2 (sqrt(1 + z) - 1)
    huber    z up to 1, 2 sqrt(z) - 1 on  cauchy   rho(z) = ln(1 + z)
    arctan   rho(z) = arctan(z)

A residual well within the scale counts as in least squares, one far beyond grows with its
magnitude, its logarithm, or no more.

Least squares on reweighted residuals has this cost's gradient and, positive, its second derivative
(Triggs et al., Bundle adjustment, 1999, as in scipy):

    J' = sqrt(w) J,    r' = psi / sqrt(w),    psi = rho' r,    w = rho' + 2 rho'' r^2 / C^2 > eps.

`psi` and `w` are also what the errors of such an estimate follow from (Huber, Robust Statistics,
1981, 7.6): J with the scores psi in place of residuals, w by its mean over the channel.
"""

from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from ..errors import ProblemError
from .search_settings import DEFAULT_SCALE, LARGEST_SCALE, SMALLEST_SCALE, LossName

Array = NDArray[np.float64]

EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, slots=True)
class Loss:
    """A loss and the residual, in units of the noise, from which on it bends."""

    name: LossName = "linear"
    scale: float = DEFAULT_SCALE

    def __post_init__(self) -> None:
        """Refuse what is no loss."""
        if self.name not in get_args(LossName):
            raise ProblemError(f'loss is "{self.name}"; it can be {", ".join(get_args(LossName))}.')
        if not SMALLEST_SCALE <= self.scale <= LARGEST_SCALE:
            raise ProblemError(
                f"loss_scale is {self.scale}; give {SMALLEST_SCALE:g} to {LARGEST_SCALE:g} noises."
            )

    def costs(self, r: Array) -> Array:
        """Half of C^2 rho over the last axis's samples, summed; r (..., samples)."""
        rho = _rho(self.name, (r / self.scale) ** 2)[0]
        return 0.5 * self.scale**2 * np.sum(rho, axis=-1)

    def scores(self, r: Array) -> tuple[Array, Array]:
        """psi and w, each (samples,); w is not yet kept above zero."""
        z = (r / self.scale) ** 2
        _, first, second = _rho(self.name, z)
        return first * r, first + 2.0 * second * z

    def reweighted(self, r: Array) -> tuple[Array, Array]:
        """r' and the factors sqrt(w) of the rows of J, each (samples,)."""
        psi, w = self.scores(r)
        root = np.sqrt(np.maximum(w, EPSILON))
        return psi / root, root


def _rho(name: LossName, z: Array) -> tuple[Array, Array, Array]:
    """rho(z) and its first two derivatives."""
    match name:
        case "linear":
            return z, np.ones_like(z), np.zeros_like(z)
        case "soft_l1":
            root = np.sqrt(1.0 + z)
            return 2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3
        case "huber":
            within, root = z <= 1.0, np.sqrt(np.maximum(z, 1.0))
            return (
                np.where(within, z, 2.0 * root - 1.0),
                np.where(within, 1.0, 1.0 / root),
                np.where(within, 0.0, -0.5 / root**3),
            )
        case "cauchy":
            return np.log1p(z), 1.0 / (1.0 + z), -1.0 / (1.0 + z) ** 2
        case "arctan":
            return np.arctan(z), 1.0 / (1.0 + z**2), -2.0 * z / (1.0 + z**2) ** 2
