"""What every car of a sweep goes through: a road or a rig, or the rims of a recording."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..demand import Demand, PiecewiseLinear
from ..manoeuvre import Manoeuvre, manoeuvre_to_json
from ..roads.road import Road
from ..run import Run
from ..vehicle import Vehicle
from .car_rows import car_row
from .recorded_motion import RecordedMotion
from .rims import for_car
from .simulate import (
    SAMPLE_STEP,
    Model,
    Simulation,
    Traction,
    default_step,
    posts_demand,
    simulate_posts,
    simulate_rims,
    simulate_road,
)
from .stability import rims_eigenvalues, road_eigenvalues
from .stepping import prepare_free


@dataclass(frozen=True, slots=True)
class FreeExcitation:
    """A car driven over a road by a manoeuvre, or on a rig whose posts a manoeuvre or a recording
    moves; fields as of `simulate_road` and `simulate_posts`.
    """

    motion: Manoeuvre | Run
    road: Road | None = None
    lift_off: bool = False
    step: float | None = None
    sample_step: float = SAMPLE_STEP

    def simulate(self, vehicle: Vehicle, model: Model = "8dof") -> Simulation:
        """One car through all of it; raises what the simulations raise."""
        how: dict[str, Any] = {
            "model": model,
            "lift_off": self.lift_off,
            "step": self.step,
            "sample_step": self.sample_step,
        }
        if isinstance(self.motion, Run) or self.motion.kind == "posts":
            return simulate_posts(vehicle, self.motion, **how)
        return simulate_road(vehicle, self.motion, road=self.road, **how)

    def for_cars(self, cars: Sequence[Vehicle]) -> "FreeExcitation":
        """The same with one step for some cars, where none is told."""
        return replace(self, step=self.step_of(cars))

    def step_of(self, cars: Sequence[Vehicle]) -> float:
        """The step that some cars take together, s."""
        return default_step(*cars) if self.step is None else self.step

    def demand(self, vehicle: Vehicle) -> Demand:
        """What acts on a car from outside."""
        if isinstance(self.motion, Run):
            return posts_demand(self.motion)
        return self.motion.demand(vehicle, self.road)

    def longest_step(self, vehicle: Vehicle) -> float:
        """The longest step that a car takes, s.

        Raises SimulationError for a duration, a step or a sampling outside what is accepted.
        """
        duration = self.motion.duration
        still = PiecewiseLinear.zero(duration)
        demand = Demand(duration, 0.0, still, still, None)
        step = self.step_of([vehicle])
        return float(prepare_free(demand, step, self.sample_step).steps.max())

    def eigenvalues(self, vehicle: Vehicle) -> NDArray[np.complex128]:
        """Of a car at rest under its greatest brake torques, 1/s."""
        brake = np.zeros(4)
        if isinstance(self.motion, Manoeuvre) and self.motion.brake is not None:
            torque = self.motion.brake.wheel_torque(vehicle, self.motion.duration)
            brake = torque.values.max(axis=0)
        return road_eigenvalues(car_row(vehicle, self.lift_off)[np.newaxis], brake)[0]

    def to_json(self) -> dict[str, Any]:
        """What it is, as plain JSON data; a recording and a given road by name."""
        how = {"lift_off": self.lift_off, "step": self.step, "sample_step": self.sample_step}
        if isinstance(self.motion, Run):
            return {"mode": "posts", "recording": _recording(self.motion), **how}
        mode = {"mode": self.motion.kind, "manoeuvre": manoeuvre_to_json(self.motion)}
        return mode | ({} if self.road is None else {"road": self.road.name}) | how


@dataclass(frozen=True, slots=True)
class RimsExcitation:
    """A car that follows the wheel centres and a_x of a recording."""

    motion: RecordedMotion
    traction: Traction = "exact"

    def simulate(self, vehicle: Vehicle, model: Model = "8dof") -> Simulation:
        """One car through all of it; raises what the simulation raises."""
        return simulate_rims(vehicle, self.motion, traction=self.traction, model=model)

    def for_cars(self, cars: Sequence[Vehicle]) -> "RimsExcitation":
        """The same: the step was told when the motion was made."""
        return self

    def longest_step(self, vehicle: Vehicle) -> float:
        """The longest step that is taken, s; MeasurementError for marks outside the run."""
        return for_car(self.motion, vehicle).step

    def eigenvalues(self, vehicle: Vehicle) -> NDArray[np.complex128]:
        """Of a car on its rims at rest, 1/s."""
        return rims_eigenvalues(car_row(vehicle)[np.newaxis])[0]

    def to_json(self) -> dict[str, Any]:
        """What it is, as plain JSON data; the recording by name."""
        return {
            "mode": "rims",
            "recording": _recording(self.motion.run),
            "traction": self.traction,
            "settings": asdict(self.motion.settings),
        }


Excitation = FreeExcitation | RimsExcitation


def _recording(run: Run) -> Mapping[str, Any]:
    """What tells a recording from others."""
    return {"name": run.name, "samples": run.time.size, "duration": run.duration} | (
        {} if run.braking is None else {"braking": [list(one) for one in run.braking]}
    )
