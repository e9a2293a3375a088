"""`scipy.integrate.solve_ivp` on our own compiled right-hand side, at an error not above ours."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ...engine.demand import Demand
from .modes import relative_error
from .right_hand_side import rate_of

Array = NDArray[np.float64]

METHODS = ("RK45", "DOP853", "LSODA")

RELATIVE = tuple(10.0 ** (-k / 2) for k in range(6, 18))
"""Relative tolerances to try, from loose to tight."""

ABSOLUTE = (1e-2, 1e-4)
"""Absolute over relative tolerance, m and rad: of a car's motion of centimetres, and finer."""


@dataclass(frozen=True, eq=False)
class Solver:
    """One method with its tolerances on one car and demand.

    start (16,) : state at t = 0;  time (S,) : when states are wanted, s
    """

    car: Array
    demand: Demand
    start: Array
    time: Array
    method: str
    relative: float
    absolute: float

    def solve(self) -> tuple[Array, int]:
        """States (S, 16) and the right-hand sides they took."""
        found = solve_ivp(
            rate_of(self.car, self.demand),
            (self.time[0], self.time[-1]),
            self.start,
            method=self.method,
            t_eval=self.time,
            rtol=self.relative,
            atol=self.absolute,
        )
        return found.y.T, found.nfev


@dataclass(frozen=True, eq=False)
class Choice:
    """A solver with the error and the right-hand sides that it takes."""

    solver: Solver
    error: float
    evaluations: int


def cheapest(
    method: str, car: Array, demand: Demand, time: Array, reference: Array, error: float
) -> Choice:
    """The setting with the fewest right-hand sides whose error is not above a given one.

    reference (S, 16) : converged states at `time`
    Of each ratio of tolerances the loosest that will do; the most exact where none will.
    """
    choices = []
    for share in ABSOLUTE:
        choice = None
        for choice in _tried(method, car, demand, time, reference, share):
            if choice.error <= error:
                break
        assert choice is not None
        choices.append(choice)
    exact = [choice for choice in choices if choice.error <= error]
    if exact:
        return min(exact, key=lambda choice: choice.evaluations)
    return min(choices, key=lambda choice: choice.error)


def _tried(
    method: str, car: Array, demand: Demand, time: Array, reference: Array, share: float
) -> Iterator[Choice]:
    for relative in RELATIVE:
        solver = Solver(car, demand, reference[0], time, method, relative, share * relative)
        states, evaluations = solver.solve()
        yield Choice(solver, relative_error(states, reference), evaluations)
