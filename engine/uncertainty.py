"""How well a least-squares fit knows its parameters.

Residuals r (in units of the assumed noise) come in blocks, one a run and channel; J is their
derivative at the solution x. With B = (J^T J)^-1 the parameters' covariance is

    C = B M B,    M = sum over blocks of J_b^T G_b J_b,

where G_b is the autocovariance matrix of the block's residuals: white residuals of variance s^2
give M = s^2 J_b^T J_b and, with one s for all blocks, the textbook s^2 (J^T J)^-1. Estimating G_b
block by block keeps the errors honest when a channel's noise was stated wrong and when residuals
are not noise at all but a slow misfit of the model, which the textbook formula takes for thousands
of independent samples.

G_b is Toeplitz, from the sample autocovariances g_k with Bartlett weights 1 - k/m
(Newey & West, Econometrica 55, 1987); the bandwidth m follows the lag-one correlation p of the
block (Andrews, Econometrica 59, 1991):

    m = 1.1447 (a N)^(1/3),    a = 4 p^2 / ((1 - p)^2 (1 + p)^2),

so that white residuals keep one or two lags and slow ones whole seconds. Residuals so correlated
count for fewer samples, N_b = N / sum w_k^2 (g_k/g_0)^2 over all lags of both signs, and C is
multiplied by N_eff / (N_eff - n): for white residuals chi-square over its degrees of freedom.

Directions which the runs do not move at all are found in the singular value decomposition of J with
columns scaled by the parameters' scales: s_i <= DIRECTION_TOLERANCE s_max, or s_i <=
LEAST_EFFECT. A parameter with a part in such a direction has an infinite standard error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.stats import t as student_t

from .condensed import triangle

Array = NDArray[np.float64]

DIRECTION_TOLERANCE = 1e-7
"""Relative singular value below which a direction is undetermined; above the error, about 1e-9,
of the differences that make J."""

LEAST_EFFECT = 1e-3
"""Change of |r| by a change of all of its scale, from which a direction has any effect on the runs:
a thousandth of one sample's noise, over the whole campaign."""

PART_OF_DIRECTION = 1e-3
"""Component of a unit direction from which a parameter counts as part of it."""

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Errors of n parameters.

    std_error : (n,) infinite where undetermined
    half_width : (n,) of the 95 % interval
    alone : (n,) the half-width were all other parameters known
    correlation : (n, n) not a number in rows and columns of undetermined parameters, diagonal 1
    """

    std_error: Array
    half_width: Array
    alone: Array
    correlation: Array


def uncertainty(blocks: Sequence[tuple[Array, Array]], scale: Array) -> Uncertainty:
    """Standard errors, intervals and correlations at a least-squares solution.

    blocks : per run and channel the residuals (samples,) and their Jacobian (samples, n)
    scale : (n,) typical size of each parameter
    """
    n = len(scale)
    jacobian = np.concatenate([block_jacobian for _, block_jacobian in blocks]) * scale
    _, singular, directions = np.linalg.svd(triangle(jacobian))
    least = max(DIRECTION_TOLERANCE * singular[0], LEAST_EFFECT)
    known = singular > least
    undetermined = np.any(np.abs(directions[~known]) > PART_OF_DIRECTION, axis=0)
    inverse_root = directions[known].T / singular[known]
    bread = inverse_root @ inverse_root.T

    meat = np.zeros((n, n))
    effective_samples = 0.0
    for residuals, block_jacobian in blocks:
        autocovariance = smoothed_autocovariance(residuals)
        meat += _toeplitz_product(block_jacobian * scale, autocovariance)
        effective_samples += _effective_samples(autocovariance, len(residuals))
    freedom = max(effective_samples - n, 1.0)
    covariance = bread @ meat @ bread * (effective_samples / freedom)

    std_error = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(std_error, std_error)
    correlation[undetermined, :] = correlation[:, undetermined] = np.nan
    np.fill_diagonal(correlation, 1.0)
    std_error = np.where(undetermined, np.inf, std_error * scale)
    quantile = float(student_t.ppf(0.5 + CONFIDENCE / 2.0, freedom))
    effect = np.linalg.norm(jacobian, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        alone = np.where(effect > least, scale * np.sqrt(np.diag(meat)) / effect**2, np.inf)
    return Uncertainty(std_error, quantile * std_error, quantile * alone, correlation)


def smoothed_autocovariance(residuals: Array) -> Array:
    """w_k g_k for lags k = 0, 1, ... as long as the Bartlett weight w_k is positive.

    The mean is not removed: a constant misfit is an error like any other.
    """
    count = len(residuals)
    length = _fast_length(2 * count)
    power = np.abs(np.fft.rfft(residuals, length)) ** 2
    autocovariance = np.fft.irfft(power, length)[:count] / count
    if autocovariance[0] == 0.0:
        return autocovariance[:1]
    p = float(np.clip(autocovariance[1] / autocovariance[0], -0.9999, 0.9999))
    a = 4.0 * p**2 / ((1.0 - p) ** 2 * (1.0 + p) ** 2)
    bandwidth = float(np.clip(1.1447 * (a * count) ** (1.0 / 3.0), 1.0, count / 4.0))
    lags = np.arange(int(np.ceil(bandwidth)))
    return (1.0 - lags / bandwidth) * autocovariance[lags]


def _toeplitz_product(jacobian: Array, autocovariance: Array) -> Array:
    """J^T G J for the Toeplitz matrix G of the autocovariances, through the Fourier transform."""
    length = _fast_length(len(jacobian) + len(autocovariance))
    spectrum = 2.0 * np.fft.rfft(autocovariance, length).real - autocovariance[0]
    transformed = np.fft.rfft(jacobian, length, axis=0)
    weights = np.full(len(spectrum), 2.0)
    weights[0] = 1.0
    if length % 2 == 0:
        weights[-1] = 1.0
    weighted = (weights * spectrum)[:, np.newaxis] * transformed
    return (transformed.conj().T @ weighted).real / length


def _fast_length(least: int) -> int:
    """A length of at least so much whose Fourier transform is quick."""
    return int(next_fast_len(least, real=True) or 0)


def _effective_samples(autocovariance: Array, count: int) -> float:
    if autocovariance[0] == 0.0:
        return float(count)
    ratio = autocovariance / autocovariance[0]
    return count / (2.0 * float(np.sum(ratio**2)) - 1.0)
