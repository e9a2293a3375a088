"""A vehicle as JSON: reading with checks that name file and field, writing, the reference cars.

Every message starts with the file (or "vehicle") and the dotted path of the field. A result of an
identification is accepted wherever a vehicle is: its "vehicle" is read.
"""

import json
from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields, is_dataclass
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, get_args

from .errors import VehicleError
from .vehicle import Range, Vehicle, check, field_types

LARGEST_FILE = 5_000_000
"""Longest vehicle file that is read, bytes; a fit with its histories fits in easily."""


def read_vehicle(path: str | Path) -> Vehicle:
    """Read and check a vehicle file, or the vehicle inside a fit."""
    path = Path(path)
    source = path.name
    try:
        with path.open("rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
    except OSError as error:
        raise VehicleError(
            f"{path}: the vehicle file cannot be read ({error.strerror}); check the path."
        ) from error
    return vehicle_from_text(data, source)


def write_vehicle(vehicle: Vehicle, path: str | Path) -> None:
    """Write a vehicle so that `read_vehicle` returns an equal one."""
    Path(path).write_text(json.dumps(vehicle_to_json(vehicle), indent=2) + "\n", encoding="utf-8")


def vehicle_from_text(data: bytes, source: str = "vehicle") -> Vehicle:
    """Parse and check the bytes of a vehicle file."""
    if len(data) > LARGEST_FILE:
        raise VehicleError(
            f"{source}: the file is larger than {LARGEST_FILE // 1_000_000} MB, which no vehicle"
            " is; choose the vehicle's JSON file."
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise VehicleError(
            f"{source}: the file is not UTF-8 text (byte {error.start + 1}); save it as JSON in"
            " UTF-8."
        ) from error
    try:
        content = json.loads(text, object_pairs_hook=_Object)
    except json.JSONDecodeError as error:
        raise VehicleError(
            f"{source}: line {error.lineno}, column {error.colno}: not valid JSON"
            f" ({error.msg}); correct it there or just before."
        ) from error
    except (ValueError, RecursionError) as error:
        raise VehicleError(f"{source}: not a usable JSON file ({error}); correct it.") from error
    return vehicle_from_json(content, source)


def vehicle_from_json(data: Mapping[str, Any], source: str = "vehicle") -> Vehicle:
    """Build and check a vehicle from parsed JSON; `source` heads every message."""
    prefix = ""
    if isinstance(data, Mapping) and "vehicle" in data and "chassis" not in data:
        data, prefix = data["vehicle"], "vehicle."
    vehicle = _Reader(source).record(Vehicle, data, prefix)
    check(vehicle, source)
    return vehicle


def vehicle_to_json(vehicle: Vehicle) -> dict[str, Any]:
    """The vehicle as plain JSON data, SI and radians."""
    data = asdict(vehicle)
    for axle in ("front", "rear"):
        data[axle]["wheel"]["cg_offset"] = list(data[axle]["wheel"]["cg_offset"])
    return {name: value for name, value in data.items() if value not in (None, "")}


@cache
def _reference_vehicles() -> dict[str, Vehicle]:
    folder = Path(__file__).parent / "vehicles"
    found = {path.stem: read_vehicle(path) for path in sorted(folder.glob("*.json"))}
    return {"paper": found.pop("paper"), **found}


def reference_vehicles() -> dict[str, Vehicle]:
    """The cars that come with the package by key; "paper" is the first."""
    return dict(_reference_vehicles())


class _Object(dict[str, Any]):
    """A JSON object that remembers a key which appeared twice."""

    def __init__(self, pairs: list[tuple[str, Any]]):
        super().__init__(pairs)
        names = [name for name, _ in pairs]
        self.doubled = next((name for name in self if names.count(name) > 1), None)


class _Reader:
    """Builds records from JSON objects, every value checked for presence and type."""

    def __init__(self, source: str):
        self.source = source

    def refuse(self, sentence: str) -> VehicleError:
        return VehicleError(f"{self.source}: {sentence}")

    def record(self, kind: Any, data: Any, prefix: str) -> Any:
        """An instance of the dataclass `kind`; `prefix` is the dotted path of its fields."""
        place = prefix.rstrip(".") or "the vehicle"
        if not isinstance(data, Mapping):
            raise self.refuse(f"{place} must be a JSON object {{...}}, not {_describe(data)}.")
        kinds = field_types(kind)
        doubled = getattr(data, "doubled", None)
        if doubled is not None:
            raise self.refuse(f"{prefix}{doubled} is given twice; keep one of them.")
        for name in data:
            if name not in kinds:
                near = get_close_matches(str(name), kinds, n=1)
                hint = f"did you mean {near[0]}?" if near else f"known here: {', '.join(kinds)}."
                raise self.refuse(f"{prefix}{name} is not a field of {place}; {hint}")
        values = {}
        for field in fields(kind):
            bare, accepted = kinds[field.name]
            path = prefix + field.name
            if field.name in data:
                values[field.name] = self.value(bare, accepted, data[field.name], path)
            elif field.default is MISSING:
                raise self.refuse(f"{path} is missing; add {_expected(bare, accepted)}.")
        return kind(**values)

    def value(self, kind: Any, accepted: Range | None, data: Any, path: str) -> Any:
        """One field's value as its type, or a sentence about what it should be."""
        if is_dataclass(kind):
            return self.record(kind, data, f"{path}.")
        if kind is float and _is_number(data):
            return _float(data)
        if kind is bool and isinstance(data, bool):
            return data
        if kind is str and isinstance(data, str):
            return data
        if data in get_args(kind) and isinstance(data, str):
            return data
        if accepted is not None and kind is not float and _is_three_numbers(data):
            return tuple(_float(element) for element in data)
        raise self.refuse(
            f"{path} is {_describe(data)}, but must be {_expected(kind, accepted)}; correct it."
        )


def _is_number(data: Any) -> bool:
    return isinstance(data, int | float) and not isinstance(data, bool)


def _is_three_numbers(data: Any) -> bool:
    return isinstance(data, list | tuple) and len(data) == 3 and all(map(_is_number, data))


def _float(data: int | float) -> float:
    try:
        return float(data)
    except OverflowError:
        return float("inf")


def _expected(kind: Any, accepted: Range | None) -> str:
    if kind is float:
        return f"a number {accepted}"
    if kind is bool:
        return "true or false"
    if kind is str:
        return "a text"
    if is_dataclass(kind) and isinstance(kind, type):
        return "an object with " + ", ".join(field_types(kind))
    if accepted is not None:
        return f"a list of three numbers {accepted}"
    return " or ".join(f'"{choice}"' for choice in get_args(kind))


def _describe(data: Any) -> str:
    """What a JSON value is, briefly."""
    text = json.dumps(data, default=str)
    if data is None:
        return "null"
    if isinstance(data, Mapping):
        return "an object"
    if isinstance(data, list):
        return "a list"
    return text if len(text) <= 40 else text[:37] + "..."
