"""A file of any kind as a table: our own text reader here, everything else in a child."""

import io
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .child import BOUNDS, Bounds, ChildTable
from .csv_file import CsvFile
from .kinds import CSV, kind_by_head
from .table import Table


@contextmanager
def opened(
    path: Path, source: str, *, apart: bool = False, bounds: Bounds = BOUNDS
) -> Iterator[Table]:
    """The table in a file, for as long as the `with` lasts.

    apart : whether a child opens text, too, as for what strangers send
    Raises MeasurementError, and OSError where the file cannot be read.
    """
    with path.open("rb") as stream:
        if not apart and kind_by_head(stream, source) == CSV:
            yield CsvFile(stream, source)
            return
    with ChildTable(path, source, bounds=bounds) as table:
        yield table


@contextmanager
def opened_bytes(
    data: bytes, source: str, *, apart: bool = False, bounds: Bounds = BOUNDS
) -> Iterator[Table]:
    """The table in the bytes of a file; arguments and errors as of `opened`."""
    stream = io.BytesIO(data)
    if not apart and kind_by_head(stream, source) == CSV:
        yield CsvFile(stream, source)
        return
    with tempfile.NamedTemporaryFile(prefix="ridetune-") as file:
        file.write(data)
        file.flush()
        with ChildTable(Path(file.name), source, bounds=bounds) as table:
            yield table
