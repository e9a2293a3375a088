"""The weightings as differential equations against the standard's formula."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.iso2631 import SHAPES, response
from ridetune.engine.weighting_filter import weighting_filter
from scipy.integrate import solve_ivp


@pytest.mark.parametrize("weighting", SHAPES)
def test_the_equations_have_the_standard_s_response(weighting):
    """Oracle: C (s - A)^-1 B is the formula of ISO 2631-1."""
    found = weighting_filter(weighting)
    frequencies = np.geomspace(0.05, 400.0, 60)
    unit = np.eye(found.B.size)
    values = [
        found.C @ np.linalg.solve(2j * np.pi * f * unit - found.A, found.B) for f in frequencies
    ]
    assert_allclose(values, response(weighting, frequencies), rtol=1e-10)


@pytest.mark.parametrize("weighting", SHAPES)
def test_each_mode_minds_its_own_two_states(weighting):
    """Oracle: the definition; rounding of the coordinates' change apart."""
    A = weighting_filter(weighting).A
    own = np.kron(np.eye(len(A) // 2), np.ones((2, 2)))
    assert_allclose(A * (1 - own), 0.0, rtol=0, atol=1e-10 * np.abs(A).max())


@pytest.mark.parametrize("weighting", ["Wk", "Wd"])
@pytest.mark.parametrize("h", [0.0005, 0.005])
def test_a_step_is_exact_for_a_parabola(weighting, h):
    """Oracle: an adaptive integration to 1e-11."""
    found = weighting_filter(weighting)
    begin = np.linspace(-1.0, 1.0, found.B.size)

    def a(t):
        return 0.7 - 90.0 * t + 2e4 * t * t

    def rate(t, x):
        return found.A @ x + found.B * a(t)

    exact = solve_ivp(rate, (0.0, h), begin, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    row, known = found.step(h), a(np.array([0.0, h / 2, h]))
    modes = np.repeat(begin.reshape(-1, 2), 2, axis=0)
    stepped = np.sum(row[:, :2] * modes, axis=1) + row[:, 2:] @ known
    assert_allclose(stepped, exact, rtol=0, atol=1e-10)
