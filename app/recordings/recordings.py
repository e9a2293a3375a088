"""Measurement files as runs: parsed once, kept in memory while they are in use, summed up.

The original on disk stays the truth; a run here can always be read again from it under its mapping.
A file whose columns have names of their own is kept, too, and is no run until it has a mapping.
Whoever reads a file here waits until a child may be started, so that there are never more of them
than the settings allow.
"""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import TYPE_CHECKING, Any

from ...engine.errors import MeasurementError, UnmappedError
from ...engine.remembered import Remembered
from ...engine.run import Run
from ...engine.run_notes import doubtful_noise
from ...engine.step_record import step_records_from_json
from ..errors import Deleted, NotFound
from ..storage.disk_errors import trouble_of
from ..storage.measurement import Measurement, NewMeasurement, done_to, read_as
from ..storage.store import Store
from .runs import size
from .summary import summary, unmapped_summary

if TYPE_CHECKING:
    from ...engine.formats.child import Bounds, ChildTable
    from ...engine.formats.table import Table
    from ...engine.mapping.survey import Survey

REMEMBERED_VALUES = 8_000_000
"""Numbers kept in memory over all runs: 64 MB, and as much of conditioned ones."""

ANSWER = 3.0
"""Times its processor time that a process which reads a file has for an answer."""

BLOCK = 2**20
"""Bytes that are read at once."""

REMEMBERED_COLUMNS = 20_000
"""Columns of surveys kept in memory, some kB each."""


class Recordings:
    """Runs of measurements, the most recently used ones in memory."""

    def __init__(self, store: Store):
        self._store = store
        self._folder = store.directory.reading
        self._children = threading.BoundedSemaphore(store.limits.readers)
        self._runs: Remembered[Any, Run] = Remembered(REMEMBERED_VALUES)
        self._conditioned: Remembered[Any, Run] = Remembered(REMEMBERED_VALUES)
        self._surveys: Remembered[Any, Survey] = Remembered(REMEMBERED_COLUMNS)

    def run(self, measurement: Measurement) -> Run:
        """The recording as it is used: with what is done to it, as `raw` where that is nothing."""
        if measurement.conditioning is None:
            return self.raw(measurement)
        # It brings scipy, which takes long to load.
        from ...engine.conditioning.chain import condition, steps_from_json
        from ...engine.vehicle_file import vehicle_from_json

        asked = measurement.conditioning

        def conditioned() -> Run:
            vehicle = asked["vehicle"] and vehicle_from_json(asked["vehicle"])
            return condition(self.raw(measurement), steps_from_json(asked["steps"]), vehicle)

        return self._conditioned.made(done_to(measurement), conditioned, size)

    def raw(self, measurement: Measurement) -> Run:
        """The parsed recording under the measurement's name and mapping, with its noise;
        `UnmappedError` where it needs a mapping and has none.
        """
        if measurement.mapping is None and measurement.summary.get("needs_mapping"):
            raise UnmappedError(
                f"{measurement.name}: its columns are not mapped to channels; map them first."
            )
        run = self._runs.made(read_as(measurement), lambda: self.parse(measurement), size)
        done = run.conditioning
        if measurement.conditioned is not None:
            done = step_records_from_json(measurement.conditioned, measurement.name)
        return replace(
            run,
            conditioning=done,
            noise=measurement.noise,
            vehicle=measurement.summary.get("vehicle") or run.vehicle,
            plant=measurement.summary.get("plant") or run.plant,
            warnings=(*run.warnings, *doubtful_noise(measurement.noise, run.channels)),
        )

    def remembers(self, measurement: Measurement) -> bool:
        """Whether `run` gives the recording from memory, without a child."""
        done = None
        if measurement.conditioning is not None:
            done = self._conditioned.get(done_to(measurement))
        return done is not None or self._runs.get(read_as(measurement)) is not None

    def survey(self, measurement: Measurement) -> "Survey":
        """What is in the file, whether it has a mapping or not."""
        from ...engine.mapping.survey import survey

        def surveyed() -> "Survey":
            with self.table(measurement) as table:
                return survey(table)

        key = measurement.sha256, measurement.name
        return self._surveys.made(key, surveyed, lambda made: len(made.columns))

    @contextmanager
    def table(self, measurement: Measurement) -> "Iterator[ChildTable]":
        """The file as a table, for as long as the `with` lasts; errors as of
        `MeasurementStore.original`, and MeasurementError where it is there, but spoilt.
        """
        original = self._store.measurements.original
        try:
            with self._opened(original(measurement), measurement.name) as table:
                yield table
        except UnmappedError:
            raise
        except MeasurementError:
            # Or it is the disk, which the process that reads cannot tell from a spoilt file.
            with _readable(measurement.name), original(measurement).open("rb") as file:
                while file.read(BLOCK):
                    pass
            raise

    def parse(self, measurement: Measurement, noise: Mapping[str, float] | None = None) -> Run:
        """Read a measurement's file under its mapping; MeasurementError says what is wrong with it
        and where.

        noise : standard deviations in SI by channel, which are stated beside the file
        """
        with self.table(measurement) as table:
            return _run(table, measurement.mapping, noise or {})

    def recorded(
        self, data: bytes, name: str, noise: Mapping[str, float] | None = None
    ) -> NewMeasurement:
        """A measurement file as it is kept; `noise` and errors as of `parse`.

        One with names of its own is kept as a file that needs a mapping.
        """
        with _readable(name), NamedTemporaryFile(dir=self._folder) as file:
            file.write(data)
            file.flush()
            with self._opened(Path(file.name), name) as table:
                return NewMeasurement(name, data, *_by_names(table, noise or {}))

    def by_names(self, measurement: Measurement) -> tuple[dict[str, Any], dict[str, float]]:
        """Summary and noise of a measurement's file as if it had just been sent; the car that was
        driven stays known.
        """
        with self.table(measurement) as table:
            found, noise = _by_names(table, measurement.noise)
        return {**found, **named_car(measurement.summary, found)}, noise

    def summed_up(self, measurement: Measurement) -> dict[str, Any]:
        """Summary of a measurement as it is used."""
        return summary(self.run(measurement), measurement.mapping, self.raw(measurement))

    @contextmanager
    def _opened(self, path: Path, name: str) -> "Iterator[ChildTable]":
        """A stranger's file, opened once a child may be started."""
        from ...engine.formats.child import ChildTable

        with (
            _readable(name),
            self._children,
            ChildTable(path, name, bounds=self._bounds, folder=self._folder) as table,
        ):
            yield table

    @property
    def _bounds(self) -> "Bounds":
        """What the process that reads a file may take."""
        from ...engine.formats.child import Bounds

        limits = self._store.limits
        seconds = limits.reader_seconds
        return Bounds(memory=limits.reader_bytes, cpu=seconds, wall=ANSWER * seconds)


@contextmanager
def _readable(name: str) -> Iterator[None]:
    """A sentence in place of what else may happen to a file while it is read."""
    try:
        yield
    except (RecursionError, MemoryError, OverflowError):
        raise MeasurementError(
            f"{name}: the file is too large or too deep to read; send a plain CSV."
        ) from None
    except MeasurementError as error:
        # The process that was to read it could not be started.
        if isinstance(error.__cause__, OSError) and (trouble := trouble_of(error.__cause__)):
            raise trouble from error
        raise
    except OSError as error:
        raise trouble_of(error) or MeasurementError(
            f"{name}: the file cannot be read just now ({error.strerror}); try again later."
        ) from error


def _by_names(
    table: "Table", noise: Mapping[str, float]
) -> tuple[dict[str, Any], dict[str, float]]:
    """Summary and noise of a file without a mapping, whether it needs one or not."""
    try:
        run = _run(table, None, noise)
    except UnmappedError as error:
        return unmapped_summary(table, error), dict(noise)
    return summary(run), dict(run.noise)


def named_car(first: Mapping[str, Any], then: Mapping[str, Any]) -> dict[str, str | None]:
    """The car that drove, and which virtual one: as one summary names it, else as another."""
    return {name: first.get(name) or then.get(name) for name in ("vehicle", "plant")}


def _run(table: "Table", mapping: Mapping[str, Any] | None, noise: Mapping[str, float]) -> Run:
    """The run in a table.

    mapping : as JSON, which columns are which channels; None for those with our names
    """
    from ...engine.measurement import named_run

    if mapping is None:
        return named_run(table, noise, "")
    # The mapping brings scipy.
    from ...engine.mapping.mapping import mapping_from_json
    from ...engine.mapping.reading import mapped_run

    return mapped_run(table, mapping_from_json(mapping), noise, "")


def as_stated(
    store: Store,
    session: str,
    kept: Mapping[str, Any],
    role: str = "which this is about",
    remedy: str = "ask anew",
) -> Measurement:
    """A measurement as it was when a job kept that of it; Deleted names it by its role."""
    try:
        measurement = store.measurements.get(session, kept["id"])
    except NotFound:
        raise Deleted(f"{kept['name']}, {role}, was deleted; add it again and {remedy}.") from None
    # Jobs of an earlier service say nothing of these, and its sweeps nothing of noise.
    return replace(
        measurement,
        noise=kept.get("noise", measurement.noise),
        mapping=kept.get("mapping"),
        conditioning=kept.get("conditioning"),
        conditioned=kept.get("conditioned"),
    )
