"""The longest step that the integrator can take with a car: RK4 against the car's fastest motion.

For a linear system y' = J y, a classical Runge-Kutta step of length h multiplies the part of the
solution that belongs to the eigenvalue s of J by

    R(h s),    R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24

Where |R| > 1 for a motion that decays, the result is nonsense and need not look like it. On the
negative real axis (stiff dampers, brakes near standstill) that is beyond h |s| = 2.785, on the
imaginary axis (wheel hop) beyond 2.828. J is the Jacobian of the equations of motion in the design
position at rest, where the tanh(v/v0) of rolling resistance and brakes is steepest.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .errors import SimulationError
from .integration import ARM_ACCELERATIONS, free_outputs, rims_outputs
from .road import Road

Array = NDArray[np.float64]

MARGIN = 0.9
"""Share of the limit that is accepted: away from the design position a car is somewhat stiffer."""

_DIFFERENCE = 1e-6
_ROUNDING = 1e-9
_RAY = np.linspace(0.0, 4.0, 4001)[1:]
"""h |s| along a ray of the complex plane; RK4 is stable on none beyond 3.5."""


def check_free_step(car: Array, brake: Array, step: float) -> None:
    """Raise SimulationError for a step too long for a car on a road or a rig.

    car (CAR_ROWS,) : record of `car_rows.car_row`
    brake (4,) : greatest brake torques, N m
    step : longest step, s
    """
    acting = np.concatenate([np.zeros(12), brake])

    def accelerations(q: Array, rates: Array) -> Array:
        states = np.hstack([q, rates])
        out = free_outputs(car, states, np.tile(acting, (len(q), 1)), Road.flat())
        return np.hstack([out[:, :4], out[:, ARM_ACCELERATIONS]])

    _check(step, eigenvalues(accelerations, 8))


def check_rims_step(car: Array, step: float) -> None:
    """Raise SimulationError for a step too long for a car on its rims, where z, pitch and roll are
    left; arguments as of `check_free_step`.
    """
    _check(step, _rims_eigenvalues(car[np.newaxis])[0])


def stable_on_rims(cars: Array, step: float) -> NDArray[np.bool_]:
    """Which of many cars (C, CAR_ROWS) on their rims take a step, s: what `check_rims_step` raises
    for, as data (C,).
    """
    return _is_stable(step, _rims_eigenvalues(cars))


def _rims_eigenvalues(cars: Array) -> NDArray[np.complex128]:
    """Eigenvalues (C, 6), 1/s, of many cars on their rims."""

    def accelerations(q: Array, rates: Array) -> Array:
        states = np.zeros((len(q), 16))
        states[:, 1:4], states[:, 9:12] = q, rates
        still = np.zeros((len(q), 15))
        return np.array([rims_outputs(car, states, still, True)[:, 1:4] for car in cars])

    return eigenvalues(accelerations, 3)


def eigenvalues(
    accelerations: Callable[[Array, Array], Array], size: int
) -> NDArray[np.complex128]:
    """Eigenvalues (..., 2 size), 1/s, of q'' = f(q, q') linearised about q = q' = 0.

    accelerations : coordinates (n, size), rates (n, size) -> second derivatives (..., n, size), of
        one system or of many
    """
    steps = _DIFFERENCE * np.eye(2 * size)
    steps = np.vstack([steps, -steps])
    values = accelerations(steps[:, :size], steps[:, size:])
    slopes = (values[..., : 2 * size, :] - values[..., 2 * size :, :]) / (2.0 * _DIFFERENCE)
    jacobian = np.zeros((*values.shape[:-2], 2 * size, 2 * size))
    jacobian[..., :size, size:] = np.eye(size)
    jacobian[..., size:, :] = np.swapaxes(slopes, -1, -2)
    return np.linalg.eigvals(jacobian).astype(np.complex128)


def largest_stable_step(values: NDArray[np.complex128]) -> float:
    """Longest step, s, with which RK4 lets every motion that does not grow stay bounded.

    values : eigenvalues, 1/s. A growing one is taken by its frequency alone.
    """
    held = _held(values)
    sizes = np.abs(held)
    fast = sizes > _ROUNDING * max(sizes.max(), 1.0)
    grows = _growth(_RAY * (held[fast] / sizes[fast])[:, np.newaxis]) > 1.0 + _ROUNDING
    limits = _RAY[np.argmax(grows, axis=1) - 1]
    return float(np.min(limits / sizes[fast], initial=np.inf))


def _held(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Eigenvalues of motions that do not grow by themselves."""
    return np.minimum(values.real, 0.0).astype(np.complex128) + 1j * values.imag


def _growth(z: NDArray[np.complex128]) -> Array:
    """|R(z)|."""
    return np.abs(1.0 + z * (1.0 + z * (0.5 + z * (1.0 / 6.0 + z / 24.0))))


def _is_stable(step: float, values: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Whether a step lies within MARGIN of the limit, for eigenvalues (..., n): on a ray RK4 is
    stable up to the limit and nowhere beyond, so that no search is needed.
    """
    return np.all(_growth(step / MARGIN * _held(values)) <= 1.0 + _ROUNDING, axis=-1)


def _check(step: float, values: NDArray[np.complex128]) -> None:
    if _is_stable(step, values):
        return
    longest = _rounded_down(1e3 * MARGIN * largest_stable_step(values))
    fastest = float(np.abs(values).max())
    raise SimulationError(
        f"The step of {1e3 * step:.3g} ms is too long for this car, whose fastest motion changes at"
        f" {fastest:.3g} 1/s; take a step of at most {longest:g} ms, or correct its"
        " stiffest spring, damper, bar or tyre, its lightest wheel or its pivot distances."
    )


def _rounded_down(value: float) -> float:
    """To two digits."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(np.floor(value / unit) * unit)
