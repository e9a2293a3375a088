"""What is kept of one search of many, so that a fit that was broken off need not make it again."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from .fit import Ending


@dataclass(frozen=True, slots=True)
class EndedSearch:
    """Where one search ended and what it took; of the same problem, by the same engine.

    x : in the optimiser's variables
    basin : number of the search in the basin of whose minimum this one was cut short, if it was
    cost_history : the lowest cost so far after each of its evaluations
    """

    x: tuple[float, ...]
    ending: Ending
    basin: int | None
    simulations: int
    cost_history: tuple[float, ...]

    def to_json(self) -> dict[str, Any]:
        """As plain JSON data, which gives every number back bit for bit."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "EndedSearch":
        """What `to_json` gave."""
        return cls(
            tuple(data["x"]),
            Ending(data["ending"]),
            data["basin"],
            data["simulations"],
            tuple(data["cost_history"]),
        )
