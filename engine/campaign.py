"""A measurement campaign: a car that is known drives manoeuvres, and its sensors record.

What a recording states is what a test department would know; the truth is kept apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any
from zlib import crc32

from .errors import CampaignError, Cancelled, RideError
from .manoeuvre import ORDER, Manoeuvre, reference_manoeuvres
from .plant import Asked, ConceptPlant, Plant, Told
from .run import Run
from .sensor_file import check_sensors, noisy
from .sensors import SensorSet, measured
from .vehicle import Vehicle

TABLE_2 = ("1", "2")
"""Keys of the paper's manoeuvres."""

CAMPAIGN = (*TABLE_2, "brake-54", "bump", "constant-speed-c")
"""Keys of the manoeuvres of a campaign, unless told."""


@dataclass(frozen=True, slots=True)
class Recording:
    """What is left of one drive.

    manoeuvre : as driven
    run : what the sensors recorded, None where the car did not start
    failure : why the recording ends early, a sentence; empty where it is whole
    """

    name: str
    manoeuvre: Manoeuvre
    run: Run | None
    failure: str = ""


@dataclass(frozen=True)
class Campaign:
    """A car, its sensors and what it drives, checked; it is sent to other processes by pickle.

    manoeuvres : by the name of the recording
    streams : of the noise, by the same names
    seed : of the noise
    """

    plant: Plant
    sensors: SensorSet
    manoeuvres: Mapping[str, Manoeuvre]
    streams: Mapping[str, int]
    seed: int = 0

    @classmethod
    def plan(
        cls, plant: Plant, sensors: SensorSet, manoeuvres: Mapping[str, Manoeuvre], seed: int = 0
    ) -> "Campaign":
        """Check that the car can drive all of it and the sensors measure it.

        manoeuvres : by key
        Raises CampaignError for manoeuvres, MeasurementError for sensors, naming the place.
        """
        if not manoeuvres:
            raise CampaignError("The campaign has no manoeuvre; name one at least.")
        for key, manoeuvre in manoeuvres.items():
            if manoeuvre.kind != "road":
                raise CampaignError(
                    f"Manoeuvre {key} moves the posts of a rig, and a campaign drives on roads;"
                    " leave it out."
                )
        plant = plant.with_points(sensors.points)
        check_sensors(
            sensors,
            car=plant.name,
            step=plant.step,
            duration=min(one.duration for one in manoeuvres.values()),
            offered={*plant.channels, *(f"{p}.a_{axis}" for p in plant.points for axis in "xyz")},
        )
        return cls(
            plant,
            sensors,
            {f"manoeuvre_{key}": manoeuvre for key, manoeuvre in manoeuvres.items()},
            {f"manoeuvre_{key}": _stream(key) for key in manoeuvres},
            seed,
        )

    @property
    def seconds(self) -> float:
        """Of all manoeuvres together."""
        return sum(one.duration for one in self.manoeuvres.values())

    def record(self, name: str, progress: Told, cancelled: Asked) -> Recording:
        """Drive one manoeuvre and record it, as far as the car comes; raises Cancelled alone."""
        manoeuvre = self.manoeuvres[name]
        try:
            driven = self.plant.drive(
                manoeuvre, sample_step=self.plant.step, progress=progress, cancelled=cancelled
            )
            if driven.run is None or self.sensors.samples(driven.run.duration) < 2:
                return Recording(name, manoeuvre, None, driven.failure)
            run = measured(driven.run, self.sensors, self.seed, self.streams[name])
        except Cancelled:
            raise
        except RideError as error:
            return Recording(name, manoeuvre, None, str(error))
        description = f"{manoeuvre.name}. Simulated: {self.plant.vehicle.name}."
        kept = Run(
            name,
            run.time,
            run.channels,
            run.noise,
            description=description,
            vehicle=self.plant.vehicle.name,
            plant=self.plant.name,
        )
        return Recording(name, manoeuvre, kept, driven.failure)

    def truth(self) -> dict[str, Any]:
        """What nobody but a test may know, as plain JSON data."""
        sensors = {name: asdict(one) for name, one in self.sensors.sensors.items()}
        told = {"plant": self.plant.name, "seed": self.seed, "sensors": sensors}
        return {**told, **self.plant.truth()}


def chosen(keys: Sequence[str]) -> dict[str, Manoeuvre]:
    """Manoeuvres that come with the package, by key; KeyError for another."""
    return {key: reference_manoeuvres()[key] for key in keys}


def roughened(
    manoeuvres: Mapping[str, Manoeuvre],
    class_factor: float | None = None,
    band: tuple[float, float] | None = None,
    seed: int | None = None,
) -> dict[str, Manoeuvre]:
    """The manoeuvres with their random roads changed as far as told, see `Manoeuvre.roughened`.

    Raises CampaignError where that changes none of them.
    """
    found = {key: one.roughened(class_factor, band, seed) for key, one in manoeuvres.items()}
    if (class_factor, band, seed) != (None, None, None) and _same(manoeuvres, found):
        raise CampaignError(
            "None of the manoeuvres has a random road, so that its class factor, band and seed mean"
            " nothing; leave them out."
        )
    return found


def _same(before: Mapping[str, Manoeuvre], after: Mapping[str, Manoeuvre]) -> bool:
    """Whether no manoeuvre has been made again: one on another road is returned itself."""
    return all(after[key] is one for key, one in before.items())


def drive_table_2(
    vehicle: Vehicle, *, noise: Mapping[str, float] | None = None, seed: int = 0
) -> list[Run]:
    """The recordings of the paper's two manoeuvres by the concept model and the usual sensors.

    noise : channel -> standard deviation of white noise, SI; channels not named are noise-free
    Raises CampaignError for a car that does not come through.
    """
    sensors = noisy(noise or {}, "noise")
    campaign = Campaign.plan(ConceptPlant(vehicle), sensors, chosen(TABLE_2), seed)
    runs = []
    for name in campaign.manoeuvres:
        recording = campaign.record(name, lambda seconds: None, lambda: False)
        if recording.run is None or recording.failure:
            raise CampaignError(f"{name}: {recording.failure}")
        runs.append(recording.run)
    return runs


def _stream(key: str) -> int:
    """Number of a manoeuvre's noise: its place among those that come along, else by its name."""
    return ORDER.index(key) if key in ORDER else crc32(key.encode())
