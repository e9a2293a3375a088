"""Roads as data: what a manoeuvre file says of its road, and the building of it."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from ..curves import SweptSine
from ..errors import RoadError
from ..json_record import RecordReader
from ..vehicle import Range
from .iso8608 import BLEND_LENGTH, Coherence, Roughness, iso_road
from .road import Road
from .road_shapes import Pairing, Tracks, bump, pothole, sine_sweep

RoadClass = Literal["A", "B", "C", "D", "E", "F", "G", "H"]
MOST_WAVES = 5000
"""Most waves of the last wavelength that a sine sweep may be long."""

TORQUE_END = "torque-end"
"""A section may begin where the car is when the drive torque ends."""

Position = Annotated[float, Range("m", 0.0, 20_000.0)]
Length = Annotated[float, Range("m", 0.05, 20_000.0)]
Height = Annotated[float, Range("m", -0.5, 0.5)]
Wavelength = Annotated[float, Range("m", 0.1, 200.0)]


@dataclass(frozen=True, slots=True)
class Place:
    """Where a road lies relative to the car that drives on it, m along X.

    first_contact : front wheels' contact while the car stands at X = 0
    torque_end : the car's X when the drive torque ends; None where there is none, infinite
        where it acts beyond the manoeuvre's end
    end : beyond the farthest wheel at the end of the manoeuvre
    """

    first_contact: float
    torque_end: float | None
    end: float


@dataclass(frozen=True, slots=True)
class FlatRoad:
    """Level ground."""

    kind: ClassVar[str] = "flat"

    def build(self, place: Place, seed: int) -> Road:
        """The road itself."""
        return Road.flat()


@dataclass(frozen=True, slots=True)
class Section:
    """One class of a random road; it grows in over 2 m from X = `from_`, m.

    Without `from_` it begins at the front contact of the standing car.
    """

    class_: RoadClass
    from_: Position | Literal["torque-end"] | None = None

    def begin(self, place: Place) -> float:
        """X where the section begins, m."""
        if self.from_ is None:
            return place.first_contact
        if not isinstance(self.from_, str):
            return self.from_
        if place.torque_end is None:
            raise RoadError(
                f'A section begins at "{TORQUE_END}", but the drive torque never ends; give its X'
                " in metres."
            )
        return place.torque_end


@dataclass(frozen=True, slots=True)
class IsoRoad:
    """A random road of ISO 8608 classes by geometric mean; see `iso8608`.

    class_factor : power relative to the geometric mean; 0.5 lower, 2 upper limit of the class
    band : lowest and highest spatial frequency, cycle/m
    coherence, decay, track : law of the coherence between the tracks and its lengths, m
    """

    kind: ClassVar[str] = "iso8608"
    sections: tuple[Section, ...]
    class_factor: Annotated[float, Range("1", 0.01, 100.0)] = 1.0
    band: tuple[
        Annotated[float, Range("cycle/m", 0.001, 9.0)],
        Annotated[float, Range("cycle/m", 0.001, 9.0)],
    ] = (0.011, 2.83)
    waviness: Annotated[float, Range("1", 1.0, 4.0)] = 2.0
    coherence: Coherence = "exponential"
    decay: Annotated[float, Range("m", 0.0, 100.0)] = 1.44
    track: Annotated[float, Range("m", 0.2, 5.0)] = 1.5

    def __post_init__(self) -> None:
        """Refuse a road without sections or with a falling band."""
        if not self.sections:
            raise RoadError('sections is empty; give one at least, e.g. [{"class": "C"}].')
        if not self.band[0] < self.band[1]:
            raise RoadError("band must rise from the lowest to the highest spatial frequency.")

    def build(self, place: Place, seed: int) -> Road:
        """The road itself; a section that begins beyond the end is left out."""
        begins = [(section.class_, section.begin(place)) for section in self.sections]
        for section, (_, before), (letter, begin) in zip(
            self.sections[1:], begins, begins[1:], strict=False
        ):
            if section.from_ == TORQUE_END and begin <= before:
                raise RoadError(
                    f"The section of class {letter} begins where the drive torque ends, at X ="
                    f" {begin:.2f} m, but the section before it only begins at {before:.2f} m; let"
                    " the torque act for longer or give its X in metres."
                )
        end = max(place.end, begins[0][1] + BLEND_LENGTH)
        roughness = Roughness(
            self.band, self.waviness, self.class_factor, self.coherence, self.decay, self.track
        )
        return iso_road([one for one in begins if one[1] < end], end, seed, roughness)


@dataclass(frozen=True, slots=True)
class BumpRoad:
    """One raised cosine; a dip where `height` is negative."""

    kind: ClassVar[str] = "bump"
    begin: Position
    length: Annotated[float, Range("m", 0.05, 200.0)]
    height: Height
    tracks: Tracks = "both"

    def build(self, place: Place, seed: int) -> Road:
        """The road itself."""
        return bump(self.begin, self.length, self.height, self.tracks)


@dataclass(frozen=True, slots=True)
class PotholeRoad:
    """A hole of level bottom, `length` over all, each edge falling over `edge`."""

    kind: ClassVar[str] = "pothole"
    begin: Position
    length: Annotated[float, Range("m", 0.05, 200.0)]
    depth: Annotated[float, Range("m", 0.0, 0.5)]
    edge: Annotated[float, Range("m", 0.02, 10.0)] = 0.1
    tracks: Tracks = "right"

    def __post_init__(self) -> None:
        """Refuse edges that overlap."""
        if 2.0 * self.edge > self.length:
            raise RoadError("edge is longer than half the length; shorten it.")

    def build(self, place: Place, seed: int) -> Road:
        """The road itself."""
        return pothole(self.begin, self.length, self.depth, self.edge, self.tracks)


@dataclass(frozen=True, slots=True)
class SineSweepRoad:
    """A sine whose wavelength goes from the first to the last, its amplitude likewise."""

    kind: ClassVar[str] = "sine-sweep"
    begin: Position
    length: Length
    first_wavelength: Wavelength
    last_wavelength: Wavelength
    amplitude: Annotated[float, Range("m", 1e-6, 0.5)]
    last_amplitude: Annotated[float, Range("m", 1e-6, 0.5)]
    tracks: Pairing = "in-phase"

    def __post_init__(self) -> None:
        """Refuse a road of more waves than it is worth the memory."""
        shortest = min(self.first_wavelength, self.last_wavelength)
        if self.length > MOST_WAVES * shortest:
            raise RoadError(
                f"length is more than {MOST_WAVES} waves of {shortest:g} m; shorten it to"
                f" {MOST_WAVES * shortest:g} m."
            )

    def build(self, place: Place, seed: int) -> Road:
        """The road itself."""
        sweep = SweptSine(
            span=self.length,
            first=1.0 / self.first_wavelength,
            last=1.0 / self.last_wavelength,
            amplitude=self.amplitude,
            last_amplitude=self.last_amplitude,
        )
        return sine_sweep(self.begin, sweep, self.tracks)


RoadSpec = FlatRoad | IsoRoad | BumpRoad | PotholeRoad | SineSweepRoad


def road_spec_from_json(data: Any, source: str = "road") -> RoadSpec:
    """Read a road's description from parsed JSON; raises RoadError naming the dotted field."""
    return RecordReader(source, RoadError).value(RoadSpec, data, "")
