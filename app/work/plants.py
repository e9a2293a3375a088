"""The cars that a campaign can drive, by name.

What makes them is imported when one is asked for, because it brings numba and scipy.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING

from ..errors import InvalidRequest, NotFound

if TYPE_CHECKING:
    from ...engine.plant import Plant
    from ...engine.vehicle import Vehicle


@dataclass(frozen=True)
class Known:
    """One of them.

    name : for a person
    takes_vehicle : whether it is a vehicle that is told, else it brings its own data
    effort : s that a driven second takes on one core, about
    make : the plant, of the vehicle that the function given reads; raises what a person can mend
    missing : why it cannot be made here and what to do, a sentence; empty where it can
    """

    name: str
    takes_vehicle: bool
    effort: float
    make: "Callable[[Callable[[], Vehicle]], Plant]"
    missing: Callable[[], str] = lambda: ""


def _concept(vehicle: "Callable[[], Vehicle]") -> "Plant":
    from ...engine.plant import ConceptPlant

    return ConceptPlant(vehicle())


def _detailed(_: "Callable[[], Vehicle]") -> "Plant":
    from ...engine.detailed.car_file import reference_car
    from ...engine.detailed.plant import DetailedPlant

    return DetailedPlant.of(reference_car())


def _detailed_missing() -> str:
    from ...engine.detailed.exudyn_module import missing_exudyn

    return missing_exudyn()


PLANTS: Mapping[str, Known] = {
    "concept": Known("Concept car", True, 5e-4, _concept),
    "detailed": Known("Detailed car", False, 2.5, _detailed, _detailed_missing),
}


def known_plant(key: str, *, with_vehicle: bool = False) -> Known:
    """The plant under a key; NotFound names the nearest.

    with_vehicle : whether a vehicle is told; InvalidRequest where it brings its own data
    """
    if key not in PLANTS:
        near = get_close_matches(key, PLANTS, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(PLANTS)}."
        raise NotFound(f"There is no plant by that key; {hint}", field="plant")
    known = PLANTS[key]
    if with_vehicle and not known.takes_vehicle:
        raise InvalidRequest(
            f"The {key} car brings its own data; leave out vehicle or choose another plant.",
            field="vehicle",
        )
    return known
