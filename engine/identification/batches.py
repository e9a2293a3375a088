"""Batches of cars through several runs, side by side, until somebody cancels."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait

import numpy as np
from numpy.typing import NDArray

from ..errors import Cancelled
from ..kernels.lanes import BATCH
from ..simulation.rims import RimsInputs
from ..simulation.simulate import Traction

Array = NDArray[np.float64]
Simulate = Callable[[Array, RimsInputs, Traction], Array]
"""(cars (C, CAR_ROWS), inputs, traction) -> (C, samples, 3); a failed car is not a number."""

CAR_STEPS_AT_ONCE = 400_000
"""Cars times steps in one batch: 16 numbers each, about 50 MB."""

LANES = len(BATCH)
"""Cars the simulation works on side by side; a batch is cut at multiples of it."""

RUNS_AT_ONCE = 2
"""Batches of different runs under way together: one fills the cores when another ends."""

LOOK_EVERY = 0.05
"""Seconds between two looks at `cancelled`; a batch under way then ends unseen."""


class Batches:
    """Simulations of many cars, counted.

    simulate : the rims mode for a batch of cars
    cancelled : polled every LOOK_EVERY seconds; true raises Cancelled
    """

    def __init__(self, simulate: Simulate, cancelled: Callable[[], bool] | None):
        self.simulate, self.cancelled = simulate, cancelled
        self.simulations = 0

    def histories(
        self, cars: Array, inputs: Sequence[RimsInputs], traction: Traction
    ) -> list[Array]:
        """Of each run z, pitch and roll, (cars, samples, 3)."""
        pool = ThreadPoolExecutor(RUNS_AT_ONCE)
        try:
            parts = [
                [
                    pool.submit(self.simulate, some, of_run, traction)
                    for some in _parts(cars, len(of_run.node_time))
                ]
                for of_run in inputs
            ]
            pending = {future for run in parts for future in run}
            while pending:
                self._stop_if_cancelled()
                pending = wait(pending, LOOK_EVERY).not_done
            self.simulations += len(cars) * len(parts)
            return [np.concatenate([future.result() for future in run]) for run in parts]
        finally:
            pool.shutdown(wait=False, cancel_futures=True)

    def _stop_if_cancelled(self) -> None:
        if self.cancelled is not None and self.cancelled():
            raise Cancelled(
                f"The identification was cancelled after {self.simulations} simulations."
            )


def _parts(cars: Array, nodes: int) -> list[Array]:
    """The cars in batches that keep memory flat on long runs."""
    at_once = LANES * max(1, CAR_STEPS_AT_ONCE // (LANES * nodes))
    return [cars[k : k + at_once] for k in range(0, len(cars), at_once)]
