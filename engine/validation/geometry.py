"""Where the pivots lie by drawing or bench, to be held against where a fit puts them."""

from dataclasses import dataclass
from typing import Any

from ..errors import VehicleError
from ..json_record import RecordReader
from ..vehicle import Pivot


@dataclass(frozen=True, slots=True)
class Geometry:
    """The pivots of both axles, as far as they are known."""

    front: Pivot | None = None
    rear: Pivot | None = None

    def values(self) -> dict[str, float]:
        """By the parameter's name, SI."""
        axles = {"front": self.front, "rear": self.rear}
        return {
            f"{axle}.pivot.{name}": getattr(pivot, name)
            for axle, pivot in axles.items()
            if pivot is not None
            for name in ("distance", "angle")
        }


def geometry_from_json(data: Any, source: str = "geometry") -> Geometry:
    """Read {"front": {"distance": m, "angle": rad}, "rear": ...}; VehicleError names the field."""
    geometry = RecordReader(source, VehicleError).record(Geometry, data)
    if not geometry.values():
        raise VehicleError(
            f'{source}: it holds no pivot; add "front": {{"distance": m, "angle": rad}}, or "rear".'
        )
    return geometry
