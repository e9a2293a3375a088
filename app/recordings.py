"""Measurement files as runs: parsed once, kept in memory while they are in use, summed up.

The original on disk stays the truth; a run here can always be read again from it under its mapping,
and the motion that it prescribes to every car made again. A file whose columns have names of their
own is kept, too, and is no run until it has a mapping.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..engine.channels import Run, channel
from ..engine.errors import MeasurementError, UnmappedError
from ..engine.remembered import Remembered
from ..engine.rims_settings import RimsSettings
from ..engine.run_notes import doubtful_noise
from .store import Measurement, NewMeasurement, Store

if TYPE_CHECKING:
    from ..engine.formats.child import Bounds, ChildTable
    from ..engine.mapping.survey import Survey
    from ..engine.recorded_motion import RecordedMotion

REMEMBERED_VALUES = 8_000_000
"""Numbers kept in memory over all runs, and as many over all motions: 64 MB."""

ANSWER = 3.0
"""Times its processor time that a process which reads a file has for an answer."""

REMEMBERED_COLUMNS = 20_000
"""Columns of surveys kept in memory, some kB each."""


class Recordings:
    """Runs of measurements and what they prescribe, the most recently used ones in memory."""

    def __init__(self, store: Store):
        self._store = store
        self._runs: Remembered[Any, Run] = Remembered(REMEMBERED_VALUES)
        self._conditioned: Remembered[Any, Run] = Remembered(REMEMBERED_VALUES)
        self._surveys: Remembered[Any, Survey] = Remembered(REMEMBERED_COLUMNS)
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
        """The parsed recording under the measurement's name and mapping, with its noise;
        `UnmappedError` where it needs a mapping and has none.
        """
        if measurement.mapping is None and measurement.summary.get("needs_mapping"):
            raise UnmappedError(
                f"{measurement.name}: its columns are not mapped to channels; map them first."
            )
        key = _key(measurement)
        run = self._runs.get(key)
        if run is None:
            data = self._store.original(measurement).read_bytes()
            run = self.parse(data, measurement.name, mapping=measurement.mapping)
            self._runs.keep(key, run, len(run.time) * (1 + len(run.columns)))
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

    def survey(self, measurement: Measurement) -> "Survey":
        """What is in the file, whether it has a mapping or not."""
        key = measurement.sha256, measurement.name
        found = self._surveys.get(key)
        if found is None:
            data = self._store.original(measurement).read_bytes()
            found = self._surveyed(data, measurement.name)
            self._surveys.keep(key, found, len(found.columns))
        return found

    @contextmanager
    def table(self, measurement: Measurement) -> "Iterator[ChildTable]":
        """The file as a table, for as long as the `with` lasts."""
        from ..engine.formats.child import ChildTable

        path, name = self._store.original(measurement), measurement.name
        with ChildTable(path, name, bounds=self._bounds) as table:
            yield table

    def parse(
        self,
        data: bytes,
        name: str,
        noise: Mapping[str, float] | None = None,
        mapping: Mapping[str, Any] | None = None,
    ) -> Run:
        """Read a measurement file; MeasurementError says what is wrong with it and where.

        noise : standard deviations in SI by channel, which are stated beside the file
        mapping : as JSON, which columns are which channels; None for those with our names
        """
        from ..engine.measurement import parse_run

        try:
            if mapping is None:
                return parse_run(data, name, noise=noise, apart=True, bounds=self._bounds)
            # The mapping brings scipy.
            from ..engine.mapping.mapping import mapping_from_json
            from ..engine.mapping.reading import parse_recording

            known = mapping_from_json(mapping)
            return parse_recording(data, name, known, noise=noise, bounds=self._bounds)
        except (RecursionError, MemoryError, OverflowError) as error:
            raise MeasurementError(
                f"{name}: the file is too large or too deep to read ({type(error).__name__}); "
                "send a plain CSV."
            ) from None
        except OSError as error:
            raise MeasurementError(
                f"{name}: there is no room to read the file ({error.strerror}); try again later."
            ) from error

    def recorded(
        self, data: bytes, name: str, noise: Mapping[str, float] | None = None
    ) -> NewMeasurement:
        """A measurement file as it is kept; arguments and errors as of `parse`.

        One with names of its own is kept as a file that needs a mapping.
        """
        try:
            run = self.parse(data, name, noise)
        except UnmappedError as error:
            from ..engine.plausibility import require_samples

            found = self._surveyed(data, name)
            require_samples(max((one.samples for one in found.columns), default=0), name)
            return NewMeasurement(name, data, unmapped_summary(found, error), noise or {})
        return NewMeasurement(name, data, summary(run), dict(run.noise))

    def _surveyed(self, data: bytes, name: str) -> "Survey":
        from ..engine.formats.opening import opened_bytes
        from ..engine.mapping.survey import survey

        with opened_bytes(data, name, apart=True, bounds=self._bounds) as table:
            return survey(table)

    @property
    def _bounds(self) -> "Bounds":
        """What the process that reads a file may take."""
        from ..engine.formats.child import Bounds

        limits = self._store.limits
        seconds = limits.reader_seconds
        return Bounds(memory=limits.reader_bytes, cpu=seconds, wall=ANSWER * seconds)


def _key(measurement: Measurement) -> tuple[str, str]:
    """What a parsed recording is made of."""
    return measurement.sha256, json.dumps(measurement.mapping, sort_keys=True)


def _done_to(measurement: Measurement) -> tuple[Any, ...]:
    """What stands for a measurement's file and what is done to it."""
    done = ()
    if measurement.conditioning is not None:
        text = json.dumps(measurement.conditioning, sort_keys=True)
        done = (text, *sorted(measurement.noise.items()))
    return *_key(measurement), measurement.name, *done


def stated(measurement: Measurement) -> dict[str, Any]:
    """What a job keeps of a measurement, so that it means the same for ever."""
    return {
        "id": measurement.id,
        "name": measurement.name,
        "noise": measurement.noise,
        "mapping": measurement.mapping,
        "conditioning": measurement.conditioning,
    }


def as_stated(measurement: Measurement, kept: Mapping[str, Any]) -> Measurement:
    """The measurement as it was when a job kept that of it."""
    # Jobs of an earlier service say nothing of these, and its sweeps nothing of noise.
    return replace(
        measurement,
        noise=kept.get("noise", measurement.noise),
        mapping=kept.get("mapping"),
        conditioning=kept.get("conditioning"),
    )


def with_braking(run: Run, intervals: Iterable[tuple[float, float]] | None) -> Run:
    """The run with its braking marked, if it is marked."""
    return run if intervals is None else replace(run, braking=tuple(map(tuple, intervals)))


def summary(run: Run, mapping: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What a person wants to know of a recording before using it.

    mapping : that of its columns, whose signs are looked at; None where they go by their names
    """
    from ..engine.measurement import missing_for_identification

    missing = list(missing_for_identification(run))
    suggestions = []
    if mapping is not None:
        from ..engine.mapping.mapping import mapping_from_json
        from ..engine.mapping.signs import check_signs

        sure = mapping_from_json(mapping).sure_signs
        suggestions = [asdict(one) for one in check_signs(run, sure)]
    return {
        "needs_mapping": False,
        "samples": len(run.time),
        "duration": run.duration,
        "sample_step": run.sample_step,
        "channels": [_channel(name, run) for name in run.columns],
        "warnings": list(run.warnings),
        "usable_for_identification": not missing,
        "missing": missing,
        "sign_suggestions": suggestions,
    }


def unmapped_summary(found: "Survey", reason: MeasurementError) -> dict[str, Any]:
    """The same of a file that needs a mapping: what is missing is missing in the guess, too."""
    from ..engine.measurement import missing_for_identification

    nothing = np.arange(2.0)
    guessed = {one.channel: nothing for one in found.guess.mapping.columns if one.channel != "time"}
    return {
        "needs_mapping": True,
        "samples": max(one.samples for one in found.columns),
        "duration": 0.0,
        "sample_step": 0.0,
        "channels": [],
        "warnings": [str(reason), *found.warnings],
        "usable_for_identification": False,
        "missing": list(missing_for_identification(Run(found.source, nothing, guessed))),
        "sign_suggestions": [],
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
