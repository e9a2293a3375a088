"""The kernels' polynomials against libm."""

import numpy as np
import pytest
from numba import njit
from numpy.testing import assert_allclose
from ridetune.engine.kernels.elementary import angle_of, cosine, hyperbolic_tangent, sine


@njit
def at(function, values):
    """A kernel's function, which Python cannot call, at many values."""
    return np.array([function(value) for value in values])


@njit
def at_pairs(function, first, second):
    """The same of two arguments."""
    return np.array([function(first[k], second[k]) for k in range(len(first))])


ANGLES = np.linspace(-1.5, 1.5, 3001)


def test_sine_and_cosine_are_those_of_libm_within_rounding():
    """Oracle: numpy. Remainders below 1.5^21/21! = 1e-16; a few roundings beside."""
    assert_allclose(at(sine, ANGLES), np.sin(ANGLES), rtol=0, atol=5e-16)
    assert_allclose(at(cosine, ANGLES), np.cos(ANGLES), rtol=0, atol=5e-16)


def test_an_angle_is_recovered_from_its_sine_and_cosine():
    """Oracle: numpy's functions of the angle. Series: 4 tan(1.5/4)^29/29 = 2.4e-13 at the ends."""
    found = at_pairs(angle_of, np.sin(ANGLES), np.cos(ANGLES))
    assert_allclose(found, ANGLES, rtol=0, atol=2.5e-13)
    small = np.abs(ANGLES) < 0.6
    assert_allclose(found[small], ANGLES[small], rtol=0, atol=1e-15)


def test_the_hyperbolic_tangent_is_libms_odd_and_bounded():
    """Oracle: numpy; exp(-y/64)^64 multiplies the rounding of its base by 64: 64 * 2e-16."""
    x = np.concatenate([np.linspace(-30.0, 30.0, 4001), [0.0, 1e-9, -1e300, 1e300]])
    values = at(hyperbolic_tangent, x)
    assert_allclose(values, np.tanh(x), rtol=0, atol=1.3e-14)
    assert_allclose(at(hyperbolic_tangent, -x), -values, rtol=0, atol=0)
    assert np.all(np.abs(values) <= 1.0)
    assert at(hyperbolic_tangent, np.zeros(1))[0] == 0.0


@pytest.mark.parametrize("function", [sine, cosine, hyperbolic_tangent])
def test_not_a_number_stays_not_a_number(function):
    """A diverged car must show."""
    assert np.isnan(at(function, np.array([np.nan])))[0]


def test_python_is_told_that_it_cannot_call_what_kernels_are_made_of():
    with pytest.raises(TypeError, match="sine works within kernels only"):
        sine(0.3)
    at(sine, ANGLES)
    with pytest.raises(TypeError, match="sine works within kernels only"):
        sine(0.3)
