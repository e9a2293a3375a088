"""What a step of conditioning did to a recording, kept with every run and every fit."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .errors import MeasurementError


@dataclass(frozen=True, slots=True)
class StepRecord:
    """One step that was done.

    step : the step itself, as JSON data
    channels : what it wrote
    numbers : what it found or used, SI, by name
    band_hz : between which frequencies its channels hold what is true, None for no end
    sentences : the same for a person
    warnings : what is doubtful in what it made
    """

    step: Mapping[str, Any]
    channels: tuple[str, ...]
    numbers: Mapping[str, float] = field(default_factory=dict)
    band_hz: tuple[float | None, float | None] = (None, None)
    sentences: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def step_record_to_json(record: StepRecord) -> dict[str, Any]:
    """A record as plain JSON data; an end that a band does not have is left out."""
    return {
        "step": dict(record.step),
        "channels": list(record.channels),
        "numbers": dict(record.numbers),
        "band_hz": {
            name: end
            for name, end in zip(("low", "high"), record.band_hz, strict=True)
            if end is not None
        },
        "sentences": list(record.sentences),
        "warnings": list(record.warnings),
    }


def step_records_from_json(data: Any, source: str) -> tuple[StepRecord, ...]:
    """Records out of JSON data, or TOML's; `source` heads the message of a MeasurementError."""
    if not isinstance(data, list) or not all(map(_is_record, data)):
        raise MeasurementError(
            f"{source}: conditioning must be a list of what was done, as `ridetune condition` "
            "writes it; write it anew, or leave it out."
        )
    return tuple(
        StepRecord(
            dict(one["step"]),
            tuple(one["channels"]),
            {name: float(value) for name, value in one["numbers"].items()},
            (one["band_hz"].get("low"), one["band_hz"].get("high")),
            tuple(one["sentences"]),
            tuple(one.get("warnings", ())),
        )
        for one in data
    )


def _is_record(one: Any) -> bool:
    wanted = {
        "step": lambda value: isinstance(value, Mapping) and isinstance(value.get("kind"), str),
        "channels": _texts,
        "numbers": lambda value: isinstance(value, Mapping) and all(map(_number, value.values())),
        "band_hz": lambda value: (
            isinstance(value, Mapping)
            and value.keys() <= {"low", "high"}
            and all(map(_number, value.values()))
        ),
        "sentences": _texts,
        "warnings": _texts,
    }
    return (
        isinstance(one, Mapping)
        # Notes of an earlier version have none.
        and one.keys() | {"warnings"} == wanted.keys()
        and all(wanted[name](value) for name, value in one.items())
    )


def _texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(one, str) for one in value)


def _number(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and abs(value) <= sys.float_info.max
