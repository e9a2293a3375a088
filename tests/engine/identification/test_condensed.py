import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.identification.condensed import (
    condensed_jacobian,
    condensed_residuals,
    triangle,
)


@pytest.mark.parametrize("samples", [5, 512, 1300])
def test_a_condensed_problem_has_the_same_size_gradient_and_curvature(samples):
    """Oracle: |r|, J^T r and J^T J of the whole problem."""
    rng = np.random.default_rng(samples)
    r, jacobian = rng.normal(size=samples), rng.normal(size=(samples, 4))
    short_r, short = condensed_residuals(r, 4), condensed_jacobian(r, jacobian)
    assert short.shape == (5, 4)
    assert_allclose(short_r @ short_r, r @ r, rtol=1e-13)
    assert_allclose(short.T @ short_r, jacobian.T @ r, atol=1e-11)
    assert_allclose(short.T @ short, jacobian.T @ jacobian, atol=1e-11)


def test_residuals_that_vanish_leave_the_curvature():
    """Oracle: J^T J."""
    jacobian = np.random.default_rng(1).normal(size=(700, 3))
    short = condensed_jacobian(np.zeros(700), jacobian)
    assert_allclose(short.T @ short, jacobian.T @ jacobian, atol=1e-11)


def test_the_triangle_keeps_small_singular_values():
    """Oracle: the spectrum the matrix was made with; J^T J would lose it below 1e-8."""
    rng = np.random.default_rng(2)
    left, _ = np.linalg.qr(rng.normal(size=(3000, 3)))
    right, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    spectrum = np.array([1.0, 1e-6, 1e-12])
    found = np.linalg.svd(triangle(left * spectrum @ right.T), compute_uv=False)
    assert_allclose(found, spectrum, rtol=1e-3)
