import numpy as np
from numpy.testing import assert_allclose
from ridetune.engine.uncertainty import smoothed_autocovariance, uncertainty
from scipy.linalg import toeplitz
from scipy.stats import t as student_t

SCALE = np.ones(3)


def slow_regressors(count):
    """Three smooth columns, as a car's motions are against its parameters."""
    time = np.linspace(0.0, 20.0, count)
    return np.column_stack([np.ones(count), np.sin(1.3 * time), np.cos(2.1 * time)])


def solution(jacobian, noise):
    """Errors and residuals of the linear least-squares solution, whose true parameters are 0."""
    estimate = np.linalg.lstsq(jacobian, noise, rcond=None)[0]
    return estimate, jacobian @ estimate - noise


def first_order(rng, count, memory):
    """Stationary noise x_k = memory x_(k-1) + white, variance 1."""
    white = rng.normal(size=count) * np.sqrt(1.0 - memory**2)
    noise = np.empty(count)
    noise[0] = rng.normal()
    for k in range(1, count):
        noise[k] = memory * noise[k - 1] + white[k]
    return noise


def test_white_residuals_give_the_textbook_errors():
    """Oracle: s^2 (J^T J)^-1 and Student's quantile. The one lag kept besides carries a sample
    correlation of order 1/sqrt(N) = 1.6 %, and slow columns count it twice: 4 sigma of 1.6 %."""
    rng = np.random.default_rng(3)
    jacobian = slow_regressors(4000)
    _, residuals = solution(jacobian, 0.7 * rng.normal(size=4000))
    found = uncertainty([(residuals, jacobian)], SCALE)
    variance = residuals @ residuals / (4000 - 3)
    covariance = variance * np.linalg.inv(jacobian.T @ jacobian)
    expected = np.sqrt(np.diag(covariance))
    assert_allclose(found.std_error, expected, rtol=0.064)
    assert_allclose(found.half_width, student_t.ppf(0.975, 3997) * found.std_error, rtol=1e-3)
    assert_allclose(found.correlation, covariance / np.outer(expected, expected), atol=0.064)


def test_a_channel_with_misjudged_noise_does_not_spoil_the_errors():
    """Oracle: the sandwich formula with each channel's own variance. The second channel's noise
    is 5 times what was assumed."""
    rng = np.random.default_rng(4)
    jacobian = slow_regressors(8000)
    deviation = np.repeat([1.0, 5.0], 4000)
    _, residuals = solution(jacobian, deviation * rng.normal(size=8000))
    halves = [(residuals[part], jacobian[part]) for part in (slice(4000), slice(4000, None))]
    found = uncertainty(halves, SCALE)
    bread = np.linalg.inv(jacobian.T @ jacobian)
    covariance = bread @ (jacobian.T * deviation**2) @ jacobian @ bread
    assert_allclose(found.std_error, np.sqrt(np.diag(covariance)), rtol=0.064)


def test_slow_misfit_gives_errors_that_hold():
    """Oracle: the scatter of the estimates over 200 realisations of noise with a correlation time
    of 20 samples. The textbook formula, blind to it, is 6 times too small. The scatter is known
    to 1 / sqrt(400) = 5 %, a windowed estimate is low by some 10 to 20 %."""
    rng = np.random.default_rng(5)
    jacobian = slow_regressors(2000)
    estimates, errors = [], []
    for _ in range(200):
        estimate, residuals = solution(jacobian, first_order(rng, 2000, 0.95))
        estimates.append(estimate)
        errors.append(uncertainty([(residuals, jacobian)], SCALE).std_error)
    ratio = np.mean(errors, axis=0) / np.std(estimates, axis=0)
    assert np.all((ratio > 0.7) & (ratio < 1.2)), ratio


def test_autocovariances_enter_as_their_toeplitz_matrix():
    """Oracle: B J^T G J B with the matrix G written out."""
    rng = np.random.default_rng(6)
    jacobian = slow_regressors(300)
    _, residuals = solution(jacobian, first_order(rng, 300, 0.8))
    lags = smoothed_autocovariance(residuals)
    ratio = lags / lags[0]
    effective = 300 / (2.0 * np.sum(ratio**2) - 1.0)
    matrix = toeplitz(np.concatenate([lags, np.zeros(300 - len(lags))]))
    bread = np.linalg.inv(jacobian.T @ jacobian)
    covariance = bread @ jacobian.T @ matrix @ jacobian @ bread * effective / (effective - 3)
    found = uncertainty([(residuals, jacobian)], SCALE)
    assert_allclose(found.std_error, np.sqrt(np.diag(covariance)), rtol=1e-9)


def test_a_direction_without_effect_is_infinite_and_leaves_the_rest_alone():
    """Oracle: the first two columns are the same up to scale, so only their sum is known; the
    third parameter's error is that of a fit without the second."""
    rng = np.random.default_rng(7)
    known = slow_regressors(2000)[:, [0, 2]]
    _, residuals = solution(known, rng.normal(size=2000))
    jacobian = np.column_stack([known[:, 0], 3.0 * known[:, 0], known[:, 1]])
    found = uncertainty([(residuals, jacobian)], np.array([1.0, 0.2, 1.0]))
    assert np.all(np.isinf(found.std_error[:2]))
    assert np.all(np.isinf(found.half_width[:2]))
    alone = uncertainty([(residuals, known)], np.ones(2))
    assert_allclose(found.std_error[2], alone.std_error[1], rtol=2e-3)
    assert np.isnan(found.correlation[0, 2])
    assert_allclose(np.diag(found.correlation), 1.0)


def test_a_parameter_without_effect_is_infinite():
    rng = np.random.default_rng(8)
    jacobian = slow_regressors(2000)
    jacobian[:, 1] = 0.0
    _, residuals = solution(jacobian, rng.normal(size=2000))
    found = uncertainty([(residuals, jacobian)], SCALE)
    assert list(np.isinf(found.std_error)) == [False, True, False]
    assert np.isinf(found.alone[1])


def test_an_effect_far_below_the_noise_is_none():
    """Oracle: the standard error of a column of length 1e-4 is 1e4 times its scale. Rounding
    alone gives such columns, and residuals of the same size would make them look well known."""
    faint = 1e-4 * slow_regressors(100) / np.sqrt(100)
    found = uncertainty([(faint[:, 0], faint)], SCALE)
    assert np.all(np.isinf(found.half_width))
    assert np.all(np.isnan(found.correlation[~np.eye(3, dtype=bool)]))


def test_a_perfect_fit_has_no_error():
    jacobian = slow_regressors(100)
    found = uncertainty([(np.zeros(100), jacobian)], SCALE)
    assert_allclose(found.std_error, 0.0, atol=0.0)


def test_a_parameter_that_moves_the_runs_by_rounding_alone_is_not_excited():
    """Oracle: in exact arithmetic the third column is zero, and the runs say nothing of it."""
    jacobian = slow_regressors(500)
    jacobian[:, 2] *= 1e-13
    found = uncertainty([(np.zeros(500), jacobian)], SCALE)
    assert np.isinf(found.alone[2])
    assert_allclose(found.alone[:2], 0.0)
