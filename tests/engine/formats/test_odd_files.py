"""Files that are sound but odd, or spoilt in a way that their form does not tell.

Oracle: what was written beside the oddity, and what was done to the file.
"""

import io
import struct

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter
from numpy.testing import assert_allclose
from ridetune.engine.errors import MeasurementError, RideError
from ridetune.engine.formats.csv_file import CsvFile
from ridetune.engine.formats.listing import Listing, line_ends_converted, plain
from ridetune.engine.formats.readers import read_as
from ridetune.engine.formats.table import Column
from ridetune.engine.measurement import parse_run, read_run
from ridetune.engine.plausibility import require_increasing
from scipy.io import savemat

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


@pytest.mark.parametrize(
    ("name", "other"),
    [("z", pa.array(files.Z)), ("a", pa.array([{"z": 1.0}] * 50)), ("z", pa.array(["x"] * 50))],
)
def test_a_date_of_parquet_is_told_from_another_column_of_its_name(tmp_path, name, other):
    """Parquet allows a name twice, and a field `z` of `a` has the path of a column `a.z`."""
    dates = pa.array(np.datetime64("2024-03-12T10:00", "ns") + (1e9 * files.TIME).astype("m8[ns]"))
    date = "a.z" if name == "a" else name
    pq.write_table(
        pa.Table.from_arrays([other, dates, pa.array(files.A_X)], [name, date, "a_x"]),
        tmp_path / "r.parquet",
    )
    found = table(tmp_path / "r.parquet", "Parquet")
    index = next(k for k, one in enumerate(found.columns) if (one.name, one.unit) == (date, "s"))
    assert_allclose(found.values(index), files.TIME, atol=1e-9)
    assert_allclose(by_name(found)["a_x"][1], files.A_X)


def mdf(path, version, spoilt="", **fields):
    """Two channels, of which `a_x` of MDF 4 has an invalid sample, as a table.

    fields : what the description of the channel `spoilt` says instead
    """
    invalid = np.arange(50) == 3 if version >= "4" else None
    with MDF(version=version) as file:
        z = Signal(files.Z, files.TIME, name="chassis.z")
        file.append([z, Signal(files.A_X, files.TIME, name="a_x", invalidation_bits=invalid)])
        for channel in file.groups[0].channels:
            for name, value in fields.items() if channel.name == spoilt else ():
                setattr(channel, name, value)
        file.save(path)
    return table(path, f"MDF{version[0]}")


def test_an_invalid_sample_of_mdf_is_no_number(tmp_path):
    """Oracle: the others, at their places."""
    found = by_name(mdf(tmp_path / "r.mf4", "4.10"))
    expected = np.where(np.arange(50) == 3, np.nan, files.A_X)
    np.testing.assert_array_equal(found["a_x"][1], expected)
    np.testing.assert_array_equal(found["chassis.z"][1], files.Z)


@pytest.mark.parametrize("spoilt", ["chassis.z", "time"])
@pytest.mark.parametrize(
    ("name", "version", "fields"),
    [
        ("r.mdf", "3.30", {"additional_byte_offset": 2048}),
        ("r.mf4", "4.10", {"byte_offset": 1 << 20}),
        ("r.mf4", "4.10", {"flags": 2, "pos_invalidation_bit": 1 << 30}),
    ],
)
def test_a_channel_of_mdf_outside_its_record_is_left_out(tmp_path, spoilt, name, version, fields):
    """Else asammdf writes beyond its memory, and this file or the next ends the process."""
    found = mdf(tmp_path / name, version, spoilt, **fields)
    [said] = [one for one in found.warnings if "outside its record" in one]
    assert f"{spoilt} lies" in said
    assert sorted(by_name(found)) == sorted({"a_x", "chassis.z", "time"} - {spoilt})
    column, values = by_name(found)["a_x"]
    assert_allclose(values[4:], files.A_X[4:])
    assert (column.clock is None) == (spoilt == "time")


def test_records_of_mdf_that_are_longer_than_the_file_are_not_made_room_for(tmp_path):
    """A length of 4.7 MB where 24 bytes are: asammdf would take 1.8 GB for it."""
    path = tmp_path / "r.mf4"
    mdf(path, "4.10")
    data = bytearray(path.read_bytes())
    struct.pack_into("<I", data, data.index(b"##CG") + 96, 4_670_243)
    path.write_bytes(data)
    with pytest.raises(MeasurementError, match="time, chassis.z, a_x lies in records longer than"):
        table(path, "MDF4")


def test_what_is_left_out_shifts_no_clock(tmp_path):
    """An empty matrix stands before the times, in the order of the file."""
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file["a"] = np.zeros((0, 3))
        file["chassis.z"] = files.Z
        file["other"] = np.ones(50)
        file["time"] = files.TIME
    found = table(tmp_path / "r.h5", "HDF5")
    clock = by_name(found)["chassis.z"][0].clock
    assert clock is not None
    assert found.columns[clock].name == "time"


ATTRIBUTES = {
    "MATLAB_class": np.ones(2),
    "unit": np.zeros(2, dtype=[("a", "f8")]),
    "units": h5py.Empty("f8"),
    "Unit": b"\xff\xfe" * 9000,
    "comment": ["a", "b"],
}


def test_odd_attributes_of_a_data_set_are_passed_over(tmp_path):
    with h5py.File(tmp_path / "r.h5", "w", libver="latest") as file:
        file["chassis.z"] = files.Z
        for name, value in ATTRIBUTES.items():
            file["chassis.z"].attrs[name] = value
    column, values = by_name(table(tmp_path / "r.h5", "HDF5"))["chassis.z"]
    assert (column.unit, column.comment) == ("", "")
    assert_allclose(values, files.Z)


def test_a_damaged_data_set_of_hdf5_leaves_the_others(tmp_path):
    """Zeros over the head of one."""
    with h5py.File(tmp_path / "r.h5", "w") as file:
        for name in ("a", "chassis.z"):
            file[name] = files.Z
        at = h5py.h5o.get_info(file["a"].id).addr
    with (tmp_path / "r.h5").open("r+b") as stream:
        stream.seek(at)
        stream.write(bytes(16))
    found = table(tmp_path / "r.h5", "HDF5")
    assert list(by_name(found)) == ["chassis.z"]
    assert "a is damaged or of an unusual type" in found.warnings[0]


@pytest.mark.parametrize("name", ["a\u2028b", "a\nb", "a\x85b", "a\u202eb"])
def test_a_name_is_one_line_that_runs_one_way(name):
    assert plain(name) == "a b"


@pytest.mark.filterwarnings("ignore:File contains")
@pytest.mark.parametrize("name", ["r.rsp", "r.erg", "r.zip"])
def test_converted_line_ends_of_plain_numbers_are_recognized(tmp_path, name):
    """Each line feed made two bytes; the numbers hold some."""
    write, kind, _ = files.WRITERS[name]
    write(tmp_path / name)
    wrong = tmp_path / name
    if name == "r.zip":
        wrong, kind = tmp_path / "inner.erg", "CarMaker ERG"
    data = wrong.read_bytes()
    assert b"\n" in data
    wrong.write_bytes(data.replace(b"\n", b"\r\n"))
    assert "a conversion of line ends" in refusal(lambda: table(wrong, kind))


def test_a_variable_of_a_mat_file_is_read_without_those_before_it(tmp_path, monkeypatch):
    """Of thousands, each would else take the time of all."""
    savemat(tmp_path / "r.mat", {"a": np.arange(5000.0), "z": files.Z})
    read, given = scipy.io.loadmat, []
    monkeypatch.setattr(
        "scipy.io.loadmat",
        lambda one, **how: given.append(one.getbuffer().nbytes) or read(one, **how),
    )
    assert_allclose(by_name(table(tmp_path / "r.mat", "MAT 5"))["z"][1], files.Z)
    assert given == [128 + 56 + 8 * 5000, 128 + 56 + 8 * 50]


def test_converted_line_ends_of_a_mat_file_of_one_variable_are_recognized(tmp_path):
    """The one line feed lies in the numbers, where nothing but their number is told."""
    savemat(tmp_path / "r.mat", {"x": np.array([1.0, np.frombuffer(b"\n" * 8)[0], 3.0])})
    data = (tmp_path / "r.mat").read_bytes()
    assert data.count(b"\n") == 8
    (tmp_path / "r.mat").write_bytes(data.replace(b"\n", b"\r\n", 1))
    with pytest.raises(ValueError, match="bytes behind the last variable"):
        table(tmp_path / "r.mat", "MAT 5")


@pytest.mark.parametrize("even", [True, False])
def test_converted_line_ends_of_a_binary_universal_file_are_recognized(tmp_path, even):
    """As it is written by Windows, all of its text ends in two bytes, and it is sound."""
    files.uff(tmp_path / "r.uff", binary=True, even=even)
    data = (tmp_path / "r.uff").read_bytes()
    for before, after in ((b"NONE\n", b"NONE\r\n"), (b"\n", b"\r\n")):
        (tmp_path / "r.uff").write_bytes(data.replace(before, after))
        found = table(tmp_path / "r.uff", "UFF58")
        if before == b"NONE\n":
            assert_allclose(by_name(found)["chassis.z"][1], files.Z)
    assert "data set 1: its numbers are damaged" in refusal(lambda: found.values(0))


@pytest.mark.parametrize(
    ("data", "added"),
    [
        (b"ab\r\nc\r\n", 2),
        (b"ab\nc\r\n", 0),
        (b"\nab\r\n", 0),
        (b"abc", 0),
        (b"a" * ((1 << 20) - 1) + b"\r\n" + b"b" * (1 << 20) + b"\r\n", 2),
    ],
)
def test_line_ends_put_in_are_counted(data, added):
    """The last lie on either side of where the reading is cut."""
    assert line_ends_converted(np.frombuffer(data, np.uint8)) == added


def test_a_carmaker_recording_that_ends_within_a_record_is_told(tmp_path):
    files.erg(tmp_path / "r.erg")
    data = (tmp_path / "r.erg").read_bytes()
    (tmp_path / "r.erg").write_bytes(data[:-5])
    found = table(tmp_path / "r.erg", "CarMaker ERG")
    assert found.columns[0].samples == 49
    assert any("ends within a record" in said for said in found.warnings)


def test_a_time_history_shorter_than_it_declares_is_refused(tmp_path):
    files.rpc(tmp_path / "r.rsp")
    data = (tmp_path / "r.rsp").read_bytes()
    (tmp_path / "r.rsp").write_bytes(data[:-7])
    said = refusal(lambda: table(tmp_path / "r.rsp", "RPC III"))
    assert "header expects more data than present; export it again" in said


def test_converted_line_ends_of_utf_16_are_recognized(tmp_path):
    """A byte put in at each line end shifts every other line by half a character."""
    files.csv(tmp_path / "r.csv")
    data = (tmp_path / "r.csv").read_text().encode("utf-16-le").replace(b"\n", b"\r\n")
    said = refusal(lambda: parse_run(data, "r.csv"))
    assert said.startswith("r.csv: line 1: the text is damaged by a conversion of line ends")


def test_a_text_without_numbers_has_no_columns():
    found = CsvFile(io.BytesIO(b"time [s],chassis.z [mm]\n\n"), "r.csv")
    assert "no samples stand below the header" in refusal(lambda: found.columns)


def test_a_cell_is_shown_as_it_is_written():
    for cell, shown in (("2\u00b0", "2\u00b0"), ("\x7f3", "\ufffd3"), ("4\ud800", "4\ufffd")):
        data = f"time [s],chassis.z [mm]\n0,1\n1,{cell}\n".encode("utf-8", "surrogatepass")
        said = refusal(lambda: parse_run(data, "r.csv"))
        assert f"line 3, column chassis.z [mm]: '{shown}" in said
        assert "is not a number; write a plain decimal number." in said


def test_numbers_that_measure_nothing_are_refused_where_they_stand(tmp_path):
    z = files.Z.copy()
    z[7] = 1e300
    with TdmsWriter(tmp_path / "r.tdms") as writer:
        properties = {"wf_increment": 0.01, "unit_string": "m"}
        writer.write_segment([ChannelObject("ride", "chassis.z", z, properties)])
    said = refusal(lambda: read_run(tmp_path / "r.tdms"))
    assert "sample 8, column chassis.z: 1e+300 is too large" in said


@pytest.mark.parametrize("step", [1e308, 5e-324, 0.0, -1.0, float("nan"), float("inf")])
def test_a_step_that_is_none_tells_no_time(step):
    listing = Listing("r.rsp", "RPC III")
    listing.add(Column("z", "m", 50, step=step), None)
    assert listing.columns()[0].step is None


def test_times_closer_than_any_clock_counts_do_not_increase():
    """Between them, a straight line would rise by more than a number holds."""
    with pytest.raises(MeasurementError, match="r.csv: sample 2: time 4.940656458e-324 s does not"):
        require_increasing(np.array([0.0, 5e-324, 1.0]), lambda k: f"sample {k + 1}", "r.csv")


def test_an_error_is_one_line_whatever_it_repeats():
    said = str(RideError(f"r.json: a\nb\u2028c\0{'x' * 500} is not known."))
    assert said == f"r.json: a b c {'x' * 160}... is not known."
