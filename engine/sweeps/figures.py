"""The figures of many cars that go through the same: the one place a sweep gets its numbers from.

A figure is a metric (`metrics.py`) of a simulated car. Not every car has every figure (one that
never brakes does not dive), so the columns are those of a run in which everything happens.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..errors import RideError
from ..frames import CORNERS
from ..run import Run
from ..simulation.excitation import Excitation
from ..simulation.metrics import metrics
from ..simulation.output_channels import DEFAULT_POINTS
from ..vehicle import Vehicle

OK = "ok"
"""Status of a car that came through."""


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure in `unit` (SI), shown as value * display_factor in `display_unit`."""

    name: str
    label: str
    unit: str
    display_unit: str
    display_factor: float


@cache
def figures() -> tuple[Figure, ...]:
    """Every figure that a simulated car can have, in their order."""
    time = np.arange(0.0, 4.0, 0.01)
    seats = [f"{point}.a_{axis}" for point in DEFAULT_POINTS for axis in "xyz"]
    body = ["chassis.z", "chassis.pitch", "chassis.roll"]
    travels = [f"suspension.{corner}.travel" for corner in CORNERS]
    channels = dict.fromkeys([*seats, *body, *travels], np.zeros_like(time))
    channels |= {f"tyre.{corner}.load": np.ones_like(time) for corner in CORNERS}
    channels["chassis.a_x"] = np.where(time < 2.0, 2.0, -2.0)
    return tuple(
        Figure(one.name, one.label, one.unit, one.display_unit, one.display_factor)
        for one in metrics(Run("everything", time, channels))
    )


def figures_of(
    cars: Sequence[Vehicle], excitation: Excitation, *, threads: int = 1
) -> dict[str, NDArray]:
    """Figures of some cars: name -> (cars,) in SI, and "status" -> (cars,).

    A figure that a car does not have is not a number. Neither are all figures of a car that fails;
    its status says why in a sentence, that of all others is OK.
    """
    with ThreadPoolExecutor(threads) as pool:
        rows = list(pool.map(lambda car: _row(car, excitation), cars))
    found: dict[str, NDArray] = {
        figure.name: np.array([row.get(figure.name, np.nan) for row, _ in rows], dtype=np.float64)
        for figure in figures()
    }
    found["status"] = np.array([status for _, status in rows], dtype=object)
    return found


def reason(error: RideError) -> str:
    """Why a car failed: what is wrong, without the remedy."""
    told = str(error).partition(";")[0].removeprefix("vehicle: ").rstrip(".")
    return f"{told[:1].upper()}{told[1:]}."


def _row(car: Vehicle, excitation: Excitation) -> tuple[dict[str, float], str]:
    """Figures of one car, and its status."""
    try:
        run = excitation.simulate(car).run
    except RideError as error:
        return {}, reason(error)
    return {metric.name: metric.value for metric in metrics(run)}, OK
