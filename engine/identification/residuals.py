"""Residuals of an identification problem and their derivatives.

In the optimiser's variables (`variables`) the narrow valley along which a bar's effect K_tor / d^2
stays the same, curved in (K_tor, d), is straight in their logarithms. Over all runs and compared
channels

    r(x) = (sensed(model(x)) - measured) / noise,

where sensed is what the sensors read of the model (`sensing`), and J = dr/dx by differences of
second order from ONE batch of 2 n perturbed cars a run:

    r'(x) = (r(x + a) b^2 - r(x + b) a^2 - r(x) (b^2 - a^2)) / (a b (b - a)),

with a, b = +h, -h, or both to the same side where a bound is nearer than h. h = 1e-4: the error of
the formula is of order h^2 = 1e-8 of J, that of rounding (1e-16 m in z against a noise of
0.5 mm) about 1e-13 / h = 1e-9. What belongs to the sensor of an output has its derivative in closed
form, without further simulations:

    gain: sign model(t - delay),    bias: 1,    delay: -sign gain model'(t - delay),

each behind the output filter. Sensors of inputs change what drives the model; they are taken by
differences, each with a car of its own.

A car that leaves the model's range, or is too stiff for the step, gives FAILED_TRIAL in every
residual: finite, so that the trust region shrinks and the search goes on.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..channels import INPUT_CHANNELS, OUTPUT_CHANNELS
from ..filters import in_band
from ..simulation.car_rows import car_row
from ..simulation.comparison import fit_percent
from ..simulation.rims import RimsInputs
from ..simulation.stability import check_rims_step
from .batches import Batches, Simulate
from .condensed import triangle
from .problem import Problem
from .sensing import IDEAL, driven, reading_slope, sensed
from .uncertainty import Information, RunResiduals

Array = NDArray[np.float64]
Histories = Mapping[str, Array]
"""By run, of z, pitch and roll: (samples, 3), or (cars, samples, 3)."""

DIFFERENCE = 1e-4
"""Step h of the differences of x."""

OFF_BOUNDS = 1e-3
"""A search begins at least this share of the range away from a bound: a start on it leaves the
trust region no room, and the search ends where it began."""

QUICK_DIFFERENCE = 1e-6
"""Step of the differences of first order of x, whose error is of order h + 1e-13 / h."""

LEAST_WEIGHT = 1e-3
"""Mean weight of a channel from which on the errors follow it; below, nearly all of its samples
lie where the loss has flattened out."""

FAILED_TRIAL = 1e8
"""Residual of a failed car, in units of the noise."""


def check_start(problem: Problem) -> None:
    """Raise SimulationError for a step too long for the car at the start values."""
    car = car_row(problem.vehicle)
    for seen in problem.runs:
        check_rims_step(car, seen.inputs.step)


@dataclass(frozen=True, slots=True)
class Block:
    """One run's channel in the residual vector.

    time : (samples,) s
    place : where in the vector
    measured : (samples,) SI
    noise : standard deviation, SI
    """

    run: str
    channel: str
    time: Array
    place: slice
    measured: Array
    noise: float


class Residuals:
    """Residual vector and Jacobian of a problem, with a count of the simulations behind them.

    simulate : the rims mode for a batch of cars
    cancelled : polled all the while; true raises Cancelled
    Raises what `check_start` does.
    """

    def __init__(
        self, problem: Problem, simulate: Simulate, cancelled: Callable[[], bool] | None = None
    ):
        check_start(problem)
        self.problem = problem
        self.lower, self.upper = np.array([one.ends for one in problem.variables]).T
        self._batches = Batches(simulate, cancelled)
        self._last: tuple[Array, Array, Histories] | None = None
        self._quick: tuple[Array, Array] | None = None
        at_sensors = list(enumerate(problem.fitted, start=len(problem.free)))
        self._driving = [k for k, one in at_sensors if one.channel in INPUT_CHANNELS]
        self._closed = [(k, one) for k, one in at_sensors if one.channel in OUTPUT_CHANNELS]
        self._simulated = [*range(len(problem.free)), *self._driving]
        places = {one.name: place for place, one in enumerate(problem.free)}
        self._priors = [(one, places[one.name]) for one in problem.priors]

    @property
    def simulations(self) -> int:
        """How often a car was simulated through a run."""
        return self._batches.simulations

    @property
    def starts_between(self) -> tuple[Array, Array]:
        """Between what a search may begin, each (n,)."""
        room = OFF_BOUNDS * (self.upper - self.lower)
        return self.lower + room, self.upper - room

    def of(self, problem: Problem) -> "Residuals":
        """Those of another problem with the same model, under the same watch."""
        return Residuals(problem, self._batches.simulate, self._batches.cancelled)

    def blocks(self) -> list[Block]:
        """The blocks of the residual vector, in order."""
        found, begin = [], 0
        for seen in self.problem.runs:
            for channel, measured in seen.measured.items():
                place = slice(begin, begin + len(measured))
                time, noise = seen.inputs.time, seen.noise[channel]
                found.append(Block(seen.name, channel, time, place, measured, noise))
                begin += len(measured)
        return found

    def of_runs(self, r: Array, slopes: Array) -> list[RunResiduals]:
        """What the errors follow from, run by run: residuals and Jacobian, of all blocks above each
        other.

        Of each channel these are the scores psi and the slopes, by the root of the mean w (`loss`),
        so that J^T J is the cost's mean second derivative and J^T r holds the scores; with a linear
        loss r and dr/dx themselves.
        """
        psi, w = self.problem.loss.scores(r)
        found, begin = [], 0
        for seen in self.problem.runs:
            channels, samples = len(seen.measured), len(seen.inputs.time)
            place = slice(begin, begin + channels * samples)
            time = seen.inputs.time
            mean = np.mean(w[place].reshape(channels, samples), axis=1)
            root = np.sqrt(np.maximum(mean, LEAST_WEIGHT))[:, np.newaxis]
            found.append(
                RunResiduals(
                    psi[place].reshape(channels, samples) / root,
                    slopes[place].reshape(channels, samples, -1) * root[:, :, np.newaxis],
                    float(time[-1] - time[0]) / (samples - 1),
                    root[:, 0] ** 2,
                )
            )
            begin = place.stop
        return found

    def of_priors(self) -> list[Information]:
        """What each prior says: its error is what it states, so that its scatter is its J^T J."""
        return [
            Information(
                root=triangle(row[np.newaxis]),
                scatters=(np.outer(row, row),),
                samples=1.0,
                freedoms=(np.inf,),
            )
            for row in self.prior_slopes()
        ]

    def model(self, x: Array) -> dict[str, dict[str, Array]]:
        """The model as the sensors read it, by run and channel; not a number where it fails."""
        r = self.vector(x)
        r = np.where(r == FAILED_TRIAL, np.nan, r)
        histories: dict[str, dict[str, Array]] = {}
        for block in self.blocks():
            history = block.measured + block.noise * r[block.place]
            histories.setdefault(block.run, {})[block.channel] = history
        return histories

    def vector(self, x: Array) -> Array:
        """r(x), (samples of all blocks,)."""
        if self._last is None or not np.array_equal(self._last[0], x):
            rows, histories = self._batch([x])
            r = np.where(np.isfinite(rows[0]), rows[0], FAILED_TRIAL)
            self._last = x.copy(), r, histories
        return self._last[1]

    def quick(self, x: Array) -> tuple[Array, Array]:
        """r(x) and dr/dx with an error of 1e-6, from ONE batch of n + 1 cars: for the way to a
        minimum, where both are asked for at nearly every point.
        """
        if self._quick is None or not np.array_equal(self._quick[0], x):
            moved = self._simulated
            step = np.where(x + QUICK_DIFFERENCE <= self.upper, 1.0, -1.0) * QUICK_DIFFERENCE
            rows, histories = self._batch([x, *(x + np.diag(step)[moved])])
            centre = np.where(np.isfinite(rows[0]), rows[0], FAILED_TRIAL)
            columns = np.zeros((len(centre), len(x)))
            columns[:, moved] = ((rows[1:] - centre) / step[moved, np.newaxis]).T
            self._last = x.copy(), centre, histories
            self._add_closed(columns, x, histories)
            self._quick = x.copy(), np.nan_to_num(columns)
        return self.vector(x), self._quick[1]

    def costs(self, trials: Sequence[Array]) -> Array:
        """The cost at each of many points, infinite where the car fails."""
        return self.costs_of_runs(trials) + np.array([self._cost_of_priors(x) for x in trials])

    def costs_of_runs(self, trials: Sequence[Array]) -> Array:
        """The same without the priors."""
        rows, _ = self._batch(trials)
        return np.nan_to_num(self.problem.loss.costs(rows), nan=np.inf)

    def cost(self, x: Array, r: Array) -> float:
        """Half the sum of the residuals' squares as the loss counts them, and of the priors'."""
        return self.cost_of_runs(r) + self._cost_of_priors(x)

    def cost_of_runs(self, r: Array) -> float:
        """The same without the priors; a failed car is no outlier and costs the squares."""
        failed = np.any(r == FAILED_TRIAL)
        return 0.5 * float(r @ r) if failed else float(self.problem.loss.costs(r))

    def _cost_of_priors(self, x: Array) -> float:
        return 0.5 * float(np.sum(self.prior_rows(x) ** 2))

    def prior_rows(self, x: Array) -> Array:
        """The priors' residuals, (priors,)."""
        free = self.problem.free
        return np.array([one.residual(free[k], float(x[k])) for one, k in self._priors])

    def prior_slopes(self) -> Array:
        """Their derivative, (priors, parameters), the same everywhere."""
        slopes = np.zeros((len(self._priors), len(self.lower)))
        for row, (one, k) in enumerate(self._priors):
            slopes[row, k] = one.weight(self.problem.free[k])
        return slopes

    def reweighted(self, x: Array, r: Array) -> tuple[Array, Array]:
        """Runs and priors in one least-squares problem with the cost's derivatives: its residuals,
        and factors of the rows of J (`reweighted_slopes`).
        """
        failed = np.any(r == FAILED_TRIAL)
        rows, root = (r, np.ones_like(r)) if failed else self.problem.loss.reweighted(r)
        return np.concatenate([rows, self.prior_rows(x)]), root

    def reweighted_slopes(self, slopes: Array, root: Array) -> Array:
        """The Jacobian of that problem, out of that of the runs (samples, parameters)."""
        return np.concatenate([slopes * root[:, np.newaxis], self.prior_slopes()])

    def percents(self, r: Array) -> dict[str, dict[str, float]]:
        """Fit percent by run and channel, of residuals r."""
        found: dict[str, dict[str, float]] = {}
        for block in self.blocks():
            error = block.noise * r[block.place]
            percent = fit_percent(block.measured, block.measured + error)
            found.setdefault(block.run, {})[block.channel] = percent
        return found

    def scatter(self) -> float:
        """The runs' cost of a model that stays at each channel's mean."""
        return sum(
            float(self.problem.loss.costs((block.measured - np.mean(block.measured)) / block.noise))
            for block in self.blocks()
        )

    def jacobian(self, x: Array) -> Array:
        """dr/dx, (samples of all blocks, parameters).

        Where one of the two cars of a parameter fails, the other serves with a difference of first
        order; where both fail the column is zero, which makes the parameter undetermined.
        """
        centre = self.vector(x)
        first = np.where(x + DIFFERENCE <= self.upper, DIFFERENCE, -2.0 * DIFFERENCE)
        second = np.where(x - DIFFERENCE >= self.lower, -DIFFERENCE, 2.0 * DIFFERENCE)
        moved, n = self._simulated, len(self._simulated)
        trials = x + np.concatenate([np.diag(first)[moved], np.diag(second)[moved]])
        rows, _ = self._batch(list(trials))
        columns = np.zeros((len(centre), len(x)))
        for car, k in enumerate(moved):
            a, b = first[k], second[k]
            fine = [bool(np.isfinite(rows[one]).all()) for one in (car, n + car)]
            if all(fine):
                weighted = rows[car] * b**2 - rows[n + car] * a**2 - centre * (b**2 - a**2)
                columns[:, k] = weighted / (a * b * (b - a))
            elif any(fine):
                row, step = (rows[car], a) if fine[0] else (rows[n + car], b)
                columns[:, k] = (row - centre) / step
        if self._last is not None:
            self._add_closed(columns, x, self._last[2])
        return columns

    def _add_closed(self, columns: Array, x: Array, histories: Histories) -> None:
        """Fill in the columns of what belongs to the outputs' sensors, from the model at x."""
        for k, one in self._closed:
            slope = one.slope(float(x[k]))
            for block in self.blocks():
                if block.channel == one.channel and one.run in (None, block.run) and histories:
                    model = histories[block.run][:, OUTPUT_CHANNELS.index(block.channel)]
                    reading = self.problem.reading(x, block.channel, block.run)
                    change = reading_slope(block.time, model, reading, one.quantity)
                    filtered = self._filtered(block.time, change)
                    columns[block.place, k] = slope * filtered / block.noise

    def _batch(self, trials: Sequence[Array]) -> tuple[Array, Histories]:
        """Residuals of many cars, (cars, samples of all blocks), and the model's histories of the
        first; a failed car is not a number, and has none.
        """
        blocks = self.blocks()
        rows = np.full((len(trials), blocks[-1].place.stop), np.nan)
        of_first: Histories = {}
        for alike in self._alike(trials):
            cars = self.problem.cars_at([trials[k] for k in alike])
            possible = alike[np.isfinite(cars).all(axis=1)]
            if not len(possible):
                continue
            cars = cars[np.isfinite(cars).all(axis=1)]
            inputs = self._inputs(trials[possible[0]])
            simulated = self._batches.histories(cars, inputs, self.problem.traction)
            names = (seen.name for seen in self.problem.runs)
            histories = dict(zip(names, simulated, strict=True))
            for block in blocks:
                model = histories[block.run][:, :, OUTPUT_CHANNELS.index(block.channel)]
                read = self._read(block, model, [trials[k] for k in possible])
                rows[possible, block.place] = (read - block.measured) / block.noise
            if possible[0] == 0 and np.isfinite(rows[0]).all():
                of_first = {name: of_run[0] for name, of_run in histories.items()}
        rows[~np.isfinite(rows).all(axis=1)] = np.nan
        return rows, of_first

    def _alike(self, trials: Sequence[Array]) -> list[NDArray[np.int64]]:
        """Places of the trials that are driven by the same inputs."""
        places: dict[bytes, list[int]] = {}
        for k, x in enumerate(trials):
            places.setdefault(x[self._driving].tobytes(), []).append(k)
        return [np.array(alike) for alike in places.values()]

    def _inputs(self, x: Array) -> list[RimsInputs]:
        """What drives the model in each run, with the inputs' sensors at x."""
        if not self._driving:
            return [seen.inputs for seen in self.problem.runs]
        known = self.problem.sensors.readings()
        return [
            driven(
                seen.inputs,
                {
                    name: self.problem.reading(x, name, seen.name).beyond(known.get(name, IDEAL))
                    for name in INPUT_CHANNELS
                },
            )
            for seen in self.problem.runs
        ]

    def _read(self, block: Block, model: Array, trials: Sequence[Array]) -> Array:
        """What the sensors of many cars read of a channel (cars, samples), filtered."""
        fine = np.isfinite(model).all(axis=1, keepdims=True)
        histories = np.where(fine, model, 0.0)
        if block.channel in self.problem.sensors:
            readings = [self.problem.reading(x, block.channel, block.run) for x in trials]
            histories = sensed(block.time, histories, readings)
        return np.where(fine, self._filtered(block.time, histories), np.nan)

    def _filtered(self, time: Array, values: Array) -> Array:
        """Histories (..., samples) through the output filter."""
        return in_band(time, values.T, self.problem.settings.output_band).T
