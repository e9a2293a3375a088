"""Measurement files under a mapping: from a path or from bytes to a Run."""

from collections.abc import Mapping
from pathlib import Path

from ..errors import MeasurementError
from ..formats.child import BOUNDS, Bounds
from ..formats.opening import opened, opened_bytes
from ..formats.table import Table
from ..measurement import read_run
from ..run import Run
from ..run_notes import RunNotes, notes_beside, notes_in, read_notes
from .apply import apply
from .mapping import ChannelMapping
from .survey import Survey, survey


def read_recording(
    path: str | Path,
    mapping: ChannelMapping | None = None,
    *,
    noise: Mapping[str, float] | None = None,
) -> Run:
    """Read a measurement file under a mapping, without one by our own names; see `read_run`."""
    if mapping is None:
        return read_run(path, noise=noise)
    path = Path(path)
    beside = notes_beside(path)
    notes = read_notes(beside) if beside.is_file() else RunNotes()
    try:
        with opened(path, path.name) as table:
            run = mapped_run(table, mapping, {**notes.noise, **(noise or {})}, notes.description)
            return notes.of_car(run)
    except OSError as error:
        raise _unreadable(path, error) from error


def parse_recording(
    data: bytes,
    name: str,
    mapping: ChannelMapping,
    *,
    noise: Mapping[str, float] | None = None,
    bounds: Bounds = BOUNDS,
) -> Run:
    """Read the bytes of a file that a stranger sent under a mapping; see `parse_run`."""
    with opened_bytes(data, name, apart=True, bounds=bounds) as table:
        return mapped_run(table, mapping, noise or {}, "")


def survey_file(path: str | Path) -> Survey:
    """What is in a file."""
    path = Path(path)
    try:
        with opened(path, path.name) as table:
            return survey(table)
    except OSError as error:
        raise _unreadable(path, error) from error


def mapped_run(
    table: Table, mapping: ChannelMapping, noise: Mapping[str, float], description: str
) -> Run:
    """The run, with the notes that the file carries in itself where none lie beside it."""
    said = notes_in(table.comment)
    run = apply(
        mapping,
        table,
        noise={**said.noise, **noise},
        description=description or said.description,
    )
    return said.of_car(run)


def _unreadable(path: Path, error: OSError) -> MeasurementError:
    return MeasurementError(f"{path}: the file cannot be read ({error.strerror}); check the path.")
