"""Sweeps as files: what is read back is what was swept, with units, in every form."""

import csv
import io
import json
import re
import subprocess
import sys

import numpy as np
import pyarrow
import pytest
from numpy.testing import assert_array_equal
from pyarrow import feather, parquet
from ridetune.engine.errors import SweepError
from ridetune.engine.extras import how_to_install
from ridetune.engine.manoeuvre import manoeuvre_from_json, reference_manoeuvres
from ridetune.engine.simulation.excitation import FreeExcitation
from ridetune.engine.sweeps import sweep_file
from ridetune.engine.sweeps.designs import Sobol
from ridetune.engine.sweeps.figures import OK, figures
from ridetune.engine.sweeps.sweep import columns
from ridetune.engine.sweeps.sweep_file import description, form_of, read_blocks, write_blocks
from ridetune.engine.vehicle_file import vehicle_from_json

from ...factories import paper_vehicle

CAR = paper_vehicle()
DESIGN = Sobol({"K_F": (1e4, 4e4), "chassis.mass": (900.0, 1300.0)}, 7, seed=1)
EXCITATION = FreeExcitation(reference_manoeuvres()["bump"])


def blocks(size=3):
    """Made-up rows of the design; the last car fails."""
    for first in range(0, DESIGN.cars, size):
        values = DESIGN.block(first, size)
        cars = np.arange(first, first + len(values))
        failed = cars == DESIGN.cars - 1
        status = np.where(failed, "It left, as a “car” may.", OK).astype(object)
        found = {
            one.name: np.where(failed, np.nan, cars / (3.0 + place))
            for place, one in enumerate(figures())
        }
        yield {
            "car": cars,
            **dict(zip(DESIGN.names, values.T, strict=True)),
            **found,
            "status": status,
        }


@pytest.fixture
def whole():
    """All rows at once."""
    return next(blocks(DESIGN.cars))


def written(form):
    """A sweep's file, from the start."""
    stream = io.BytesIO()
    write_blocks(stream, form, description(CAR, DESIGN, EXCITATION), blocks())
    stream.seek(0)
    return stream


@pytest.mark.parametrize(
    ("form", "read"), [("parquet", parquet.read_table), ("arrow", feather.read_table)]
)
def test_what_pyarrow_reads_is_what_was_swept_with_units_and_labels(form, read, whole):
    table = read(written(form))
    assert table.column_names == [column.name for column in columns(DESIGN)]
    for name, values in whole.items():
        assert_array_equal(table[name].to_numpy(), values)
    for column in columns(DESIGN):
        metadata = table.schema.field(column.name).metadata
        assert metadata[b"unit"].decode() == column.unit
        assert metadata[b"label"].decode() == column.label
    assert table.schema.field("car").type == pyarrow.int64()


@pytest.mark.parametrize(
    ("form", "read"), [("parquet", parquet.read_schema), ("arrow", lambda s: ipc_schema(s))]
)
def test_a_file_says_which_cars_were_swept_through_what(form, read):
    told = json.loads(read(written(form)).metadata[b"ridetune"])
    assert told["design"] == DESIGN.to_json()
    assert vehicle_from_json(told["vehicle"]) == CAR
    assert manoeuvre_from_json(told["excitation"]["manoeuvre"]) == EXCITATION.motion
    again = Sobol(told["design"]["ranges"], told["design"]["cars"], told["design"]["seed"])
    assert_array_equal(again.block(0, 7), DESIGN.block(0, 7))


def ipc_schema(stream):
    return pyarrow.ipc.open_file(stream).schema


@pytest.mark.parametrize(("group", "groups"), [(3, 3), (4, 2), (10, 1)])
def test_rows_are_written_in_groups_of_whole_blocks(monkeypatch, group, groups):
    monkeypatch.setattr(sweep_file, "GROUP", group)
    assert parquet.ParquetFile(written("parquet")).num_row_groups == groups
    assert pyarrow.ipc.open_file(written("arrow")).num_record_batches == groups


def test_a_number_takes_no_more_than_its_eight_bytes_in_parquet():
    """Oracle: the size of a double, of what never repeats; Parquet's account of a group is 1 %."""
    rng, told = np.random.default_rng(1), description(CAR, DESIGN, EXCITATION)
    names = [column.name for column in columns(DESIGN)][1:-1]
    size = {}
    for cars in (10, 20_000):
        block = {"car": np.arange(cars), "status": np.full(cars, OK, dtype=object)}
        stream = io.BytesIO()
        write_blocks(stream, "parquet", told, [block | {one: rng.random(cars) for one in names}])
        size[cars] = len(stream.getvalue())
    assert size[20_000] - size[10] <= 1.01 * 8 * 20_000 * (len(names) + 1)


def test_csv_holds_every_digit_under_names_with_units(whole):
    rows = list(csv.reader(io.TextIOWrapper(written("csv"), "utf-8", newline="")))
    assert rows[0][:3] == ["car", "front.suspension.stiffness [N/m]", "chassis.mass [kg]"]
    assert "chassis.pitch.rms [rad]" in rows[0]
    assert rows[0][-1] == "status"
    for place, (name, values) in enumerate(whole.items()):
        read = [row[place] for row in rows[1:]]
        if name == "status":
            assert read == list(values)
        else:
            assert_array_equal(np.array(read, dtype=float), values)


def test_parquet_is_read_back_in_blocks_and_gives_the_same_csv():
    told, found = read_blocks(written("parquet"))
    stream = io.BytesIO()
    write_blocks(stream, "csv", told, found)
    assert stream.getvalue() == written("csv").getvalue()


def test_the_end_of_a_name_tells_the_form():
    names = ("a.parquet", "a.b.ARROW", "a.feather", "a.csv")
    assert [form_of(name) for name in names] == ["parquet", "arrow", "arrow", "csv"]
    for name in ("cars", "cars.xlsx"):
        with pytest.raises(SweepError, match=rf"{name}: .* ends in .parquet or .arrow or"):
            form_of(name)


def test_without_pyarrow_csv_is_written_and_the_others_say_what_to_install(monkeypatch):
    monkeypatch.setattr(sweep_file, "find_spec", lambda name: None)
    assert form_of("cars.csv") == "csv"
    how = re.escape(how_to_install("sweep"))
    with pytest.raises(SweepError, match=f"Parquet needs pyarrow, .*; {how}, or"):
        form_of("cars.parquet")


def test_pyarrow_is_imported_by_who_uses_it_only():
    check = (
        "import sys; import ridetune.engine.sweeps.sweep_file;"
        "import ridetune.engine.identification.identify, ridetune.app.main;"
        "import ridetune.app.cli; print('pyarrow' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True)
    assert done.stdout == "False\n", done.stderr
