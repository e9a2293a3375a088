"""The sample project every fresh session holds, read from the installed package."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from .package_files import package_folder
from .recordings import summary
from .store import NewMeasurement

VEHICLE = "detailed_vehicle.json"
RUNS = ("detailed_manoeuvre_1.csv", "detailed_manoeuvre_2.csv")


@dataclass(frozen=True)
class SampleProject:
    """A car's known data with a first guess, and two recordings of that car."""

    vehicle: Mapping[str, Any]
    measurements: tuple[NewMeasurement, ...]


@cache
def sample_project() -> SampleProject:
    """The project as it comes with the package."""
    from ..engine.vehicle_file import read_vehicle, vehicle_to_json

    folder = package_folder("sample_runs")
    vehicle = vehicle_to_json(read_vehicle(folder / VEHICLE))
    return SampleProject(vehicle, tuple(_sample(folder / name) for name in RUNS))


def _sample(path: Path) -> NewMeasurement:
    from ..engine.measurement import read_run

    run = read_run(path)
    return NewMeasurement(path.name, path.read_bytes(), summary(run), dict(run.noise), sample=True)
