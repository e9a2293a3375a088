"""Sine, cosine, arc tangent and hyperbolic tangent as branch-free polynomials.

The library functions of libm keep a loop over cars scalar. The angles of a car are small, so
Taylor series do: their remainder is below one unit in the last place for |angle| < pi/2, and a
simulation that leaves this range is stopped as diverged. Horner's scheme costs one fused
multiply-add a term.
"""

from math import factorial, sqrt

from ..jit import inlined

_SINE = tuple((-1.0) ** k / factorial(2 * k + 1) for k in range(10))
_COSINE = tuple((-1.0) ** k / factorial(2 * k) for k in range(11))
_ARC_TANGENT = tuple((-1.0) ** k / (2 * k + 1) for k in range(14))
_EXPONENTIAL = tuple((-1.0) ** k / factorial(k) for k in range(15))


@inlined
def sine(angle):
    """sin(angle) through angle^19; remainder below angle^21 / 21!."""
    s = angle * angle
    series = _SINE[8] + s * _SINE[9]
    series = _SINE[7] + s * series
    series = _SINE[6] + s * series
    series = _SINE[5] + s * series
    series = _SINE[4] + s * series
    series = _SINE[3] + s * series
    series = _SINE[2] + s * series
    series = _SINE[1] + s * series
    return angle + angle * s * series


@inlined
def cosine(angle):
    """cos(angle) through angle^20; remainder below angle^22 / 22!."""
    s = angle * angle
    series = _COSINE[9] + s * _COSINE[10]
    series = _COSINE[8] + s * series
    series = _COSINE[7] + s * series
    series = _COSINE[6] + s * series
    series = _COSINE[5] + s * series
    series = _COSINE[4] + s * series
    series = _COSINE[3] + s * series
    series = _COSINE[2] + s * series
    series = _COSINE[1] + s * series
    return 1.0 + s * series


@inlined
def angle_of(sine_value, cosine_value):
    """Angle in (-pi/2, pi/2) with the given sine and cosine.

    Two halvings, t = tan(a/4) = sin a / (1 + cos a + sqrt(2 (1 + cos a))), bring the argument of
    the arc tangent's series below tan(pi/8); remainder below t^29 / 29.
    """
    twice = 1.0 + cosine_value
    quarter = sine_value / (twice + sqrt(2.0 * twice))
    s = quarter * quarter
    series = _ARC_TANGENT[12] + s * _ARC_TANGENT[13]
    series = _ARC_TANGENT[11] + s * series
    series = _ARC_TANGENT[10] + s * series
    series = _ARC_TANGENT[9] + s * series
    series = _ARC_TANGENT[8] + s * series
    series = _ARC_TANGENT[7] + s * series
    series = _ARC_TANGENT[6] + s * series
    series = _ARC_TANGENT[5] + s * series
    series = _ARC_TANGENT[4] + s * series
    series = _ARC_TANGENT[3] + s * series
    series = _ARC_TANGENT[2] + s * series
    series = _ARC_TANGENT[1] + s * series
    return 4.0 * (quarter + quarter * s * series)


@inlined
def hyperbolic_tangent(x):
    """tanh(x) = (1 - e) / (1 + e) with e = exp(-2 |x|), absolute error below 2e-14.

    exp(-y) = exp(-y/64)^64 with a Taylor series through (y/64)^14; y is clipped at 40, where
    tanh is 1 to the last bit.
    """
    y = min(2.0 * abs(x), 40.0) / 64.0
    series = _EXPONENTIAL[13] + y * _EXPONENTIAL[14]
    series = _EXPONENTIAL[12] + y * series
    series = _EXPONENTIAL[11] + y * series
    series = _EXPONENTIAL[10] + y * series
    series = _EXPONENTIAL[9] + y * series
    series = _EXPONENTIAL[8] + y * series
    series = _EXPONENTIAL[7] + y * series
    series = _EXPONENTIAL[6] + y * series
    series = _EXPONENTIAL[5] + y * series
    series = _EXPONENTIAL[4] + y * series
    series = _EXPONENTIAL[3] + y * series
    series = _EXPONENTIAL[2] + y * series
    series = _EXPONENTIAL[1] + y * series
    e = 1.0 + y * series
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    magnitude = (1.0 - e) / (1.0 + e)
    return magnitude if x >= 0.0 else -magnitude
