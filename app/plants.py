"""The cars that a campaign can drive over REST, by name.

What makes them is imported when one is asked for, because it brings numba and scipy.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

from .errors import InvalidRequest, NotFound

if TYPE_CHECKING:
    from ..engine.plant import Plant


@dataclass(frozen=True)
class Known:
    """One of them.

    name : for a person
    takes_vehicle : whether it is a vehicle that is told, else it brings its own data
    make : the plant of that vehicle; raises what a person can mend
    """

    name: str
    takes_vehicle: bool
    make: "Callable[[Mapping[str, Any]], Plant]"


def _concept(vehicle: Mapping[str, Any]) -> "Plant":
    from ..engine.plant import ConceptPlant
    from ..engine.vehicle_file import vehicle_from_json

    return ConceptPlant(vehicle_from_json(vehicle))


PLANTS: Mapping[str, Known] = {"concept": Known("Concept car", True, _concept)}


def known_plant(key: str, *, with_vehicle: bool = False) -> Known:
    """The plant under a key; NotFound names the nearest.

    with_vehicle : whether a vehicle is told; InvalidRequest where it brings its own data
    """
    if key not in PLANTS:
        near = get_close_matches(key, PLANTS, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there is {', '.join(PLANTS)}."
        raise NotFound(f"There is no plant by that key; {hint}", field="plant")
    known = PLANTS[key]
    if with_vehicle and not known.takes_vehicle:
        raise InvalidRequest(
            f"The {key} car brings its own data; leave out vehicle or choose another plant.",
            field="vehicle",
        )
    return known
