"""What the errors of a fit leave open in a prediction: 95 % bands of curves and figures.

With x the search's variables of what was free, C their covariance and q the quantile of the fit
(`Uncertainty`), a curve y(t; x) of any simulation has the band

    y +- q sqrt(Y C Y^T),    Y = dy/dx,

linearised, by differences of 2 n cars. A curve that moves along a direction which the runs do not
determine has none, nor has a figure that counts samples, which small steps leave as it is. By
sampling, cars are drawn from the covariance, scaled from the normal distribution's quantile to q,
as far as the bounds admit them, and along unknown directions evenly; the band lies between the
2.5th and the 97.5th percentile of their curves. Figures (`metrics`) go the same ways.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from ..errors import ProblemError, RideError, SimulationError
from ..parameters import parameter
from ..run import Run
from ..simulation.integration import cores
from ..simulation.metrics import metrics
from ..simulation.simulate import Model, Simulation
from ..vehicle import Vehicle
from .kept_fit import KeptFit
from .problem import FreeParameter
from .uncertainty import CONFIDENCE, NAMED, PART_OF_DIRECTION, Uncertainty

Array = NDArray[np.float64]
Method = Literal["linear", "sampled"]

CARS = 64
"""Cars that are drawn unless told."""

FEWEST_CARS = 39
"""Cars between whose outermost 95 % lie on the average."""

DRAWS = 100
"""Times that a car is drawn until it lies between the bounds."""

STEP = 1e-4
"""Of the differences of x: their error is of its square, that of rounding 1e-12 over it."""


class Ride(Protocol):
    """What cars go through, such as an `Excitation`."""

    def for_cars(self, cars: Sequence[Vehicle]) -> Self:
        """The same with one step for some cars."""
        ...

    def simulate(self, vehicle: Vehicle, model: Model) -> Simulation:
        """One car through all of it."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Bands:
    """95 % bands around one simulated car.

    lower, upper : runs with the channels of the simulation; not a number where a channel is open
    figures : (lower, upper) by the names of `metrics`, not a number where open; linearised,
        without those that count samples
    warnings : which are open and by which parameters, and how many cars failed
    """

    lower: Run
    upper: Run
    figures: Mapping[str, tuple[float, float]]
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Curves:
    """Everything predicted of some cars, one after the other in one row a car.

    names : of the figures;  counted : of those that count samples
    rows (cars, values) : not a number where a car failed
    """

    run: Run
    names: tuple[str, ...]
    counted: tuple[str, ...]
    rows: Array


def bands(
    fit: KeptFit,
    vehicle: Vehicle,
    ride: Ride,
    *,
    method: Method = "linear",
    cars: int = CARS,
    seed: int = 0,
    model: Model = "8dof",
) -> Bands:
    """Bands of a car that goes through a ride.

    vehicle : around which; the fit's, or one that differs from it in what was not free
    cars, seed : of the sampling
    Raises what the simulation of the vehicle raises, and ProblemError for a vehicle outside the
    fit's bounds.
    """
    x = _variables(fit.free, vehicle)

    def predicted(trials: Sequence[Array]) -> _Curves:
        driven = [_vehicle_at(fit.free, vehicle, trial) for trial in trials]
        return _curves(driven, ride.for_cars([vehicle]), model)

    if method == "linear":
        return _linear(fit.free, x, fit.errors, predicted)
    return _sampled(fit.free, x, fit.errors, predicted, cars, seed)


def _linear(
    free: Sequence[FreeParameter],
    x: Array,
    errors: Uncertainty,
    predicted: Callable[[Sequence[Array]], _Curves],
) -> Bands:
    lower, upper = _bounds(free)
    ahead, behind = np.minimum(x + STEP, upper) - x, np.maximum(x - STEP, lower) - x
    steps = np.vstack([np.zeros_like(x), np.diag(ahead), np.diag(behind)])
    found = predicted(list(x + steps))
    n, middle = len(x), found.rows[0]
    first, second = found.rows[1 : n + 1], found.rows[n + 1 :]
    # A car that fails leaves the difference on the other side.
    lost_first, lost_second = _failed(first), _failed(second)
    first = np.where(lost_first[:, np.newaxis], middle, first)
    second = np.where(lost_second[:, np.newaxis], middle, second)
    span = np.where(lost_first, 0.0, ahead) - np.where(lost_second, 0.0, behind)
    if not np.all(span > 0.0):
        name = free[int(np.argmin(span))].name
        raise SimulationError(
            f"Next to the fitted value of {name} no car comes through, so no band follows; "
            "sample it, or simulate something gentler."
        )
    slopes = (first - second) / span[:, np.newaxis]
    squares = np.einsum("ks,ks->s", slopes, errors.covariance @ slopes)
    half_width = errors.quantile * np.sqrt(np.maximum(squares, 0.0))
    places, warnings = _places(found), []
    for direction in errors.unknown:
        along = np.abs(direction @ slopes)
        size = np.linalg.norm(slopes, axis=0)
        opened = [
            name
            for name, place in places.items()
            if np.max(along[place]) > PART_OF_DIRECTION * np.max(size[place])
        ]
        for name in opened:
            half_width[places[name]] = np.nan
        if opened:
            warnings.append(_open(free, direction, opened))
    told = [name for name in found.names if name not in found.counted]
    return _bands(found, middle - half_width, middle + half_width, told, warnings)


def _sampled(
    free: Sequence[FreeParameter],
    x: Array,
    errors: Uncertainty,
    predicted: Callable[[Sequence[Array]], _Curves],
    cars: int,
    seed: int,
) -> Bands:
    if cars < FEWEST_CARS:
        raise ProblemError(f"{cars} cars are too few for a band; draw {FEWEST_CARS} at least.")
    found = predicted([x, *drawn(free, x, errors, cars, seed)])
    sound = ~_failed(found.rows[1:])
    if sound.sum() < FEWEST_CARS:
        raise SimulationError(
            f"Of {cars} cars within the fit's errors {int(sound.sum())} come through, too few for "
            "a band; fit with more runs, or simulate something gentler."
        )
    lower, upper = percentiles(found.rows[1:][sound])
    failed = cars - int(sound.sum())
    warnings = []
    if failed:
        warnings.append(
            f"{failed} of {cars} cars within the fit's errors do not come through; the bands are "
            "those of the others."
        )
    return _bands(found, lower, upper, found.names, warnings)


def percentiles(rows: Array) -> Array:
    """The 2.5th and the 97.5th of cars' curves (cars, values): (2, values).

    The k-th of n sorted values has k / (n + 1) of its distribution below it on the average
    (Weibull), whatever the distribution is.
    """
    tail = 50.0 * (1.0 - CONFIDENCE)
    found: Array = np.percentile(rows, (tail, 100.0 - tail), axis=0, method="weibull")
    return found


def _failed(rows: Array) -> NDArray[np.bool_]:
    """Which cars did not come through, (cars,)."""
    return np.asarray(np.isnan(rows).all(axis=1), dtype=np.bool_)


def drawn(
    free: Sequence[FreeParameter], x: Array, errors: Uncertainty, cars: int, seed: int
) -> Array:
    """Variables (cars, n) of cars within a fit's errors and between the bounds.

    A car beyond a bound is drawn anew: moved to the bound in one parameter alone it would leave
    what the runs hold together.
    """
    random = np.random.default_rng(seed)
    lower, upper = _bounds(free)
    squares, axes = np.linalg.eigh(errors.covariance)
    scale = errors.quantile / float(norm.ppf(0.5 + CONFIDENCE / 2.0))
    deviations = scale * np.sqrt(np.maximum(squares, 0.0))
    found = x + (random.standard_normal((cars, len(x))) * deviations) @ axes.T
    for _ in range(DRAWS):
        beyond = np.any((found < lower) | (found > upper), axis=1)
        if not beyond.any():
            break
        normal = random.standard_normal((int(beyond.sum()), len(x)))
        found[beyond] = x + (normal * deviations) @ axes.T
    found = _back_between(x, found, lower, upper)
    for direction in errors.unknown:
        # From where along the direction to where a car stays between the bounds.
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([(lower - found) / direction, (upper - found) / direction])
        ends = np.where(np.abs(direction) > PART_OF_DIRECTION, ends, [[[-np.inf]], [[np.inf]]])
        begin = np.max(np.min(ends, axis=0), axis=1)
        end = np.min(np.max(ends, axis=0), axis=1)
        found += np.outer(random.uniform(begin, end), direction)
    return np.clip(found, lower, upper)


def _back_between(x: Array, cars: Array, lower: Array, upper: Array) -> Array:
    """Cars (cars, n), those beyond a bound moved back to it on the straight line to x."""
    away = cars - x
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(away > 0.0, upper - x, lower - x) / away
    share = np.min(np.where(away == 0.0, 1.0, room), axis=1, initial=1.0)
    return x + share[:, np.newaxis] * away


def _variables(free: Sequence[FreeParameter], vehicle: Vehicle) -> Array:
    for one in free:
        value = vehicle.value(one.name)
        if value is None or not one.lower <= value <= one.upper:
            raise ProblemError(
                f"{one.name} is {value} and was fitted between {one.lower:g} and {one.upper:g}, so "
                "the fit's errors say nothing of it; take the fitted car, or fit anew."
            )
    return np.array([one.variable(vehicle.value(one.name)) for one in free])


def _bounds(free: Sequence[FreeParameter]) -> tuple[Array, Array]:
    lower, upper = np.array([one.ends for one in free]).T
    return lower, upper


def _vehicle_at(free: Sequence[FreeParameter], vehicle: Vehicle, x: Array) -> Vehicle | None:
    """The car at some variables, or None where there is none such."""
    values = {one.name: one.value(float(v)) for one, v in zip(free, x, strict=True)}
    try:
        return vehicle.with_values(values)
    except RideError:
        return None


def _curves(cars: Sequence[Vehicle | None], ride: Ride, model: Model) -> _Curves:
    """Curves and figures of some cars; the first must come through."""

    def simulated(car: Vehicle | None) -> Run | None:
        try:
            return None if car is None else ride.simulate(car, model).run
        except SimulationError:
            if car is cars[0]:
                raise
            return None

    with ThreadPoolExecutor(cores()) as pool:
        runs = pool.map(simulated, cars)
        nominal = next(runs)
        assert nominal is not None  # it has raised otherwise
        figures = metrics(nominal)
        names = tuple(one.name for one in figures)
        counted = tuple(one.name for one in figures if one.counted)
        rows = [_row(nominal, nominal, names), *(_row(run, nominal, names) for run in runs)]
    return _Curves(nominal, names, counted, np.array(rows))


def _row(run: Run | None, nominal: Run, names: Sequence[str]) -> Array:
    """All channels, then the figures; a figure that the car lacks is not a number."""
    size = len(nominal.columns) * nominal.time.size
    if run is None:
        return np.full(size + len(names), np.nan)
    values = {one.name: one.value for one in metrics(run)}
    figures = [values.get(name, np.nan) for name in names]
    return np.concatenate([*(run[name] for name in nominal.columns), figures])


def _places(found: _Curves) -> dict[str, slice]:
    """Where in a row each channel and each figure is."""
    samples = found.run.time.size
    channels = {
        name: slice(k * samples, (k + 1) * samples) for k, name in enumerate(found.run.columns)
    }
    first = len(channels) * samples
    return channels | {name: slice(first + k, first + k + 1) for k, name in enumerate(found.names)}


def _bands(
    found: _Curves, lower: Array, upper: Array, told: Sequence[str], warnings: Sequence[str]
) -> Bands:
    run, places = found.run, _places(found)
    low, high = (
        Run(run.name, run.time, {name: side[places[name]] for name in run.columns})
        for side in (lower, upper)
    )
    figures = {
        name: (float(lower[place]), float(upper[place]))
        for name in told
        for place in [places[name].start]
    }
    return Bands(low, high, figures, tuple(warnings))


def _open(free: Sequence[FreeParameter], direction: Array, opened: Sequence[str]) -> str:
    named = [
        parameter(one.name).symbol
        for one, part in zip(free, direction, strict=True)
        if abs(part) >= NAMED
    ]
    return (
        f"The runs of the fit do not determine {', '.join(named)}, on which "
        f"{len(opened)} curves and figures depend ({', '.join(opened[:3])}"
        f"{', ...' if opened[3:] else ''}): they have no band."
    )
