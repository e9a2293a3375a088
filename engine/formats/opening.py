"""A file of any kind as a table: our own text reader here, everything else in a child."""

import io
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from ..csv_table import LARGEST_FILE
from ..errors import MeasurementError
from .child import BOUNDS, Bounds, ChildTable
from .csv_file import CsvFile
from .kinds import CSV, kind_of
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
        if kind_of(stream, source) == CSV:
            _check_size(stream, source)
            if not apart:
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
    if kind_of(stream, source) == CSV and not apart:
        _check_size(stream, source)
        yield CsvFile(stream, source)
        return
    with tempfile.NamedTemporaryFile(prefix="ridetune-", suffix=Path(source).suffix[:10]) as file:
        file.write(data)
        file.flush()
        with opened(Path(file.name), source, apart=apart, bounds=bounds) as table:
            yield table


def _check_size(stream: BinaryIO, source: str) -> None:
    size = stream.seek(0, io.SEEK_END)
    if size > LARGEST_FILE:
        raise MeasurementError(
            f"{source}: the file has {size / 1e6:.0f} MB, more than {LARGEST_FILE / 1e6:.0f} MB;"
            " cut the recording or thin it out."
        )
