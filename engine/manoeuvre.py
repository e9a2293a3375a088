"""A manoeuvre: torque law, road and duration as data, read from a small JSON file.

    {"name": "...", "description": "...", "kind": "road" or "posts", "duration": s,
     "initial_speed": m/s, "drive": {"kind": ...}, "brake": {"kind": ...}, "road": {"kind": ...},
     "posts": {"pattern": ...}, "seed": whole number}

The keys of each part are the fields of the record of that kind in `torque_laws`, `road_specs` and
`post_sweep`; unknown ones are refused with the nearest known name.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from .demand import Demand, PiecewiseLinear, PointMassMotion, PostMotion, point_mass_motion
from .errors import ManoeuvreError
from .frames import AXLES
from .json_record import RecordReader, record_to_json
from .json_text import read_json
from .post_sweep import PostSweep
from .remembered import Remembered
from .roads.road import Road
from .roads.road_specs import FlatRoad, IsoRoad, Place, RoadSpec
from .torque_laws import LONGEST, BrakeLaw, DriveLaw, Speed
from .vehicle import Pivot, Range, StabilizerBar, Suspension, Vehicle, field_types

__all__ = [
    "Demand",
    "Manoeuvre",
    "PiecewiseLinear",
    "PostMotion",
    "manoeuvre_from_json",
    "manoeuvre_to_json",
    "read_manoeuvre",
    "reference_manoeuvres",
]

ROAD_MARGIN = 0.02
"""The road is longer than the point mass's way by this share and 10 m: the car's own way differs
from it by less."""

SPRUNG_SOMEHOW = {
    "suspension": Suspension(stiffness=2e4, damping=2e3),
    "stabilizer_bar": StabilizerBar(stiffness=0.0, damping=0.0),
    "pivot": Pivot(distance=1.0, angle=0.0),
}
"""Parts of an axle on which a demand does not depend, of any car."""

_DEMANDS: Remembered[Any, Demand] = Remembered(4_000_000)
"""The last demands, by manoeuvre, car as far as it matters and road; sizes in numbers."""

ORDER = (
    *("1", "2", "brake", "brake-54", "coast", "constant-speed-c", "bump", "pothole", "sine-sweep"),
    *("heave", "pitch", "roll", "warp"),
)
"""Keys of the manoeuvres that come with the package, as a person meets them."""


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """What is done with a car, whichever car it is.

    kind : driven on a road, or standing on a four-post rig
    duration : s;  initial_speed : m/s
    drive, brake : torque laws; None is no torque
    road : None is level ground;  posts : only of kind "posts"
    seed : of everything random
    """

    name: str
    kind: Literal["road", "posts"]
    duration: Annotated[float, Range("s", 0.1, LONGEST)]
    description: str = ""
    initial_speed: Speed = 0.0
    drive: DriveLaw | None = None
    brake: BrakeLaw | None = None
    road: RoadSpec | None = None
    posts: PostSweep | None = None
    seed: Annotated[int, Range("1", 0, 2**53)] = 0

    def __post_init__(self) -> None:
        """Refuse parts that do not belong to the kind, and a seed that makes no numbers."""
        if self.seed < 0:
            raise ManoeuvreError(f"seed is {self.seed}; give a whole number from 0 on.")
        driven = self.drive or self.brake or self.road or self.initial_speed
        if self.kind == "posts" and (driven or self.posts is None):
            raise ManoeuvreError(
                'a manoeuvre of kind "posts" has "posts" and no drive, brake, road or'
                " initial_speed; correct them or the kind."
            )
        if self.kind == "road" and self.posts is not None:
            raise ManoeuvreError('"posts" belongs to kind "posts"; remove it or change the kind.')

    def lasting(self, duration: float) -> "Manoeuvre":
        """This manoeuvre with another duration, s."""
        accepted = field_types(Manoeuvre)["duration"][1]
        if accepted is not None and not accepted.holds(duration):
            raise ManoeuvreError(
                f"A duration of {duration:g} s is asked for, but it must lie {accepted}; correct"
                " it."
            )
        return replace(self, duration=duration)

    def roughened(
        self,
        class_factor: float | None = None,
        band: tuple[float, float] | None = None,
        seed: int | None = None,
    ) -> "Manoeuvre":
        """This manoeuvre with another random road, as far as told; itself on any other road.

        class_factor, band : as of `IsoRoad`; ManoeuvreError outside what a file may say
        """
        if not isinstance(self.road, IsoRoad):
            return self
        data = manoeuvre_to_json(self)
        told = {"class_factor": class_factor, "band": band and list(band)}
        data["road"] |= {name: value for name, value in told.items() if value is not None}
        data["seed"] = self.seed if seed is None else seed
        return manoeuvre_from_json(data, self.name)

    def demand(self, vehicle: Vehicle, road: Road | None = None) -> Demand:
        """What this manoeuvre asks of one car: its torques, and its road or posts.

        road : takes the place of the manoeuvre's own
        The same object for cars that differ in their suspension alone, as a tuned one does.
        """
        car = _sprung_somehow(vehicle)
        demand = _DEMANDS.get((self, car, road))
        if demand is None:
            demand = self._demand(car, road)
            _DEMANDS.keep((self, car, road), demand, demand.size)
        return demand

    def _demand(self, vehicle: Vehicle, road: Road | None) -> Demand:
        drive = brake = PiecewiseLinear.zero(self.duration)
        if self.drive is not None:
            drive = self.drive.wheel_torque(vehicle, self.initial_speed, self.duration)
        if self.brake is not None:
            brake = self.brake.wheel_torque(vehicle, self.duration)
        posts = None
        if self.posts is not None:
            posts = self.posts.motion(self.duration)
        elif road is None:
            motion = point_mass_motion(vehicle, drive, brake, self.initial_speed, self.duration)
            road = (self.road or FlatRoad()).build(self._place(vehicle, motion), self.seed)
        return Demand(self.duration, self.initial_speed, drive, brake, road, posts)

    def _place(self, vehicle: Vehicle, motion: PointMassMotion) -> Place:
        """Where the car is when the road matters."""
        off = None if self.drive is None else self.drive.end()
        torque_end = None
        if off is not None:
            torque_end = motion.distance(off) if off <= self.duration else math.inf
        contact = vehicle.front.cg_distance
        farthest = float(motion.x.max()) * (1.0 + ROAD_MARGIN)
        return Place(
            first_contact=contact,
            torque_end=torque_end,
            end=farthest + contact + 10.0,
        )


def _sprung_somehow(vehicle: Vehicle) -> Vehicle:
    """The car with the same springs, bars and pivots as every other."""
    axles = {name: replace(vehicle.axle(name), **SPRUNG_SOMEHOW) for name in AXLES}
    return replace(vehicle, source="", **axles)


def manoeuvre_from_json(data: Any, source: str = "manoeuvre") -> Manoeuvre:
    """Read a manoeuvre from parsed JSON; raises ManoeuvreError naming source and dotted field."""
    return RecordReader(source, ManoeuvreError).record(Manoeuvre, data)


def manoeuvre_to_json(manoeuvre: Manoeuvre) -> dict[str, Any]:
    """The manoeuvre as plain JSON data that reads back equal."""
    return record_to_json(manoeuvre)


def read_manoeuvre(path: str | Path) -> Manoeuvre:
    """Read a manoeuvre file; raises ManoeuvreError naming the file, the place and the remedy."""
    path = Path(path)
    return manoeuvre_from_json(read_json(path, ManoeuvreError), path.name)


@cache
def _reference_manoeuvres() -> Mapping[str, Manoeuvre]:
    folder = Path(__file__).parent / "manoeuvres"
    return {key: read_manoeuvre(folder / f"{key}.json") for key in ORDER}


def reference_manoeuvres() -> dict[str, Manoeuvre]:
    """The manoeuvres that come with the package, by key."""
    return dict(_reference_manoeuvres())
