"""What drives through a campaign in place of a test car.

A plant is anything with the attributes of `Plant`; the campaign, its sensors and files know no more
of it.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from .channels import CHANNELS, RAW_CHANNELS
from .errors import SimulationDiverged
from .manoeuvre import Manoeuvre
from .run import Run
from .simulation.output_channels import DEFAULT_POINTS, Points
from .simulation.simulate import FREE_STEP, simulate_road
from .vehicle import Vehicle
from .vehicle_file import vehicle_to_json

Told = Callable[[float], object]
"""Hears how many seconds of a manoeuvre are driven."""

Asked = Callable[[], bool]
"""Says whether to stop."""


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """The true motion of one drive.

    run : as far as the car came, None where it did not start
    failure : why it came no further, a sentence; empty where it came through
    """

    run: Run | None
    failure: str = ""


class Plant(Protocol):
    """A car to be measured; it is sent to other processes by pickle."""

    @property
    def name(self) -> str:
        """As of `ridetune campaign --plant`."""
        ...

    @property
    def vehicle(self) -> Vehicle:
        """What is known of it, with first guesses where it has no such parameters."""
        ...

    @property
    def step(self) -> float:
        """Of its simulation, s; samples come no faster."""
        ...

    @property
    def long(self) -> bool:
        """Whether a drive takes long enough for a process of its own."""
        ...

    @property
    def points(self) -> Points:
        """Chassis points with accelerometers, from the sprung mass's CG, m."""
        ...

    @property
    def channels(self) -> Collection[str]:
        """What it has on a road, apart from the points' accelerations."""
        ...

    def with_points(self, points: Points) -> "Plant":
        """The same car with accelerometers at further points."""
        ...

    def drive(
        self, manoeuvre: Manoeuvre, *, sample_step: float, progress: Told, cancelled: Asked
    ) -> Driven:
        """Drive a manoeuvre on a road; raises Cancelled soon after it is asked to stop."""
        ...

    def truth(self) -> Mapping[str, Any]:
        """What nobody but a test may know of it, as plain JSON data."""
        ...


@dataclass(frozen=True)
class ConceptPlant:
    """The concept model itself, the twin of what is identified; a drive takes milliseconds."""

    vehicle: Vehicle
    points: Points = field(default_factory=lambda: dict(DEFAULT_POINTS))
    name: str = "concept"
    step: float = FREE_STEP
    long: bool = False

    @property
    def channels(self) -> Collection[str]:
        """All fixed channels of a simulation but the posts of a rig."""
        fixed = {one for one in CHANNELS if one != "time" and not one.startswith("post.")}
        return fixed - RAW_CHANNELS

    def with_points(self, points: Points) -> "ConceptPlant":
        """The same car with accelerometers at further points."""
        return replace(self, points={**self.points, **points})

    def drive(
        self, manoeuvre: Manoeuvre, *, sample_step: float, progress: Told, cancelled: Asked
    ) -> Driven:
        """One simulation; where it diverges, a second one up to there."""
        how: dict[str, Any] = {"sample_step": sample_step, "points": self.points}
        try:
            found = Driven(simulate_road(self.vehicle, manoeuvre, **how).run)
        except SimulationDiverged as error:
            found = Driven(self._until(manoeuvre, error.time - sample_step, how), str(error))
        progress(manoeuvre.duration)
        return found

    def truth(self) -> Mapping[str, Any]:
        """The car with its twelve parameters."""
        return {"vehicle": vehicle_to_json(self.vehicle)}

    def _until(self, manoeuvre: Manoeuvre, end: float, how: Mapping[str, Any]) -> Run | None:
        """The part before a divergence, where it is long enough for a manoeuvre."""
        if end < 0.1:
            return None
        return simulate_road(self.vehicle, manoeuvre.lasting(end), **how).run
