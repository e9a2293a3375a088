"""Sine, cosine, arc tangent and hyperbolic tangent as branch-free polynomials.

The library functions of libm keep a loop over cars scalar. The angles of a car are small, so
Taylor series do: their remainder is below one unit in the last place for |angle| < pi/2, and a
simulation that leaves this range is stopped as diverged.
"""

from math import sqrt

from ..jit import inlined


@inlined
def sine(angle):
    """sin(angle) through angle^19; remainder below angle^21 / 21!."""
    s = angle * angle
    series = 1.0 - s / 342.0
    series = 1.0 - s / 272.0 * series
    series = 1.0 - s / 210.0 * series
    series = 1.0 - s / 156.0 * series
    series = 1.0 - s / 110.0 * series
    series = 1.0 - s / 72.0 * series
    series = 1.0 - s / 42.0 * series
    series = 1.0 - s / 20.0 * series
    series = 1.0 - s / 6.0 * series
    return angle * series


@inlined
def cosine(angle):
    """cos(angle) through angle^20; remainder below angle^22 / 22!."""
    s = angle * angle
    series = 1.0 - s / 380.0
    series = 1.0 - s / 306.0 * series
    series = 1.0 - s / 240.0 * series
    series = 1.0 - s / 182.0 * series
    series = 1.0 - s / 132.0 * series
    series = 1.0 - s / 90.0 * series
    series = 1.0 - s / 56.0 * series
    series = 1.0 - s / 30.0 * series
    series = 1.0 - s / 12.0 * series
    return 1.0 - 0.5 * s * series


@inlined
def angle_of(sine_value, cosine_value):
    """Angle in (-pi/2, pi/2) with the given sine and cosine.

    Two exact halvings, tan(a/2) = sin a / (1 + cos a) and tan(a/4) = t / (1 + sqrt(1 + t^2)),
    bring the argument of the arc tangent's series below tan(pi/8); remainder below t^29 / 29.
    """
    half = sine_value / (1.0 + cosine_value)
    quarter = half / (1.0 + sqrt(1.0 + half * half))
    s = quarter * quarter
    series = 1.0 / 25.0 - s / 27.0
    series = 1.0 / 23.0 - s * series
    series = 1.0 / 21.0 - s * series
    series = 1.0 / 19.0 - s * series
    series = 1.0 / 17.0 - s * series
    series = 1.0 / 15.0 - s * series
    series = 1.0 / 13.0 - s * series
    series = 1.0 / 11.0 - s * series
    series = 1.0 / 9.0 - s * series
    series = 1.0 / 7.0 - s * series
    series = 1.0 / 5.0 - s * series
    series = 1.0 / 3.0 - s * series
    return 4.0 * quarter * (1.0 - s * series)


@inlined
def hyperbolic_tangent(x):
    """tanh(x) = (1 - e) / (1 + e) with e = exp(-2 |x|), absolute error below 2e-14.

    exp(-y) = exp(-y/64)^64 with a Taylor series through (y/64)^14; y is clipped at 40, where
    tanh is 1 to the last bit.
    """
    y = min(2.0 * abs(x), 40.0) / 64.0
    series = 1.0 - y / 14.0
    series = 1.0 - y / 13.0 * series
    series = 1.0 - y / 12.0 * series
    series = 1.0 - y / 11.0 * series
    series = 1.0 - y / 10.0 * series
    series = 1.0 - y / 9.0 * series
    series = 1.0 - y / 8.0 * series
    series = 1.0 - y / 7.0 * series
    series = 1.0 - y / 6.0 * series
    series = 1.0 - y / 5.0 * series
    series = 1.0 - y / 4.0 * series
    series = 1.0 - y / 3.0 * series
    series = 1.0 - y / 2.0 * series
    e = 1.0 - y * series
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    magnitude = (1.0 - e) / (1.0 + e)
    return magnitude if x >= 0.0 else -magnitude
