"""Measurement files as runs: parsed once, kept in memory while they are in use, summed up.

The original on disk stays the truth; a run here can always be read again from it, and the motion
that it prescribes to every car made again.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..engine.channels import Run, channel
from ..engine.errors import MeasurementError
from ..engine.remembered import Remembered
from ..engine.rims_settings import RimsSettings
from ..engine.run_notes import doubtful_noise
from .store import Measurement, NewMeasurement, Store

if TYPE_CHECKING:
    from ..engine.recorded_motion import RecordedMotion

REMEMBERED_VALUES = 8_000_000
"""Numbers kept in memory over all runs, and as many over all motions: 64 MB."""


class Recordings:
    """Runs of measurements and what they prescribe, the most recently used ones in memory."""

    def __init__(self, store: Store):
        self._store = store
        self._runs: Remembered[str, Run] = Remembered(REMEMBERED_VALUES)
        self._conditioned: Remembered[Any, Run] = Remembered(REMEMBERED_VALUES)
        self._motions: Remembered[Any, RecordedMotion] = Remembered(REMEMBERED_VALUES)

    def run(self, measurement: Measurement) -> Run:
        """The recording as it is used: with what is done to it, as `raw` where that is nothing."""
        if measurement.conditioning is None:
            return self.raw(measurement)
        # It brings scipy, which is loaded with the first simulation.
        from ..engine.conditioning.chain import condition, steps_from_json
        from ..engine.vehicle_file import vehicle_from_json

        key = _done_to(measurement)
        run = self._conditioned.get(key)
        if run is None:
            asked = measurement.conditioning
            vehicle = asked["vehicle"] and vehicle_from_json(asked["vehicle"])
            run = condition(self.raw(measurement), steps_from_json(asked["steps"]), vehicle)
            self._conditioned.keep(key, run, run.time.size * (1 + len(run.columns)))
        return run

    def raw(self, measurement: Measurement) -> Run:
        """The parsed recording under the measurement's name, with its noise."""
        run = self._runs.get(measurement.sha256)
        if run is None:
            run = parse(self._store.original(measurement).read_bytes(), measurement.name)
            self._runs.keep(measurement.sha256, run, len(run.time) * (1 + len(run.columns)))
        return replace(
            run,
            name=measurement.name,
            noise=measurement.noise,
            warnings=(*run.warnings, *doubtful_noise(measurement.noise, run.channels)),
        )

    def motion(
        self,
        measurement: Measurement,
        settings: RimsSettings,
        braking: Iterable[tuple[float, float]] | None,
    ) -> "RecordedMotion":
        """What the recording prescribes to every car, with its braking marked, if it is marked.

        Noise and marks are no part of the motion, so that it outlives a change of them, but for
        noise that conditioning asks for.
        """
        # It brings scipy, which is loaded with the first simulation.
        from ..engine.recorded_motion import recorded_motion

        run = with_braking(self.run(measurement), braking)
        key = _done_to(measurement), settings
        motion = self._motions.get(key)
        if motion is None:
            motion = recorded_motion(run, settings)
            self._motions.keep(key, motion, motion.stage_inputs.size)
        return replace(motion, run=run)


def _done_to(measurement: Measurement) -> tuple[Any, ...]:
    """What stands for a measurement's file and what is done to it."""
    done = ()
    if measurement.conditioning is not None:
        text = json.dumps(measurement.conditioning, sort_keys=True)
        done = (text, *sorted(measurement.noise.items()))
    return measurement.sha256, measurement.name, *done


def stated(measurement: Measurement) -> dict[str, Any]:
    """What a job keeps of a measurement, so that it means the same for ever."""
    return {
        "id": measurement.id,
        "name": measurement.name,
        "noise": measurement.noise,
        "conditioning": measurement.conditioning,
    }


def as_stated(measurement: Measurement, kept: Mapping[str, Any]) -> Measurement:
    """The measurement as it was when a job kept that of it."""
    # Jobs of an earlier service say nothing of conditioning, and its sweeps nothing of noise.
    noise = kept.get("noise", measurement.noise)
    return replace(measurement, noise=noise, conditioning=kept.get("conditioning"))


def parse(data: bytes, name: str, noise: Mapping[str, float] | None = None) -> Run:
    """Read a measurement file; MeasurementError says what is wrong with it and where.

    noise : standard deviations in SI by channel, which are stated beside the file
    """
    from ..engine.measurement import parse_run

    try:
        return parse_run(data, name, noise=noise, apart=True)
    except (RecursionError, MemoryError, OverflowError) as error:
        raise MeasurementError(
            f"{name}: the file is too large or too deep to read ({type(error).__name__}); "
            "send a plain CSV."
        ) from None
    except OSError as error:
        raise MeasurementError(
            f"{name}: there is no room to read the file ({error.strerror}); try again later."
        ) from error


def recorded(data: bytes, name: str, noise: Mapping[str, float] | None = None) -> NewMeasurement:
    """A measurement file as it is kept; arguments and errors as of `parse`."""
    run = parse(data, name, noise)
    return NewMeasurement(name, data, summary(run), dict(run.noise))


def with_braking(run: Run, intervals: Iterable[tuple[float, float]] | None) -> Run:
    """The run with its braking marked, if it is marked."""
    return run if intervals is None else replace(run, braking=tuple(map(tuple, intervals)))


def summary(run: Run) -> dict[str, Any]:
    """What a person wants to know of a recording before using it."""
    from ..engine.measurement import missing_for_identification

    missing = list(missing_for_identification(run))
    return {
        "samples": len(run.time),
        "duration": run.duration,
        "sample_step": run.sample_step,
        "channels": [_channel(name, run) for name in run.columns],
        "warnings": list(run.warnings),
        "usable_for_identification": not missing,
        "missing": missing,
    }


def _channel(name: str, run: Run) -> Mapping[str, Any]:
    values = run[name]
    return {
        "name": name,
        "unit": channel(name).unit,
        "minimum": float(values.min()),
        "maximum": float(values.max()),
        "rms": float(np.sqrt(np.mean(values**2))),
    }
