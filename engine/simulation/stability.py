"""The longest step that the integrator can take with a car: RK4 against the car's fastest motion.

For a linear system y' = J y, a classical Runge-Kutta step of length h multiplies the part of the
solution that belongs to the eigenvalue s of J by

    R(h s),    R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24

Where |R| > 1 for a motion that decays, the result is nonsense and need not look like it. On the
negative real axis (stiff dampers, brakes near standstill) that is beyond h |s| = 2.785, on the
imaginary axis (wheel hop) beyond 2.828. J is the Jacobian of the equations of motion in the design
position at rest, where the tanh(v/v0) of rolling resistance and brakes is steepest; a damper counts
with the steeper of its slopes in jounce and rebound.
"""

from collections.abc import Callable
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from ..errors import SimulationError
from ..roads.road import Road
from .car_rows import AT_ONCE, with_steepest_dampers
from .integration import ARM_ACCELERATIONS, free_outputs, rims_outputs
from .step_bound import fastest_on_road

Array = NDArray[np.float64]

MARGIN = 0.9
"""Share of the limit that is accepted: away from the design position a car is somewhat stiffer."""

HALF_DISC = 2.6
"""RK4 is stable for every z of the left half plane that is no larger: |R| = 1 comes nearest to 0 at
2.6156, on the ray of 122.7 deg."""

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
    # Of one car the eigenvalues take less time than the bound by which most of many do without.
    values = road_eigenvalues(car[np.newaxis], brake)[0]
    if not is_stable(step, values):
        _refuse(step, values)


def stable_on_road(cars: Array, brake: Array, step: float) -> NDArray[np.bool_]:
    """Which of many cars (C, CAR_ROWS) take a step on a road or a rig, s: what `check_free_step`
    raises for, as data (C,); an impossible car (not a number) takes none.

    brake : (4,) or (C, 4)

    An eigenvalue s of a motion that is held not to grow lies in the left half plane. Where a bound
    b >= |s| gives h b <= HALF_DISC, all h s lie in the half disc, in which RK4 is stable; only
    where it does not are the eigenvalues themselves found.
    """
    brakes = np.broadcast_to(brake, (len(cars), 4))
    stable = np.zeros(len(cars), dtype=bool)
    for first in range(0, len(cars), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        within = step / MARGIN * fastest_on_road(cars[some], brakes[some]) <= HALF_DISC
        undecided = ~within & np.isfinite(cars[some, 0])
        within[undecided] = is_stable(
            step, road_eigenvalues(cars[some][undecided], brakes[some][undecided])
        )
        stable[some] = within
    return stable


def road_eigenvalues(cars: Array, brake: Array) -> NDArray[np.complex128]:
    """Eigenvalues (C, 16), 1/s, of many cars on a road or a rig; brake (4,) or (C, 4)."""
    steepest, brakes = with_steepest_dampers(cars), np.broadcast_to(brake, (len(cars), 4))

    def accelerations(q: Array, rates: Array) -> Array:
        states, acting = np.hstack([q, rates]), np.zeros((len(q), 16))
        found = np.empty((len(cars), len(q), 8))
        for car, braked, values in zip(steepest, brakes, found, strict=True):
            acting[:, 12:] = braked
            out = free_outputs(car, states, acting, Road.flat())
            values[:, :4], values[:, 4:] = out[:, :4], out[:, ARM_ACCELERATIONS]
        return found

    return eigenvalues(accelerations, 8)


def check_rims_step(car: Array, step: float) -> None:
    """Raise SimulationError for a step too long for a car on its rims, where z, pitch and roll are
    left; arguments as of `check_free_step`.
    """
    values = rims_eigenvalues(car[np.newaxis])[0]
    if not is_stable(step, values):
        _refuse(step, values)


def stable_on_rims(cars: Array, step: float) -> NDArray[np.bool_]:
    """Which of many cars (C, CAR_ROWS) on their rims take a step, s: what `check_rims_step` raises
    for, as data (C,); an impossible car (not a number) takes none.
    """
    stable = np.isfinite(cars[:, 0])
    stable[stable] = is_stable(step, rims_eigenvalues(cars[stable]))
    return stable


def rims_eigenvalues(cars: Array) -> NDArray[np.complex128]:
    """Eigenvalues (C, 6), 1/s, of many cars on their rims."""
    steepest = with_steepest_dampers(cars)

    def accelerations(q: Array, rates: Array) -> Array:
        states = np.zeros((len(q), 16))
        states[:, 1:4], states[:, 9:12] = q, rates
        still = np.zeros((len(q), 15))
        found = np.empty((len(cars), len(q), 3))
        for car, values in zip(steepest, found, strict=True):
            values[:] = rims_outputs(car, states, still, True)[:, 1:4]
        return found

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


def is_stable(step: float, values: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Whether a step lies within MARGIN of the limit, for eigenvalues (..., n): on a ray RK4 is
    stable up to the limit and nowhere beyond, so that no search is needed.
    """
    return np.all(_growth(step / MARGIN * _held(values)) <= 1.0 + _ROUNDING, axis=-1)


def _refuse(step: float, values: NDArray[np.complex128]) -> NoReturn:
    raise too_long(
        step,
        values,
        "this car",
        "correct its stiffest spring, damper, bar or tyre, its lightest wheel or its pivot"
        " distances",
    )


def too_long(
    step: float, values: NDArray[np.complex128], whose: str, remedy: str
) -> SimulationError:
    """The refusal of a step, s, for a car with some eigenvalues; says the longest accepted one."""
    longest = _rounded_down(1e3 * MARGIN * largest_stable_step(values))
    fastest = float(np.abs(values).max())
    return SimulationError(
        f"The step of {1e3 * step:.3g} ms is too long for {whose}, whose fastest motion changes at"
        f" {fastest:.3g} 1/s; take a step of at most {longest:g} ms, or {remedy}."
    )


def _rounded_down(value: float) -> float:
    """To two digits."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(np.floor(value / unit) * unit)
