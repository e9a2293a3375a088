"""The detailed car as what drives through a campaign."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ..channels import CHANNELS, RAW_CHANNELS
from ..frames import CORNERS
from ..json_record import record_to_json
from ..manoeuvre import Manoeuvre
from ..plant import Asked, Driven, Told
from ..simulation.output_channels import DEFAULT_POINTS, Points
from ..vehicle import Vehicle
from .concept import known_vehicle
from .driving import STEP, DetailedRunDiverged, drive
from .histories import AT_WHEELS
from .records import DetailedCar

AT_CORNERS = ("wheel.{}.z", "suspension.{}.travel", *AT_WHEELS)


@dataclass(frozen=True)
class DetailedPlant:
    """A multibody car in place of the test car; a simulated second costs seconds.

    vehicle : what is known of it, whose CG is the measured point
    """

    car: DetailedCar
    vehicle: Vehicle
    points: Points = field(default_factory=lambda: dict(DEFAULT_POINTS))
    name: str = "detailed"
    step: float = STEP
    long: bool = True

    @classmethod
    def of(cls, car: DetailedCar) -> "DetailedPlant":
        """The car with what is known of it; SimulationError as `known_vehicle`."""
        return cls(car, known_vehicle(car))

    @property
    def channels(self) -> Collection[str]:
        """Motion of the chassis, and what there is at each corner."""
        corners = {name.format(corner) for name in AT_CORNERS for corner in CORNERS}
        chassis = {name for name in CHANNELS if name.startswith("chassis.")}
        return corners | chassis - RAW_CHANNELS

    def with_points(self, points: Points) -> "DetailedPlant":
        """The same car with accelerometers at further points."""
        return replace(self, points={**self.points, **points})

    def drive(
        self, manoeuvre: Manoeuvre, *, sample_step: float, progress: Told, cancelled: Asked
    ) -> Driven:
        """One drive in steps of `step`; what came before a divergence is kept."""
        try:
            run = drive(
                self.car,
                manoeuvre,
                step=self.step,
                sample_step=sample_step,
                points=self.points,
                progress=lambda share: progress(share * manoeuvre.duration),
                cancelled=cancelled,
            )
        except DetailedRunDiverged as error:
            return Driven(error.partial, str(error))
        progress(manoeuvre.duration)
        return Driven(run)

    def truth(self) -> Mapping[str, Any]:
        """The car's whole data."""
        return {"car": record_to_json(self.car)}
