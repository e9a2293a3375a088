"""How well a least-squares fit knows its parameters.

Residuals r (in units of the assumed noise) come run by run, channel by channel; J is their
derivative at the solution by the search's variables x. With B = (J^T J)^-1 their covariance is

    C = B M B,    M = sum over runs and pairs of channels a, b of J_a^T G_ab J_b,

where G_ab is the (cross-)covariance matrix of two channels' residuals: white residuals of variance
s^2 give M = s^2 J^T J and with it the textbook's s^2 (J^T J)^-1. Estimating G from the residuals
keeps the errors honest when a channel's noise was stated wrong, when the residuals are a slow
misfit of the model, which the textbook takes for thousands of independent samples, and when they
stem from noise in what drives the model: that of a wheel or of a_x goes through the car and comes
out in z, pitch and roll at once, as slow as the body moves.

G_ab is Toeplitz, from the sample covariances g_ab(k) at lag k with Bartlett weights 1 - |k|/m
(Newey & West, Econometrica 55, 1987). The bandwidth m of a run is the longest of its channels' by
their lag-one correlation p (Andrews, Econometrica 59, 1991),

    m = 1.1447 (a N)^(1/3),    a = 4 p^2 / ((1 - p)^2 (1 + p)^2),

and at least BODY_MEMORY: noise of the inputs is hidden from p by the white noise of the outputs,
which is larger but has little power where the body moves. m is at most a quarter of the run.

What a fit has taken out of the residuals lies where J has its power. From white noise of variance
s^2 it leaves, with the hat matrix H = J B J^T,

    E g_aa(k) = s^2 (delta_k - tr_k(H_aa) / N),    tr_k the sum along the k-th diagonal,

so the spectrum of g_aa is divided by that of the bracket, that of g_ab by the root of both
channels'. Summed over all frequencies this is the textbook's N - n in place of N.

Intervals take Student's t. A run's part of M has f_r = 3 N/m degrees of freedom (Bartlett's
window; Priestley, Spectral Analysis and Time Series, 1981, table 6.2), a prior's, which is known,
infinitely many. The variance v = sum v_r of a variable has

    f = v^2 / sum (v_r^2 / f_r)

of them (Satterthwaite, Biometrics Bulletin 2, 1946), so that a run counts as far as the error is
its; the quantile is that of the variables' harmonic mean. Where those of the residuals are fewer,
it is theirs: correlated ones count for N / sum w_k^2 (g_k/g_0)^2 samples, over lags of both signs.

Directions which the runs do not move at all are found in the singular value decomposition of J:
s_i <= DIRECTION_TOLERANCE s_max, or s_i <= LEAST_EFFECT. A parameter with a part in such a
direction has an infinite standard error.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.stats import t as student_t

from .condensed import triangle

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

DIRECTION_TOLERANCE = 1e-7
"""Relative singular value below which a direction is undetermined; above the error, about 1e-9,
of the differences that make J."""

LEAST_EFFECT = 1e-3
"""Change of |r| by a step of 1 in x, from which a direction has any effect on the runs: a
thousandth of one sample's noise, over the whole campaign."""

PART_OF_DIRECTION = 1e-3
"""Component of a unit direction from which a parameter counts as part of it."""

NAMED = 0.2
"""Component of a unit direction from which a parameter is named with it."""

BODY_MEMORY = 1.0
"""Lags over which residuals may always be correlated, s: a period of the body on its springs."""

LEAST_LEFT = 0.1
"""Share of a spectrum that a fit leaves at least: below, too little is left to extrapolate from."""

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class RunResiduals:
    """One run's residuals at the solution.

    residuals : (channels, samples);  jacobian : (channels, samples, n)
    step : mean time between samples, s
    weights : (channels,) mean weight of a sample in a robust loss, whose root both hold
    """

    residuals: Array
    jacobian: Array
    step: float
    weights: Array = field(default_factory=lambda: np.ones(1))


@dataclass(frozen=True, slots=True)
class Information:
    """What runs say of n parameters; that of several runs is the sum.

    root : (n, n) triangle R with R^T R = J^T J
    scatters : (n, n) each, whose sum is M;  freedoms : their degrees of freedom
    samples : effective number of them
    """

    root: Array
    scatters: tuple[Array, ...]
    samples: float
    freedoms: tuple[float, ...]

    @property
    def scatter(self) -> Array:
        """(n, n) M."""
        return sum(self.scatters, start=np.zeros_like(self.root))

    def __add__(self, other: "Information") -> "Information":
        """What both say together."""
        return Information(
            triangle(np.concatenate([self.root, other.root])),
            self.scatters + other.scatters,
            self.samples + other.samples,
            self.freedoms + other.freedoms,
        )

    def marginal(self, kept: Sequence[int]) -> "Information":
        """What they say of some of the variables, whatever the others are.

        The others take the part out of J that they could explain: with N their columns and A the
        kept ones, J^T J becomes the Schur complement A^T (1 - N N^+) A, and M that of the scores
        (A - N N^+ A)^T r, so that covariances stay as they are.
        """
        others = [k for k in range(len(self.root)) if k not in kept]
        if not others:
            return self
        kept = list(kept)
        left, singular, right = np.linalg.svd(self.root[:, others], full_matrices=False)
        held = singular > _least_effect(self.root)
        left, right = left[:, held], right[held]
        beside = self.root[:, kept] - left @ (left.T @ self.root[:, kept])
        # Scores of the kept variables less what the others explain of them.
        taken = (left.T @ self.root[:, kept]).T @ (right / singular[held, np.newaxis])
        score = np.zeros((len(kept), len(self.root)))
        score[range(len(kept)), kept] = 1.0
        score[:, others] = -taken
        scatters = tuple(score @ one @ score.T for one in self.scatters)
        return Information(triangle(beside), scatters, self.samples, self.freedoms)


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Errors of n variables x.

    covariance : (n, n) over the directions which the runs determine
    unknown : (k, n) unit directions which they do not
    quantile : half-widths of 95 % intervals over standard errors
    alone : (n,) the standard errors were all other variables known
    """

    covariance: Array
    unknown: Array
    quantile: float
    alone: Array

    @property
    def std_error(self) -> Array:
        """(n,) infinite where undetermined."""
        return np.array([self.error_of(axis) for axis in np.eye(len(self.covariance))])

    @property
    def half_width(self) -> Array:
        """(n,) of the 95 % intervals."""
        return self.quantile * self.std_error

    @property
    def correlation(self) -> Array:
        """(n, n) not a number in rows and columns of undetermined variables, diagonal 1."""
        errors = self.std_error
        with np.errstate(invalid="ignore", divide="ignore"):
            correlation = self.covariance / np.outer(errors, errors)
        lost = np.isinf(errors)
        correlation[lost, :] = correlation[:, lost] = np.nan
        np.fill_diagonal(correlation, 1.0)
        return correlation

    def marginal(self, first: int) -> "Uncertainty":
        """Errors of the first variables, whatever the others are."""
        # What is left of the unknown directions among the first, and the covariance beside it.
        _, parts, axes = np.linalg.svd(self.unknown[:, :first])
        unknown = axes[: len(parts)][parts > PART_OF_DIRECTION]
        beside = np.eye(first) - unknown.T @ unknown
        covariance = beside @ self.covariance[:first, :first] @ beside
        return Uncertainty(covariance, unknown, self.quantile, self.alone[:first])

    def error_of(self, gradient: Array) -> float:
        """Standard error of a quantity whose derivative by x is `gradient` (n,); infinite where it
        has a part in an unknown direction.
        """
        size = float(np.linalg.norm(gradient))
        if size > 0.0 and np.any(np.abs(self.unknown @ gradient) > PART_OF_DIRECTION * size):
            return np.inf
        return float(np.sqrt(max(gradient @ self.covariance @ gradient, 0.0)))


def information(runs: Iterable[RunResiduals]) -> Information:
    """What some runs say that were fitted together, from their residuals."""
    runs = list(runs)
    n = runs[0].jacobian.shape[2]
    root = triangle(np.concatenate([run.jacobian.reshape(-1, n) for run in runs]))
    bread = bread_of(root)[0]
    widths = [bandwidth(run.residuals, run.step) for run in runs]
    pairs = list(zip(runs, widths, strict=True))
    return Information(
        root,
        tuple(_scatter(run, width, bread) for run, width in pairs),
        sum(effective_samples(channel, width) for run, width in pairs for channel in run.residuals),
        tuple(3.0 * run.residuals.shape[1] / width for run, width in pairs),
    )


def uncertainty(known: Information) -> Uncertainty:
    """Errors at a least-squares solution."""
    bread, unknown, least = bread_of(known.root)
    covariance = bread @ known.scatter @ bread
    effect = np.linalg.norm(known.root, axis=0)
    scattered = np.sqrt(np.maximum(np.diag(known.scatter), 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        alone = np.where(effect > least, scattered / effect**2, np.inf)
    freedom = max(min(known.samples - len(bread), _freedom(known, bread)), 1.0)
    quantile = float(student_t.ppf(0.5 + CONFIDENCE / 2.0, freedom))
    return Uncertainty(covariance, unknown, quantile, alone)


def _freedom(known: Information, bread: Array) -> float:
    """Harmonic mean of the variables' degrees of freedom; infinite where nothing scatters."""
    parts = np.array([np.diag(bread @ one @ bread) for one in known.scatters])
    variances = np.sum(parts, axis=0)
    scattered = variances > 0.0
    if not np.any(scattered):
        return np.inf
    shares = parts[:, scattered] / variances[scattered]
    inverse = np.sum(shares**2 / np.array(known.freedoms)[:, np.newaxis], axis=0)
    return 1.0 / float(np.mean(inverse)) if np.any(inverse > 0.0) else np.inf


def bread_of(root: Array) -> tuple[Array, Array, float]:
    """B over the directions which the runs move, the others (k, n), and their largest effect."""
    _, singular, directions = np.linalg.svd(root)
    least = _least_effect(root)
    held = singular > least
    inverse_root = directions[held].T / singular[held]
    return inverse_root @ inverse_root.T, directions[~held], least


def _least_effect(root: Array) -> float:
    """Effect, |R v| of a unit direction v, from which on one is known."""
    return max(DIRECTION_TOLERANCE * float(np.linalg.norm(root, 2)), LEAST_EFFECT)


def smoothed_covariance(one: Array, other: Array, bandwidth: float) -> Array:
    """w_k g(k) at lags k = 0, 1, ... with g(k) = sum of one_(t+k) other_t / N.

    The mean is not removed: a constant misfit is an error like any other.
    """
    count = len(one)
    length = _fast_length(2 * count)
    cross = np.fft.rfft(one, length) * np.fft.rfft(other, length).conj()
    lags = np.arange(min(int(np.ceil(bandwidth)), count))
    return (1.0 - lags / bandwidth) * np.fft.irfft(cross, length)[lags] / count


def bandwidth(residuals: Array, step: float) -> float:
    """Lags, in samples, over which residuals (channels, samples) are taken to be correlated."""
    count = residuals.shape[1]
    longest = max(BODY_MEMORY / step, *(_andrews(channel) for channel in residuals))
    return float(np.clip(longest, 1.0, max(count / 4.0, 1.0)))


def effective_samples(residuals: Array, width: float) -> float:
    """How many independent samples residuals (samples,) are worth, correlated over `width` lags."""
    smoothed = smoothed_covariance(residuals, residuals, width)
    if smoothed[0] == 0.0:
        return float(len(residuals))
    return len(residuals) / (2.0 * float(np.sum((smoothed / smoothed[0]) ** 2)) - 1.0)


def transform_length(count: int, width: float) -> int:
    """Of Fourier transforms of so many samples, correlated over `width` lags, that do not wrap."""
    return _fast_length(count + int(np.ceil(width)))


def spectra(run: RunResiduals, width: float, bread: Array) -> Complex:
    """Spectra of the noise behind a run's residuals, (channels, channels, frequencies).

    Two-sided and by sample: white noise of variance s^2 has s^2 at every frequency. The
    frequencies are those of the real transform of `transform_length`.
    bread : (n, n) B of the fit that took its part out of the residuals
    """
    channels, count, _ = run.jacobian.shape
    length = transform_length(count, width)
    jacobian = np.fft.rfft(run.jacobian, length, axis=1)
    left = np.sqrt([_left(of_channel, bread, count, width, length) for of_channel in jacobian])
    pairs = [
        [_spectrum(run.residuals[a], run.residuals[b], width, length) for b in range(channels)]
        for a in range(channels)
    ]
    return np.array(pairs) / (left[:, np.newaxis] * left)


def scatter(jacobian: Array, density: Complex, length: int) -> Array:
    """M (n, n) of a run whose noise has some spectra.

    jacobian : (channels, samples, n);  density : of `spectra`, for transforms of `length`
    """
    transformed = np.fft.rfft(jacobian, length, axis=1)
    weights = np.full(transformed.shape[1], 2.0)
    weights[0] = 1.0
    if length % 2 == 0:
        weights[-1] = 1.0
    weighted = np.zeros_like(transformed)
    for a, of_channel in enumerate(density):
        for b, of_pair in enumerate(of_channel):
            weighted[a] += (weights * of_pair)[:, np.newaxis] * transformed[b]
    return _product(transformed, weighted) / length


def _product(one: Complex, other: Complex) -> Array:
    """Real part of one^H other, (n, n), of transforms (channels, frequencies, n).

    By loops: BLAS wakes its threads for complex numbers and waits for them where cores are busy.
    """
    real = np.einsum("cfi,cfj->ij", one.real, other.real)
    return real + np.einsum("cfi,cfj->ij", one.imag, other.imag)


def _scatter(run: RunResiduals, width: float, bread: Array) -> Array:
    """A run's part of M, of all its pairs of channels."""
    length = transform_length(run.residuals.shape[1], width)
    return scatter(run.jacobian, spectra(run, width, bread), length)


def _left(jacobian: Array, bread: Array, count: int, width: float, length: int) -> Array:
    """Share of white noise's spectrum that the fit leaves in a channel.

    jacobian : (frequencies, n) transform of the channel's
    """
    taken = np.sum((jacobian @ bread) * jacobian.conj(), axis=1).real
    lags = np.arange(int(np.ceil(width)))
    diagonals = (1.0 - lags / width) * np.fft.irfft(taken, length)[lags] / count
    share = 2.0 * np.fft.rfft(diagonals, length).real - diagonals[0]
    return np.maximum(1.0 - share, LEAST_LEFT)


def _spectrum(one: Array, other: Array, width: float, length: int) -> Complex:
    """Fourier transform of two channels' smoothed covariance over lags of both signs."""
    ahead = np.fft.rfft(smoothed_covariance(one, other, width), length)
    behind = smoothed_covariance(other, one, width)
    behind[0] = 0.0
    return ahead + np.fft.rfft(behind, length).conj()


def _andrews(residuals: Array) -> float:
    """Bandwidth in samples by the lag-one correlation; 0 where nothing is left."""
    variance = float(residuals @ residuals)
    if variance == 0.0:
        return 0.0
    p = float(np.clip(residuals[1:] @ residuals[:-1] / variance, -0.9999, 0.9999))
    a = 4.0 * p**2 / ((1.0 - p) ** 2 * (1.0 + p) ** 2)
    return 1.1447 * (a * len(residuals)) ** (1.0 / 3.0)


def _fast_length(least: int) -> int:
    """A length of at least so much whose Fourier transform is quick."""
    return int(next_fast_len(least, real=True) or 0)
