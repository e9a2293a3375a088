"""The sample project every fresh session holds, read from the installed package."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...engine.remembered import Remembered
from ...engine.run_notes import manoeuvre_beside
from ..package_files import package_folder
from ..recordings.summary import summary
from ..simulators.simulator import Host
from ..storage.measurement import NewMeasurement

FOLDER = "detailed"
VEHICLE = "vehicle.json"
RUNS = ("manoeuvre_1.csv", "manoeuvre_2.csv")


@dataclass(frozen=True)
class SampleProject:
    """A car's known data with a first guess, and two recordings of that car."""

    vehicle: Mapping[str, Any]
    measurements: tuple[NewMeasurement, ...]


_KNOWN: Remembered[str, SampleProject] = Remembered(1)


def sample_project() -> SampleProject:
    """The project as it comes with the package, read once."""
    return _KNOWN.made(FOLDER, read_sample_project, lambda _: 1)


def remember(project: SampleProject) -> None:
    """Spare this process from reading it, which takes scipy."""
    _KNOWN.keep(FOLDER, project, 1)


def read_sample_project(_: Host | None = None) -> SampleProject:
    """The project, read from its files; here or in a simulator."""
    from ...engine.vehicle_file import read_vehicle, vehicle_to_json

    folder = package_folder("sample_runs") / FOLDER
    vehicle = vehicle_to_json(read_vehicle(folder / VEHICLE))
    return SampleProject(vehicle, tuple(_sample(folder / name) for name in RUNS))


def _sample(path: Path) -> NewMeasurement:
    """A recording with its notes and its manoeuvre, called after its folder too."""
    from ...engine.measurement import read_run

    run = read_run(path)
    return NewMeasurement(
        f"{FOLDER}_{path.name}",
        path.read_bytes(),
        summary(run),
        dict(run.noise),
        sample=True,
        manoeuvre=json.loads(manoeuvre_beside(path).read_bytes()),
    )
