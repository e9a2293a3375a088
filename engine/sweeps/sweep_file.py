"""A sweep as a file that explains itself: Parquet, Arrow or CSV, one row a car.

Parquet and Arrow hold in their metadata, under "ridetune", the design, the base vehicle, the
excitation and the columns as JSON; each column has its unit and label besides. They hold their rows
in groups (row groups in Parquet, record batches in Arrow), so neither writing nor reading needs all
rows in memory. CSV heads its columns `name [unit]` and needs no further package.

pyarrow is imported by who writes or reads with it: it is an extra, and large.
"""

import csv
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO, Literal, Protocol

import numpy as np

from ..errors import SweepError
from ..extras import how_to_install
from ..simulation.excitation import Excitation
from ..vehicle import Vehicle
from ..vehicle_file import vehicle_to_json
from .designs import Design
from .sweep import Block, Column, columns

Form = Literal["parquet", "arrow", "csv"]

ENDINGS: dict[str, Form] = {
    ".parquet": "parquet",
    ".arrow": "arrow",
    ".feather": "arrow",
    ".csv": "csv",
}
"""Which form a file has by the end of its name."""

GROUP = 10_000
"""Rows of a group, at least: Parquet keeps some 50 kB on each in memory until the file is whole."""

KEY = b"ridetune"
"""Where a file's metadata says what was swept."""


def form_of(path: str | Path) -> Form:
    """The form of a file by its name; SweepError for another end or a form that needs pyarrow."""
    form = ENDINGS.get(Path(path).suffix.lower())
    if form is None:
        raise SweepError(f"{path}: a sweep's file ends in {' or '.join(ENDINGS)}; name it so.")
    require_package(form)
    return form


def require_package(form: Form) -> None:
    """Raise SweepError where a form needs a package that is not installed."""
    if form != "csv" and find_spec("pyarrow") is None:
        raise SweepError(
            f"{form.capitalize()} needs pyarrow, which is not installed; {how_to_install('sweep')},"
            " or take CSV."
        )


def description(vehicle: Vehicle, design: Design, excitation: Excitation) -> dict[str, Any]:
    """What was swept, as plain JSON data."""
    return {
        "design": design.to_json(),
        "vehicle": vehicle_to_json(vehicle),
        "excitation": excitation.to_json(),
        "columns": [
            {"name": one.name, "label": one.label, "unit": one.unit} for one in columns(design)
        ],
    }


def write_blocks(
    stream: BinaryIO, form: Form, described: dict[str, Any], blocks: Iterable[Block]
) -> None:
    """Write a sweep to a stream, each block as it comes.

    described : as of `description`; its columns are those of the blocks
    """
    table = [Column(**one) for one in described["columns"]]
    if form == "csv":
        _write_csv(stream, table, blocks)
        return
    import pyarrow

    schema = pyarrow.schema(
        [_field(column) for column in table],
        metadata={KEY: json.dumps(described).encode()},
    )
    with _writer(stream, form, schema) as writer:
        for block in _grouped(blocks):
            writer.write_batch(pyarrow.record_batch([block[one.name] for one in table], schema))


def read_blocks(stream: BinaryIO) -> tuple[dict[str, Any], Iterator[Block]]:
    """What was swept and the blocks of a Parquet file."""
    from pyarrow import parquet

    file = parquet.ParquetFile(stream)
    batches = (file.read_row_group(group) for group in range(file.num_row_groups))
    return json.loads(file.schema_arrow.metadata[KEY]), (
        {name: table[name].to_numpy() for name in table.column_names} for table in batches
    )


def _grouped(blocks: Iterable[Block]) -> Iterator[Block]:
    """The same rows in blocks of GROUP or more, but for the last."""
    waiting: list[Block] = []
    for block in blocks:
        waiting.append(block)
        if sum(len(one["status"]) for one in waiting) >= GROUP:
            yield _joined(waiting)
            waiting = []
    if waiting:
        yield _joined(waiting)


def _joined(blocks: Sequence[Block]) -> Block:
    return {name: np.concatenate([one[name] for one in blocks]) for name in blocks[0]}


class _Writer(Protocol):
    """What writes record batches."""

    def write_batch(self, batch: Any) -> object: ...


def _writer(stream: BinaryIO, form: Form, schema: Any) -> AbstractContextManager[_Writer]:
    if form == "parquet":
        from pyarrow import parquet

        # Figures hardly ever repeat; a dictionary of them would be written besides.
        return parquet.ParquetWriter(stream, schema, use_dictionary=False)
    from pyarrow import ipc

    return ipc.new_file(stream, schema)


def _field(column: Column) -> Any:
    """A column in pyarrow's terms."""
    import pyarrow

    kinds = {"car": pyarrow.int64(), "status": pyarrow.string()}
    told = {"label": column.label, "unit": column.unit}
    return pyarrow.field(column.name, kinds.get(column.name, pyarrow.float64()), metadata=told)


def _write_csv(stream: BinaryIO, table: Sequence[Column], blocks: Iterable[Block]) -> None:
    text = io.TextIOWrapper(stream, encoding="utf-8", newline="", write_through=True)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        f"{one.name} [{one.unit}]" if one.unit and one.name != "car" else one.name for one in table
    )
    for block in blocks:
        writer.writerows(zip(*(block[one.name].tolist() for one in table), strict=True))
    text.detach()
