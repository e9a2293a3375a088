"""Steps one after the other, and their JSON form: a list of objects, each with its `kind`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ConditioningError, MeasurementError
from ..json_record import RecordReader, record_to_json
from ..json_text import read_json
from ..run import Run
from ..step_record import StepRecord
from ..vehicle import Vehicle
from .calibration import Rest, Scale
from .delay import Delay
from .done import Done
from .motion import Angles, Displacement, Gravity, Speed
from .rims import RimFromTravel
from .sampling import Cut, Despike, Fill, Resample

Step = (
    Cut
    | Fill
    | Despike
    | Resample
    | Scale
    | Delay
    | Rest
    | Speed
    | Angles
    | Gravity
    | Displacement
    | RimFromTravel
)
"""In the order in which they belong."""

Steps = tuple[Step, ...]

MOST_STEPS = 100

LARGEST = 1e12
"""Beyond which no channel's value means anything, SI."""


def steps_from_json(data: Any, source: str = "steps") -> Steps:
    """Steps out of JSON data, checked; ConditioningError names the place in `source`."""
    reader = RecordReader(source, ConditioningError)
    if not isinstance(data, list):
        raise reader.refuse("", 'must be a list of steps, such as [{"kind": "rest"}].')
    if len(data) > MOST_STEPS:
        raise reader.refuse("", f"has {len(data)} steps, more than {MOST_STEPS}; leave some out.")
    return reader.value(tuple[Step, ...], data, "step")


def steps_to_json(steps: Sequence[Step]) -> list[dict[str, Any]]:
    """Steps as JSON data."""
    return [record_to_json(step) for step in steps]


def needs_vehicle(steps: Sequence[Step]) -> bool:
    """Whether what steps do depends on a vehicle."""
    return any(
        isinstance(step, RimFromTravel) or (isinstance(step, Speed) and step.source == "wheels")
        for step in steps
    )


def read_steps(path: Path) -> Steps:
    """The steps in a JSON file."""
    return steps_from_json(read_json(path, ConditioningError), path.name)


def condition(run: Run, steps: Sequence[Step], vehicle: Vehicle | None = None) -> Run:
    """The run after all steps, with the record of each behind those that it has already.

    vehicle : of which rim-from-travel takes dimensions, and speed which wheels are driven
    Raises ConditioningError naming run and step.
    """
    for place, step in enumerate(steps):
        try:
            run = _after(run, step, step.apply(run, vehicle))
        except (ConditioningError, MeasurementError) as error:
            raise ConditioningError(
                f"Run {run.name}, step {place + 1}, {step.kind}: {error}"
            ) from error
    return run


def _after(run: Run, step: Step, done: Done) -> Run:
    for name, values in done.channels.items():
        if np.any(np.abs(np.nan_to_num(values)) > LARGEST):
            raise ConditioningError(f"{name} grows beyond all bounds; check the step's numbers.")
    record = StepRecord(
        record_to_json(step),
        tuple(done.channels),
        done.numbers,
        done.band_hz,
        done.sentences,
        done.warnings,
    )
    return replace(
        run,
        time=run.time if done.time is None else done.time,
        channels=done.channels if done.time is not None else {**run.channels, **done.channels},
        noise={**run.noise, **done.noise},
        warnings=tuple(one for one in run.warnings if one not in done.settled),
        conditioning=(*run.conditioning, record),
    )
