"""The weightings of ISO 2631-1 as differential equations, for figures found along the way.

A weighting is a chain of sections of second order (`iso2631.py`). A section

    (b2 s^2 + b1 s + b0) / (s^2 + (w/Q) s + w^2)

with states x1 = w^2/D u and x2 = w s/D u has x1' = w x2, x2' = w (u - x1 - x2/Q) and the output
b2 u + (b0/w^2 - b2) x1 + (b1/w - b2/Q) x2. All poles are different pairs, so that the chain
x' = A x + B a, y = C x falls into modes of two states. Each is stepped exactly for an acceleration
that is a parabola through its values at the begin, middle and end of a step, which are what a
Runge-Kutta step of the car knows.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from .iso2631 import FIRST, LAST, ROOT_HALF, SHAPES, Weighting

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WeightingFilter:
    """x' = A x + B a, y = C x.

    A (n, n), 1/s : blocks of two by two on its diagonal; B (n,), 1/s; C (n,)
    """

    A: Array
    B: Array
    C: Array

    def step(self, h: float) -> Array:
        """Row i : what x_i(t + h) takes of both states of its mode at t and of a(t), a(t + h/2) and
        a(t + h), (n, 5).

        The parabola is u(t) with u'' constant: [x; u; h u'; h^2 u''] obeys a linear equation.
        """
        n = self.B.size
        system = np.zeros((n + 3, n + 3))
        system[:n, :n], system[:n, n] = h * self.A, h * self.B
        system[n, n + 1] = system[n + 1, n + 2] = 1.0
        parabola = np.array([[1.0, 0.0, 0.0], [-3.0, 4.0, -1.0], [4.0, -8.0, 4.0]])
        found = np.asarray(expm(system), dtype=np.float64)[:n]
        modes = [found[i, i // 2 * 2 : i // 2 * 2 + 2] for i in range(n)]
        return np.hstack([modes, found[:, n:] @ parabola])


def weighting_filter(weighting: Weighting) -> WeightingFilter:
    """The modes of a weighting's chain, low pass first: its output has no share of a itself."""
    shape = SHAPES[weighting]
    w1, w2, w3, w4 = (2.0 * np.pi * f for f in (FIRST, LAST, shape.f3, shape.f4))
    sections = [
        ((0.0, 0.0, w2**2), w2, ROOT_HALF),
        ((1.0, 0.0, 0.0), w1, ROOT_HALF),
        ((0.0, w4**2 / w3, w4**2), w4, shape.q4),
    ]
    if shape.step is not None:
        f5, q5, f6, q6 = shape.step
        w5, w6 = 2.0 * np.pi * f5, 2.0 * np.pi * f6
        sections.append(((1.0, w5 / q5, w5**2), w6, q6))
    n = 2 * len(sections)
    A, B = np.zeros((n, n)), np.zeros(n)
    C, D = np.zeros(n), 1.0  # what enters the next section: C x + D a
    for k, ((b2, b1, b0), w, q) in enumerate(sections):
        one, two = 2 * k, 2 * k + 1
        A[one, two] = w
        A[two], B[two] = w * C, w * D
        A[two, one] -= w
        A[two, two] -= w / q
        C, D = b2 * C, b2 * D
        C[one] += b0 / w**2 - b2
        C[two] += b1 / w - b2 / q
    return _in_modes(A, B, C)


def _in_modes(A: Array, B: Array, C: Array) -> WeightingFilter:
    """The same filter in coordinates in which each pair of poles has its own two states."""
    poles, vectors = (np.asarray(part, dtype=np.complex128) for part in np.linalg.eig(A))
    upper = vectors[:, poles.imag > 0.0]
    to = np.zeros_like(A)
    to[:, 0::2], to[:, 1::2] = upper.real, upper.imag
    back = np.asarray(np.linalg.inv(to), dtype=np.float64)
    return WeightingFilter(back @ A @ to, back @ B, C @ to)
