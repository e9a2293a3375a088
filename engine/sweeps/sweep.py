"""Sweeps: every car of a design through the same excitation, its figures in one row.

The cars are drawn, simulated and given out block by block, so memory does not grow with their
number; histories are not kept. Cars that are driven alike go side by side (`side_by_side.py`). A
car that cannot exist or leaves the model's range has no figures, but a status that says why, and
the sweep goes on.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import Cancelled, RideError
from ..parameters import ALL_PARAMETERS
from ..simulation.excitation import Excitation
from ..vehicle import Vehicle, numbers
from .designs import Design
from .figures import OK, figures, figures_of, reason
from .side_by_side import SideBySide, side_by_side
from .sweep_checks import check_sweep, stepped_alike, threads_of, typical_cars

Block = dict[str, NDArray]
"""Some rows of a sweep: column -> (cars,); "status" holds sentences, all others numbers."""

BLOCK = 1000
"""Cars in a block."""

LOOK_EVERY = 0.5
"""Time between two looks at whether the sweep is cancelled, s."""

FIRST_PART = 8
"""Cars a thread until it is known how long they take."""


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a sweep; `unit` is SI, "1" for a plain number and nothing for a text."""

    name: str
    label: str
    unit: str


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a sweep has come: cars simulated, of how many, failed, and since when, s.

    Of a share of a sweep, all of that share.
    """

    cars: int
    of: int
    failed: int
    seconds: float


def columns(design: Design) -> tuple[Column, ...]:
    """The columns of a sweep in their order: number, swept parameters, figures, status."""
    labels = {row.name: row.label for row in ALL_PARAMETERS}
    return (
        Column("car", "Number of the car", "1"),
        *(Column(name, labels.get(name, name), numbers()[name].unit) for name in design.names),
        *(Column(figure.name, figure.label, figure.unit) for figure in figures()),
        Column("status", "Whether the car came through, or why not", ""),
    )


def sweep(
    vehicle: Vehicle,
    design: Design,
    excitation: Excitation,
    *,
    cars: range | None = None,
    threads: int | None = None,
    progress: Callable[[Progress], object] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Iterator[Block]:
    """Rows of the cars of a design, in the order of their numbers.

    vehicle : the car whose numbers the design replaces
    cars : a share of the sweep as numbers in a row, whose figures are those of the whole; all
        without
    threads : as many as there are cores without
    progress : told at least every few cars how far the sweep is
    cancelled : asked as often; Cancelled is raised once it says so

    Raises at once what is wrong with the sweep as a whole, see `check_sweep`; a share is taken to
    be one of a sweep that was checked.
    """
    threads = threads_of(threads)
    if cars is None:
        check_sweep(vehicle, design, excitation, threads)
    excitation = stepped_alike(vehicle, design, excitation)
    swept = range(design.cars) if cars is None else cars
    return _blocks(vehicle, design, excitation, swept, threads, progress, cancelled)


def car_of(vehicle: Vehicle, design: Design, number: int) -> Vehicle:
    """One car of a design; VehicleError where it cannot exist."""
    return _car(vehicle, design, design.block(number, 1)[0])


def _blocks(
    vehicle: Vehicle,
    design: Design,
    excitation: Excitation,
    cars: range,
    threads: int,
    progress: Callable[[Progress], object] | None,
    cancelled: Callable[[], bool] | None,
) -> Iterator[Block]:
    began, failed = time.perf_counter(), 0
    part, together = FIRST_PART * threads, side_by_side(excitation, typical_cars(vehicle, design))
    for first in range(cars.start, cars.stop, BLOCK):
        values = design.block(first, min(BLOCK, cars.stop - first))
        at, parts = 0, []
        while at < len(values):
            done = first - cars.start + at
            if cancelled is not None and cancelled():
                raise Cancelled(f"The sweep was cancelled after {done} of {len(cars)} cars.")
            started, some = time.perf_counter(), values[at : at + part]
            if together is None:
                parts.append(_one_by_one(vehicle, design, some, excitation, threads))
            else:
                parts.append(_together(vehicle, design, some, excitation, together, threads))
            at += len(some)
            failed += int(np.sum(parts[-1]["status"] != OK))
            taken = time.perf_counter() - started
            part = int(np.clip(len(some) * LOOK_EVERY / taken, threads, BLOCK))
            if progress is not None:
                seconds = time.perf_counter() - began
                progress(Progress(done + len(some), len(cars), failed, seconds))
        yield {
            "car": np.arange(first, first + len(values)),
            **dict(zip(design.names, values.T, strict=True)),
            **{name: np.concatenate([rows[name] for rows in parts]) for name in parts[0]},
        }


def _together(
    vehicle: Vehicle,
    design: Design,
    values: NDArray,
    excitation: Excitation,
    together: SideBySide,
    threads: int,
) -> Block:
    """Figures and status of cars with some values (cars, parameters), in one batch."""
    cars = together.rows(vehicle, design.names, values)
    stable = together.stable(cars)
    rows: Block = {figure.name: np.full(len(values), np.nan) for figure in figures()}
    rows["status"] = np.full(len(values), OK, dtype=object)
    if stable.any():
        found, told = together.figures(cars[stable], threads)
        for name, column in found.items():
            rows[name][stable] = column
        rows["status"][stable] = np.where(told == "", OK, told)
    if not stable.all():
        # There is no such car, or it does not take the step: alone, it says why.
        alone = _one_by_one(vehicle, design, values[~stable], excitation, threads)
        for name, column in alone.items():
            rows[name][~stable] = column
    return rows


def _one_by_one(
    vehicle: Vehicle, design: Design, values: NDArray, excitation: Excitation, threads: int
) -> Block:
    """The same of cars that are not all driven alike."""
    status = np.full(len(values), OK, dtype=object)
    cars = []
    for k, row in enumerate(values):
        try:
            cars.append(_car(vehicle, design, row))
        except RideError as error:
            status[k] = reason(error)
    possible = status == OK
    found = figures_of(cars, excitation, threads=threads)
    rows: Block = {}
    for figure in figures():
        rows[figure.name] = np.full(len(values), np.nan)
        rows[figure.name][possible] = found[figure.name]
    status[possible] = found["status"]
    return rows | {"status": status}


def _car(vehicle: Vehicle, design: Design, values: NDArray) -> Vehicle:
    return vehicle.with_values(dict(zip(design.names, values.tolist(), strict=True)))
