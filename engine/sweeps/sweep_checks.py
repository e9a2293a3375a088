"""What a sweep is refused for before its first car runs."""

import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from ..equilibrium import static_loads
from ..errors import SimulationDiverged, SweepError, VehicleError
from ..simulation.excitation import Excitation
from ..simulation.integration import cores
from ..simulation.stability import is_stable, largest_stable_step, too_long
from ..vehicle import Vehicle
from .designs import Design

Array = NDArray[np.float64]

MOST_CARS = 10**8
"""Most cars of one sweep."""

MOST_CORNERED = 8
"""Most parameters of which every corner of the box is looked at: 256 cars, a second."""


def threads_of(asked: int | None) -> int:
    """The threads to work with: what is asked for, else one a core; SweepError beyond the cores."""
    most = cores()
    if asked is None:
        return most
    if not 1 <= asked <= most:
        raise SweepError(
            f"{asked} threads are asked for, but ridetune has {most}"
            f" {'core' if most == 1 else 'cores'} here; take 1 to {most}."
        )
    return asked


def check_sweep(vehicle: Vehicle, design: Design, excitation: Excitation, threads: int) -> None:
    """Raise what is wrong with a sweep as a whole; a single car may still fail.

    ParameterError for a number that the vehicle does not have, SweepError for too many cars,
    SimulationError for a step too long for a car in a corner of the design's box or any other
    outside what is accepted, MeasurementError for a recording that cannot drive a car.
    """
    for name in design.names:
        vehicle.value(name)
    excitation = stepped_alike(vehicle, design, excitation)
    middle = _car_at(vehicle, design, 0.5 * (design.low + design.high)) or vehicle
    _check_step(vehicle, design, excitation, excitation.longest_step(middle))
    _run(middle, excitation)
    if design.cars > MOST_CARS:
        began = time.perf_counter()
        _run(middle, excitation)
        seconds = time.perf_counter() - began
        raise SweepError(
            f"{design.cars:.3g} cars are asked for, a sweep takes at most {MOST_CARS:.0e}; at"
            f" {seconds:.2g} s a car they would take {_span(design.cars * seconds / threads)};"
            " take fewer."
        )


def stepped_alike(vehicle: Vehicle, design: Design, excitation: Excitation) -> Excitation:
    """The excitation with one step for all cars of a design."""
    return excitation.for_cars(typical_cars(vehicle, design))


def typical_cars(vehicle: Vehicle, design: Design) -> list[Vehicle]:
    """The car in the middle of the design's box, and those with one parameter at either end.

    The vehicle itself stands for the middle where there is no such car.
    """
    middle = 0.5 * (design.low + design.high)
    trials = [middle]
    for k in range(middle.size):
        trials += [
            np.where(np.arange(middle.size) == k, end[k], middle)
            for end in (design.low, design.high)
        ]
    first, *others = (_car_at(vehicle, design, values) for values in trials)
    return [first or vehicle, *(car for car in others if car is not None)]


def _run(car: Vehicle, excitation: Excitation) -> None:
    """Let one car go through it all, so that what is wrong with that is told at once."""
    with suppress(SimulationDiverged):
        excitation.simulate(car)


def _span(seconds: float) -> str:
    """A time as a person says it, without an exponent where one can read it."""
    units = (("years", 3.156e7), ("days", 86400.0), ("hours", 3600.0), ("s", 1.0))
    unit, size = next((one for one in units if seconds > 2.0 * one[1]), units[-1])
    count = seconds / size
    return f"{count:.0f} {unit}" if 10.0 <= count < 1e5 else f"{count:.2g} {unit}"


def _check_step(vehicle: Vehicle, design: Design, excitation: Excitation, step: float) -> None:
    """Refuse a step too long for the car of the design's box whose motion is the fastest.

    A motion gets faster with every stiffness, damping and lever and slower with every mass, so the
    fastest car is in a corner. All corners of a box of many parameters would be too many cars; as
    one motion sets the limit, it is found from the middle by moving one parameter after the other
    to its worse end, twice over.
    """

    def motions(values: Array) -> NDArray[np.complex128] | None:
        car = _car_at(vehicle, design, values)
        return None if car is None else excitation.eigenvalues(car)

    def limit(values: Array) -> float:
        found = motions(values)
        return np.inf if found is None else largest_stable_step(found)

    few = len(design.names) <= MOST_CORNERED
    fastest = min(_corners(design) if few else [_fast_corner(design, limit)], key=limit)
    found = motions(fastest)
    if found is None or is_stable(step, found):
        return
    where = ", ".join(
        f"{name} = {value:g}" for name, value in zip(design.names, fastest, strict=True)
    )
    raise too_long(step, found, f"the sweep's car with {where}", "sweep less far in that corner")


def _corners(design: Design) -> Iterator[Array]:
    """All corners of the design's box."""
    ends = [sorted({low, high}) for low, high in zip(design.low, design.high, strict=True)]
    return (np.array(corner) for corner in itertools.product(*ends))


def _fast_corner(design: Design, limit: Callable[[Array], float]) -> Array:
    """The corner that has the least limit, as far as parameters one by one lead there."""
    values = 0.5 * (design.low + design.high)
    for _ in range(2):
        for k, ends in enumerate(zip(design.low, design.high, strict=True)):
            trials = [np.where(np.arange(values.size) == k, end, values) for end in ends]
            values = min(trials, key=limit)
    return values


def _car_at(vehicle: Vehicle, design: Design, values: Array) -> Vehicle | None:
    """The car with some values of the parameters, or None if there can be none."""
    try:
        car = vehicle.with_values(dict(zip(design.names, values.tolist(), strict=True)))
        static_loads(car)
    except VehicleError:
        return None
    return car
