import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.filters import low_pass
from ridetune.engine.identification.uncertainty import (
    Information,
    RunResiduals,
    bandwidth,
    information,
    smoothed_covariance,
    uncertainty,
)
from scipy.linalg import toeplitz
from scipy.stats import t as student_t

STEP = 0.005


def errors_of(*runs):
    """Errors from runs of one channel each: residuals (samples,) and Jacobian (samples, n)."""
    return uncertainty(information(one_channel(*run) for run in runs))


def one_channel(residuals, jacobian):
    return RunResiduals(residuals[np.newaxis], jacobian[np.newaxis], STEP)


def regressors(count, columns=3):
    """Columns that move below 3 Hz, as a car's body does against its parameters."""
    rng = np.random.default_rng(1)
    time = STEP * np.arange(count)
    return low_pass(time, rng.normal(size=(count, columns)), 3.0) * np.sqrt(100.0 / 3.0)


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
    """Oracle: s^2 (J^T J)^-1. A variance is estimated from the 60 frequencies below 3 Hz over
    which the columns are spread, hence scattered by sqrt(2 / 60) = 18 %; mean of 100 realisations
    within 4 x 1.8 %, half of that in the error. In 500 samples the fit takes 3 of 7 frequencies
    out of the residuals: 4 x 5 %."""
    rng = np.random.default_rng(3)
    for count, tolerance in ((4000, 0.036), (500, 0.11)):
        jacobian = regressors(count)
        found = []
        for _ in range(100):
            _, residuals = solution(jacobian, 0.7 * rng.normal(size=count))
            found.append(np.diag(errors_of((residuals, jacobian)).covariance))
        expected = 0.49 * np.diag(np.linalg.inv(jacobian.T @ jacobian))
        ratio = np.sqrt(np.mean(found, axis=0) / expected)
        assert_allclose(ratio, 1.0, atol=tolerance)


def test_intervals_take_the_quantile_of_the_windows_they_average():
    """Oracle: Student's t of 3 N / m degrees of freedom, m the samples of one second."""
    jacobian = regressors(4000)
    _, residuals = solution(jacobian, np.random.default_rng(3).normal(size=4000))
    found = errors_of((residuals, jacobian), (residuals, jacobian))
    assert bandwidth(residuals[np.newaxis], STEP) == 200.0
    assert found.quantile == pytest.approx(student_t.ppf(0.975, 2 * 3 * 4000 / 200))
    assert_allclose(found.half_width, found.quantile * found.std_error)


def test_a_run_gives_degrees_of_freedom_as_far_as_the_error_is_its():
    """Oracle: Satterthwaite's formula. 4 s that tell all have 12 beside 40 s that tell nothing;
    variances of which two runs have the shares 1/4 and 3/4 have 1 / (1/16 f_1 + 9/16 f_2); known
    ones, as a prior's, have the normal distribution's quantile."""

    def quantile(*parts):
        scatters, freedoms = zip(*parts, strict=True)
        known = Information(
            np.eye(2), tuple(s * np.eye(2) for s in scatters), 1e9, tuple(map(float, freedoms))
        )
        return uncertainty(known).quantile

    assert quantile((1.0, 12), (0.0, 120)) == pytest.approx(student_t.ppf(0.975, 12))
    both = 1.0 / (1.0 / 16.0 / 12.0 + 9.0 / 16.0 / 120.0)
    assert quantile((0.5, 12), (1.5, 120)) == pytest.approx(student_t.ppf(0.975, both))
    assert quantile((1.0, np.inf)) == pytest.approx(1.959964, rel=1e-5)
    short, silent = regressors(800), np.zeros((8000, 3))
    rng = np.random.default_rng(5)
    alone = one_channel(rng.normal(size=800), short)
    beside = one_channel(rng.normal(size=8000), silent)
    found = [uncertainty(information(runs)).quantile for runs in ([alone], [alone, beside])]
    assert found == pytest.approx([student_t.ppf(0.975, 12)] * 2)


def test_a_channel_with_misjudged_noise_does_not_spoil_the_errors():
    """Oracle: the sandwich formula with each channel's own variance. The second channel's noise
    is 5 times what was assumed. Mean of 40 realisations, scattered by 18 %."""
    rng = np.random.default_rng(4)
    jacobian = regressors(8000)
    deviation = np.repeat([1.0, 5.0], 4000)
    halves = slice(4000), slice(4000, None)
    found = []
    for _ in range(40):
        _, residuals = solution(jacobian, deviation * rng.normal(size=8000))
        found.append(errors_of(*((residuals[one], jacobian[one]) for one in halves)).std_error)
    bread = np.linalg.inv(jacobian.T @ jacobian)
    covariance = bread @ (jacobian.T * deviation**2) @ jacobian @ bread
    ratio = np.mean(found, axis=0) / np.sqrt(np.diag(covariance))
    assert_allclose(ratio, 1.0, atol=4 * 0.09 / np.sqrt(40) + 0.01)


def test_noise_that_two_channels_share_counts_once():
    """Oracle: the scatter of 200 estimates from two channels with the same noise, known to 5 %.
    Channel by channel the errors would be sqrt(2) times too small."""
    rng = np.random.default_rng(9)
    jacobian = regressors(2000)
    both = np.stack([jacobian, jacobian])
    estimates, errors = [], []
    for _ in range(200):
        noise = rng.normal(size=2000)
        estimate, residuals = solution(jacobian, noise)
        run = RunResiduals(np.stack([residuals, residuals]), both, STEP)
        estimates.append(estimate)
        errors.append(uncertainty(information([run])).std_error)
    ratio = np.mean(errors, axis=0) / np.std(estimates, axis=0)
    assert np.all((ratio > 0.8) & (ratio < 1.15)), ratio


def test_noise_of_the_inputs_is_seen_below_the_noise_of_the_outputs():
    """Oracle: the scatter of 200 estimates. Noise below 3 Hz of a fifth of the white noise's
    deviation, hence 4 % of its power, has more power than that in the band of the columns; the
    lag-one correlation of 0.04 does not betray it."""
    rng = np.random.default_rng(10)
    jacobian = regressors(4000)
    time = STEP * np.arange(4000)
    estimates, errors = [], []
    for _ in range(200):
        slow = low_pass(time, rng.normal(size=4000), 3.0) * np.sqrt(100.0 / 3.0)
        estimate, residuals = solution(jacobian, rng.normal(size=4000) + 0.2 * slow)
        estimates.append(estimate)
        errors.append(errors_of((residuals, jacobian)).std_error)
    ratio = np.mean(errors, axis=0) / np.std(estimates, axis=0)
    textbook = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian))) / np.std(estimates, axis=0)
    assert np.all((ratio > 0.85) & (ratio < 1.15)), ratio
    assert np.all(textbook < 0.8), textbook


def test_slow_misfit_gives_errors_that_hold():
    """Oracle: the scatter of the estimates over 200 realisations of noise with a correlation time
    of 20 samples, known to 1 / sqrt(400) = 5 %; a windowed estimate is low by 10 to 20 %."""
    rng = np.random.default_rng(5)
    jacobian = regressors(2000)
    estimates, errors = [], []
    for _ in range(200):
        estimate, residuals = solution(jacobian, first_order(rng, 2000, 0.95))
        estimates.append(estimate)
        errors.append(errors_of((residuals, jacobian)).std_error)
    ratio = np.mean(errors, axis=0) / np.std(estimates, axis=0)
    assert np.all((ratio > 0.7) & (ratio < 1.2)), ratio


def test_covariances_enter_as_their_toeplitz_matrices():
    """Oracle: B J^T G J B with the matrix G of two channels written out. White columns take n / N
    = 1.25 % out of each frequency's power, on average, and about twice that from some."""
    rng = np.random.default_rng(6)
    jacobian = rng.normal(size=(2, 600, 3))
    shared = first_order(rng, 600, 0.8)
    residuals = np.stack([shared + rng.normal(size=600), shared + rng.normal(size=600)])
    width = bandwidth(residuals, STEP)
    assert width == 600 / 4
    lag = [
        [
            np.concatenate([smoothed_covariance(one, other, width), np.zeros(600 - 150)])
            for other in residuals
        ]
        for one in residuals
    ]
    matrix = np.block([[toeplitz(lag[a][b], lag[b][a]) for b in (0, 1)] for a in (0, 1)])
    tall = jacobian.reshape(-1, 3)
    bread = np.linalg.inv(tall.T @ tall)
    expected = bread @ tall.T @ matrix @ tall @ bread
    found = uncertainty(information([RunResiduals(residuals, jacobian, STEP)]))
    assert_allclose(found.covariance, expected, rtol=0.025, atol=0.025 * np.abs(expected).max())


def test_a_covariance_is_that_at_each_lag():
    """Oracle: sums written out, with the weights 1 - k / m."""
    one, other = np.random.default_rng(2).normal(size=(2, 40))
    expected = [(1 - k / 3.5) * one[k:] @ other[: 40 - k] / 40 for k in range(4)]
    assert_allclose(smoothed_covariance(one, other, 3.5), expected, atol=1e-15)


def test_what_two_runs_say_adds_up():
    """Oracle: B M B with the sums of both runs' J^T J and M."""
    rng = np.random.default_rng(12)
    columns = regressors(4000)
    halves = columns[:2000], columns[2000:]
    apart = [information([one_channel(rng.normal(size=2000), one)]) for one in halves]
    bread = np.linalg.inv(columns.T @ columns)
    expected = bread @ (apart[0].scatter + apart[1].scatter) @ bread
    assert_allclose(uncertainty(apart[0] + apart[1]).covariance, expected, rtol=1e-9)


def test_the_error_of_a_combination_is_that_of_its_variance():
    """Oracle: Var(a - b) = Var a + Var b - 2 Cov(a, b)."""
    rng = np.random.default_rng(13)
    found = errors_of((rng.normal(size=2000), regressors(2000)))
    c = found.covariance
    expected = np.sqrt(c[0, 0] + c[1, 1] - 2.0 * c[0, 1])
    assert found.error_of(np.array([1.0, -1.0, 0.0])) == pytest.approx(expected)
    assert found.correlation[0, 1] == pytest.approx(c[0, 1] / np.sqrt(c[0, 0] * c[1, 1]))


def test_a_direction_without_effect_is_infinite_and_leaves_the_rest_alone():
    """Oracle: the first two columns are the same up to scale, so only their sum is known; the
    third parameter's error is that of a fit without the second."""
    rng = np.random.default_rng(7)
    known = regressors(2000)[:, [0, 2]]
    _, residuals = solution(known, rng.normal(size=2000))
    jacobian = np.column_stack([known[:, 0], 3.0 * known[:, 0], known[:, 1]])
    found = errors_of((residuals, jacobian))
    assert np.all(np.isinf(found.std_error[:2]))
    assert np.all(np.isinf(found.half_width[:2]))
    alone = errors_of((residuals, known))
    assert_allclose(found.std_error[2], alone.std_error[1], rtol=2e-3)
    summed = found.error_of(np.array([1.0, 3.0, 0.0]))
    assert_allclose(summed, alone.std_error[0], rtol=2e-3)
    assert np.isnan(found.correlation[0, 2])
    assert_allclose(np.diag(found.correlation), 1.0)


def test_a_parameter_without_effect_is_infinite():
    rng = np.random.default_rng(8)
    jacobian = regressors(2000)
    jacobian[:, 1] = 0.0
    _, residuals = solution(jacobian, rng.normal(size=2000))
    found = errors_of((residuals, jacobian))
    assert list(np.isinf(found.std_error)) == [False, True, False]
    assert np.isinf(found.alone[1])


def test_an_effect_far_below_the_noise_is_none():
    """Oracle: the standard error of a column of length 1e-4 is 1e4. Rounding alone gives such
    columns, and residuals of the same size would make them look well known."""
    columns = regressors(100)
    faint = 1e-4 * columns / np.linalg.norm(columns, axis=0)
    found = errors_of((faint[:, 0], faint))
    assert np.all(np.isinf(found.half_width))
    assert np.all(np.isnan(found.correlation[~np.eye(3, dtype=bool)]))


def test_a_perfect_fit_has_no_error():
    found = errors_of((np.zeros(100), regressors(100)))
    assert_allclose(found.std_error, 0.0, atol=0.0)


def test_a_parameter_that_moves_the_runs_by_rounding_alone_is_not_excited():
    """Oracle: in exact arithmetic the third column is zero, and the runs say nothing of it."""
    jacobian = regressors(500)
    jacobian[:, 2] *= 1e-13
    found = errors_of((np.zeros(500), jacobian))
    assert np.isinf(found.alone[2])
    assert_allclose(found.alone[:2], 0.0)
