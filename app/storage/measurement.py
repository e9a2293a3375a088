"""Measurements: recordings that were uploaded, what was found in them and what is told of them."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Measurement:
    """One uploaded recording.

    summary : what was found in it
    manoeuvre : what was driven
    mapping : which of its columns are which channels where their names do not say it
    conditioning : what is done to it before it is used, {"steps": [...], "vehicle": {...} or None}
    conditioned : what its notes say was done to it before it came here, a list of step records
    """

    id: str
    name: str
    sha256: str
    bytes: int
    created: float
    sample: bool
    noise: dict[str, float]
    summary: dict[str, Any]
    manoeuvre: dict[str, Any] | None
    mapping: dict[str, Any] | None
    conditioning: dict[str, Any] | None
    conditioned: list[dict[str, Any]] | None


@dataclass(frozen=True)
class NewMeasurement:
    """A recording to be kept, already parsed."""

    name: str
    data: bytes
    summary: Mapping[str, Any]
    noise: Mapping[str, float]
    sample: bool = False
    manoeuvre: Mapping[str, Any] | None = None


def read_as(measurement: Measurement) -> tuple[str, str, str]:
    """What a parsed recording is made of; its name heads its messages and may tell its kind."""
    mapping = json.dumps(measurement.mapping, sort_keys=True)
    return measurement.sha256, measurement.name, mapping


def done_to(measurement: Measurement) -> tuple[Any, ...]:
    """What stands for a measurement's file and what is done to it."""
    done = json.dumps([measurement.conditioned, measurement.conditioning], sort_keys=True)
    noise = () if measurement.conditioning is None else sorted(measurement.noise.items())
    return *read_as(measurement), done, *noise


def stated(measurement: Measurement) -> dict[str, Any]:
    """What a job keeps of a measurement, so that it means the same for ever."""
    return {
        "id": measurement.id,
        "name": measurement.name,
        "noise": measurement.noise,
        "mapping": measurement.mapping,
        "conditioning": measurement.conditioning,
        "conditioned": measurement.conditioned,
    }
