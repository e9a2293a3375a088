"""Whether runs are of one car, as far as their notes tell.

The vehicle's name is that of its known data, which a virtual car borrows from the car that it
stands for: the plant that drove tells the two apart.
"""

from collections.abc import Mapping

from ..run import Run
from ..vehicle import Vehicle


def another_car(run: Run, vehicle: Vehicle) -> list[str]:
    """A sentence where a run is known to be of another car than the one that follows it."""
    if run.vehicle in ("", vehicle.name):
        return []
    return [
        f"Run {run.name} was recorded with another car, {run.vehicle}, than the one that follows"
        f" it, {vehicle.name}; leave it out unless they are the same."
    ]


def mixed_plants(plants: Mapping[str, str]) -> list[str]:
    """A sentence where some runs were driven by one plant, and others by another or by none.

    plants : by the run's name, as `Run.plant`
    """
    runs: dict[str, list[str]] = {}
    for name, plant in plants.items():
        runs.setdefault(plant, []).append(name)
    if len(runs) < 2:
        return []
    told = "; ".join(_driven(plant, names) for plant, names in runs.items())
    if len(runs.keys() - {""}) < 2:
        return [
            f"Whether the runs are of one car is not known: {told}. Add the notes of those that"
            " have none, or use those of one car together."
        ]
    return [
        f"The runs are of different cars, whatever the vehicle is called: {told}. Use those of one"
        " car together."
    ]


def among_others(name: str, plants: Mapping[str, str]) -> list[str]:
    """What `mixed_plants` says, where a run is of another plant than the first one."""
    return [] if plants[name] == next(iter(plants.values())) else mixed_plants(plants)


def _driven(plant: str, names: list[str]) -> str:
    if not plant:
        return f"nothing tells what drove {', '.join(names)}"
    verb = "was" if len(names) == 1 else "were"
    return f"{', '.join(names)} {verb} driven by the {plant} car of a campaign"
