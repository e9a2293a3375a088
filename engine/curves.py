"""Smooth curves that roads and rigs are drawn with: a level step and a swept sine."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


def smooth_step(s: ArrayLike) -> NDArray[np.float64]:
    """0 below 0, 1 above 1 and 6 s^5 - 15 s^4 + 10 s^3 between: C2, level at both ends."""
    s = np.clip(np.asarray(s, dtype=float), 0.0, 1.0)
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


@dataclass(frozen=True, slots=True)
class SweptSine:
    """A sine whose frequency grows exponentially from `first` to `last` over `span`.

        y(t) = A(t) w(t) sin(phi(t)),    dphi/dt = 2 pi f(t),    f(t) = first (last/first)^(t/span)

    A goes from `amplitude` to `last_amplitude` as a power of the frequency. The window w opens
    over the first wave and closes over the last ones, so that y starts and ends at 0, level.
    t may be a time (first, last in Hz) or a distance (in cycle/m).
    """

    span: float
    first: float
    last: float
    amplitude: float
    last_amplitude: float

    def __call__(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """y at t; 0 outside 0 ... span."""
        s = np.clip(t / self.span, 0.0, 1.0)
        size = self.amplitude * (self.last_amplitude / self.amplitude) ** s
        opening = smooth_step(s * self.span * self.first)
        closing = smooth_step((1.0 - s) * self.span * self.last / 4.0)
        return size * opening * closing * np.sin(self.phase(s * self.span))

    def phase(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """phi(t), rad."""
        growth = np.log(self.last / self.first)
        if abs(growth) < 1e-9:
            return 2.0 * np.pi * self.first * t
        return 2.0 * np.pi * self.first * self.span / growth * np.expm1(growth * t / self.span)
