"""A vehicle as JSON: reading with checks that name file and field, writing, the reference cars.

Every message starts with the file (or "vehicle") and the dotted path of the field. A result of an
identification is accepted wherever a vehicle is: its "vehicle" is read.
"""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from .equilibrium import static_loads
from .errors import VehicleError
from .json_record import RecordReader, record_to_json
from .json_text import parse_json, read_json
from .vehicle import Vehicle, check


def read_vehicle(path: str | Path) -> Vehicle:
    """Read and check a vehicle file, or the vehicle inside a fit."""
    path = Path(path)
    return vehicle_from_json(read_json(path, VehicleError), path.name)


def write_vehicle(vehicle: Vehicle, path: str | Path) -> None:
    """Write a vehicle so that `read_vehicle` returns an equal one."""
    Path(path).write_text(json.dumps(vehicle_to_json(vehicle), indent=2) + "\n", encoding="utf-8")


def vehicle_from_text(data: bytes, source: str = "vehicle") -> Vehicle:
    """Parse and check the bytes of a vehicle file."""
    return vehicle_from_json(parse_json(data, source, VehicleError), source)


def vehicle_from_json(data: Any, source: str = "vehicle") -> Vehicle:
    """Build and check a vehicle from parsed JSON; `source` heads every message."""
    place = ""
    if isinstance(data, Mapping) and "vehicle" in data and "chassis" not in data:
        data, place = data["vehicle"], "vehicle"
    vehicle = RecordReader(source, VehicleError).record(Vehicle, data, place)
    check(vehicle, source)
    try:
        static_loads(vehicle)
    except VehicleError as error:
        raise VehicleError(f"{source}: {error}") from error
    return vehicle


def vehicle_to_json(vehicle: Vehicle) -> dict[str, Any]:
    """The vehicle as plain JSON data, SI and radians."""
    data = record_to_json(vehicle)
    if not vehicle.source:
        del data["source"]
    return data


@cache
def _reference_vehicles() -> Mapping[str, Vehicle]:
    folder = Path(__file__).parent / "vehicles"
    found = {path.stem: read_vehicle(path) for path in sorted(folder.glob("*.json"))}
    return {"paper": found.pop("paper"), **found}


def reference_vehicles() -> dict[str, Vehicle]:
    """The cars that come with the package by key; "paper" is the first."""
    return dict(_reference_vehicles())
