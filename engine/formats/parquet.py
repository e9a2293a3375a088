"""Parquet, by pyarrow: pandas, polars, Spark and MATLAB's parquetwrite.

The unit is the field's metadata unit or units, or stands in brackets in its title. Dates count in
s from the earliest first one of the file.
"""

from pathlib import Path
from typing import Any

import numpy as np

from ..csv_table import split_title
from .listing import Listing, earliest, first_text, numbers, plain
from .table import Array, Column, Table


class ParquetTable(Table):
    """A Parquet file, read column by column."""

    def __init__(self, path: Path, source: str, kind: str):
        import pyarrow as pa
        from pyarrow import parquet

        self._pa = pa
        self.source, self.kind, self.comment = source, kind, ""
        self._file: Any = parquet.ParquetFile(
            path,
            memory_map=False,
            thrift_string_size_limit=50_000_000,
            thrift_container_size_limit=1_000_000,
        )
        samples, listing = int(self._file.metadata.num_rows), Listing(source, kind)
        found: list[tuple[tuple[str, ...], Column, int]] = []
        begins = []
        for place, field in enumerate(self._file.schema_arrow):
            if not _is_number(pa, field.type):
                listing.leave_out(field.name, "holds no plain numbers")
                continue
            name, unit = split_title(plain(field.name))
            stated = field.metadata or {}
            unit = first_text(stated.get(b"unit"), stated.get(b"units"), unit)
            if samples and pa.types.is_timestamp(field.type):
                # Of every column of that name: one may be no date, or be nested.
                first = next(self._file.iter_batches(batch_size=1, columns=[field.name]))
                dates = [one for one in first.columns if pa.types.is_timestamp(one.type)]
                begins += [one.to_numpy(zero_copy_only=False)[0] for one in dates]
            unit = "s" if pa.types.is_temporal(field.type) else unit
            found.append(((name,), Column(name, unit, samples), place))
        listing.add_timed(found)
        self.columns, self.warnings = listing.columns(), listing.warnings()
        self._places, self._since = listing.places, earliest(begins)

    def values(self, index: int) -> Array:
        """The numbers of one column; NaN for what is null."""
        column = self._file.reader.read_column(self._places[index])
        if self._pa.types.is_decimal(column.type):
            column = column.cast(self._pa.float64())
        chunks = [chunk.to_numpy(zero_copy_only=False) for chunk in column.chunks]
        return numbers(np.concatenate(chunks), self._since)


def _is_number(pa: Any, kind: Any) -> bool:
    types = pa.types
    return (
        types.is_integer(kind)
        or types.is_floating(kind)
        or types.is_decimal(kind)
        or types.is_timestamp(kind)
        or types.is_duration(kind)
    )
