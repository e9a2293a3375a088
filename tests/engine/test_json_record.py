"""Records from JSON by their type hints: what is accepted, and what is said otherwise."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import pytest
from ridetune.engine.errors import RideError
from ridetune.engine.json_record import RecordReader, describe, record_to_json
from ridetune.engine.vehicle import Range

Length = Annotated[float, Range("m", 0.0, 10.0)]


@dataclass(frozen=True)
class Disc:
    kind: ClassVar[str] = "disc"
    radius: Length


@dataclass(frozen=True)
class Box:
    kind: ClassVar[str] = "box"
    sides: tuple[Length, Length]
    from_: Length | Literal["corner"] | None = None
    marks: tuple[Annotated[int, Range("1", 0, 9)], ...] = ()

    def __post_init__(self):
        if self.sides[0] < self.sides[1]:
            raise RideError("sides must fall; exchange them.")


@dataclass(frozen=True)
class Drawing:
    name: str
    shape: Disc | Box
    filled: bool = False


GOOD = {"name": "x", "shape": {"kind": "box", "sides": [3, 2], "from": "corner", "marks": [1, 2]}}


def read(data: Any):
    return RecordReader("d.json", RideError).record(Drawing, data)


def test_a_record_is_read_and_written_back():
    drawing = read(GOOD)
    assert drawing == Drawing("x", Box((3.0, 2.0), "corner", (1, 2)))
    assert record_to_json(drawing) == {**GOOD, "filled": False}


@pytest.mark.parametrize(("given", "read_as"), [(4, 4.0), ("corner", "corner"), (None, None)])
def test_a_union_takes_each_of_its_types(given, read_as):
    drawing = read({"name": "x", "shape": {"kind": "box", "sides": [1, 1], "from": given}})
    assert drawing.shape.from_ == read_as


@pytest.mark.parametrize(
    ("shape", "sentence"),
    [
        ({"kind": "disk", "radius": 1}, r'shape\.kind "disk" is not known; did you mean "disc"\?'),
        ({"radius": 1}, r"shape\.kind is missing; use \"disc\" or \"box\""),
        ({"kind": "disc", "raduis": 1}, r'shape\.raduis is not known; did you mean "radius"\?'),
        ({"kind": "disc", " ": 1}, r'shape\."" is not known; use "radius" or "kind"'),
        ({"kind": "disc", "zz": 1}, r"shape\.zz is not known; use \"radius\" or \"kind\""),
        ({"kind": "disc"}, r"shape\.radius is missing; add a number between 0 and 10 m"),
        ({"kind": "disc", "radius": 11}, r"shape\.radius is 11, but must lie between 0 and 10 m"),
        ({"kind": "disc", "radius": 10**400}, r"shape\.radius is a huge number, but must lie"),
        ({"kind": "disc", "radius": "1"}, r"shape\.radius is \"1\", but must be a number"),
        ({"kind": "box", "sides": [1]}, r"shape\.sides has 1 values, but must have 2"),
        ({"kind": "box", "sides": 1}, r"shape\.sides is 1, but must be a list"),
        ({"kind": "box", "sides": [1, -1]}, r"shape\.sides\[1\] is -1, but must lie"),
        ({"kind": "box", "sides": [2, 1], "marks": [0.5]}, r"marks\[0\] is 0.5, .* whole number"),
        ({"kind": "box", "sides": [2, 1], "from": "edge"}, r'from is "edge", but must be'),
        ({"kind": "box", "sides": [1, 2]}, r"shape: sides must fall; exchange them"),
        (7, r"shape is 7, but must be an object of kind \"disc\" or an object of kind \"box\""),
    ],
)
def test_a_fault_is_named_by_its_path(shape, sentence):
    with pytest.raises(RideError, match=rf"^d\.json: .*{sentence}"):
        read({"name": "x", "shape": shape})


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (None, "null"),
        (True, "true"),
        ({}, "an object"),
        ([1], "a list"),
        ("é" * 60, '"' + "é" * 36 + "..."),
        (10**400, "a huge number"),
    ],
)
def test_a_value_is_described_briefly(data, words):
    assert describe(data) == words
