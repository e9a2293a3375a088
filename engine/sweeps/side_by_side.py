"""Many cars through the same at once: one batch of the kernels, of which only figures are kept.

It takes that what drives the cars is the same for all of them: torques, road, posts or rims.
Springs, dampers, bars, pivots and tyres change nothing of it; a mass may, because torques follow
from it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..run import Run
from ..simulation.car_rows import car_rows
from ..simulation.excitation import Excitation, RimsExcitation
from ..simulation.integration import Tallies, free_tallies, rims_tallies
from ..simulation.output_channels import DEFAULT_POINTS
from ..simulation.reductions import Reduction, figures, reduction
from ..simulation.rims import RimsInputs, for_car
from ..simulation.stability import stable_on_rims, stable_on_road
from ..simulation.stepping import FreeInputs, prepare_free
from ..vehicle import Vehicle

Array = NDArray[np.float64]

[(_POINT, _POSITION)] = DEFAULT_POINTS.items()

_RANGE = {
    False: "The simulation diverged at t = {:.3f} s.",
    True: "The simulation diverged at t = {:.3f} s: a wheel left the reach of its arm or passed the"
    " mount of its spring-damper.",
}
"""Status of a car that left the model's range, by whether its wheels did."""


@dataclass(frozen=True, eq=False)
class SideBySide:
    """A batch made ready: cars (C, CAR_ROWS) -> figures.

    time (S,) : of the samples, s
    lift_off : of the cars' rows
    """

    time: Array
    lift_off: bool
    _reduced: Reduction
    _tallies: Callable[[Array, int], Tallies]
    _stable: Callable[[Array], NDArray[np.bool_]]

    def rows(self, vehicle: Vehicle, names: Sequence[str], values: Array) -> Array:
        """Rows of cars with some values (C, parameters); NaN where there is no such car."""
        return car_rows(vehicle, names, values, self.lift_off)

    def stable(self, cars: Array) -> NDArray[np.bool_]:
        """Which cars take the step; an impossible one does not."""
        return self._stable(cars)

    def figures(self, cars: Array, threads: int) -> tuple[dict[str, Array], NDArray[np.object_]]:
        """Figures (C,) by name, and a sentence on each car that left the model's range, or ""."""
        found = self._tallies(cars, threads)
        told = np.full(len(cars), "", dtype=object)
        for car in np.flatnonzero(found.failed >= 0):
            sentence = _RANGE[bool(found.reach[car] < 0.0)]
            told[car] = sentence.format(self.time[found.failed[car]])
        values = figures(found.values, self._reduced)
        return {name: np.where(told == "", of, np.nan) for name, of in values.items()}, told


def side_by_side(excitation: Excitation, cars: Sequence[Vehicle]) -> SideBySide | None:
    """A batch for cars of which some are given, or None where what drives these is not the same.

    cars : the first one's times of squat and dive hold for all
    Raises what the simulation of the first raises.
    """
    if isinstance(excitation, RimsExcitation):
        return _on_rims(excitation, [for_car(excitation.motion, car) for car in cars])
    demands = [excitation.demand(car) for car in cars]
    step = excitation.step_of(cars)
    prepared = [prepare_free(one, step, excitation.sample_step) for one in demands]
    inputs, brake = prepared[0], demands[0].brake.values.max(axis=0)
    if not all(_same(inputs, other) for other in prepared[1:]):
        return None
    run = excitation.simulate(cars[0]).run
    reduced = reduction(run, inputs.steps, _POINT, _POSITION)
    longest = float(inputs.steps.max())
    return SideBySide(
        inputs.time,
        excitation.lift_off,
        reduced,
        lambda rows, threads: free_tallies(rows, inputs, reduced, threads),
        lambda rows: stable_on_road(rows, brake, longest),
    )


def _on_rims(excitation: RimsExcitation, prepared: Sequence[RimsInputs]) -> SideBySide | None:
    """Samples are the nodes of the integration."""
    inputs, exact = prepared[0], excitation.traction == "exact"
    if not all(np.array_equal(inputs.stage_inputs, one.stage_inputs) for one in prepared[1:]):
        return None
    a_x = np.append(inputs.stage_inputs[:, 0, 12], inputs.stage_inputs[-1, 2, 12])
    run = Run(inputs.name, inputs.node_time, {"chassis.a_x": a_x})
    reduced = reduction(run, np.diff(inputs.node_time), _POINT, _POSITION)
    return SideBySide(
        inputs.node_time,
        False,
        reduced,
        lambda rows, threads: rims_tallies(rows, inputs, exact, reduced, threads),
        lambda rows: stable_on_rims(rows, inputs.step),
    )


def _same(a: FreeInputs, b: FreeInputs) -> bool:
    """Whether two cars are driven alike."""
    if a is b:
        return True
    arrays = (
        (a.steps, b.steps),
        (a.stage_inputs, b.stage_inputs),
        (a.samples, b.samples),
        (a.road.coefficients, b.road.coefficients),
    )
    numbers = (a.road.start, a.road.spacing, a.initial_speed)
    return numbers == (b.road.start, b.road.spacing, b.initial_speed) and all(
        np.array_equal(one, other) for one, other in arrays
    )
