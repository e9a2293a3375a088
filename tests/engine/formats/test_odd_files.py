"""Files that are sound but odd, or spoilt in a way that their form does not tell.

Oracle: what was written beside the oddity, and what was done to the file.
"""

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose
from ridetune.engine.errors import MeasurementError
from ridetune.engine.formats.readers import read_as

from tests import files_of_kinds as files


def table(path, kind):
    return read_as(kind, path, path.name, {})


def by_name(found):
    return {column.name: (column, found.values(k)) for k, column in enumerate(found.columns)}


def refusal(read):
    with pytest.raises(MeasurementError) as caught:
        read()
    return str(caught.value)


def test_a_nested_column_of_parquet_shifts_none_behind_it(tmp_path):
    nested = pa.array([{"a": 1.0, "b": [2, 3]}] * 50)
    columns = {"time [s]": files.TIME, "nested": nested, "chassis.z": files.Z, "a_x": files.A_X}
    pq.write_table(pa.table(columns), tmp_path / "r.parquet")
    found = by_name(table(tmp_path / "r.parquet", "Parquet"))
    assert_allclose(found["chassis.z"][1], files.Z)
    assert_allclose(found["a_x"][1], files.A_X)
