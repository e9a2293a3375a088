"""Files that declare too much, bring objects, lead elsewhere or end their reader: a sentence each,
in bounded time and memory.

Oracle: what was done to the file, which the sentence must name.
"""

import struct
import tracemalloc
import zlib

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from ridetune.engine.errors import MeasurementError
from ridetune.engine.formats.erg import ErgFile
from ridetune.engine.formats.hdf5 import Hdf5File
from ridetune.engine.formats.kinds import ERG_ZIP
from ridetune.engine.formats.opening import opened
from scipy.io import savemat

from tests import files_of_kinds as files

from .refusals import held, refusal


def mat_bomb(declared):
    """A compressed variable that unpacks to `declared` bytes of zeros."""
    squeeze = zlib.compressobj(9)
    flags = struct.pack("<IIII", 6, 8, 6, 0) + struct.pack("<IIii", 5, 8, declared // 8, 1)
    name = struct.pack("<II", 1, 1) + b"x".ljust(8, b"\0")
    head = flags + name + struct.pack("<II", 9, declared)
    parts = [squeeze.compress(struct.pack("<II", 14, len(head) + declared) + head)]
    parts += [squeeze.compress(bytes(1 << 20)) for _ in range(declared >> 20)]
    packed = b"".join([*parts, squeeze.flush()])
    text = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    return text + struct.pack("<II", 15, len(packed)) + packed


@pytest.fixture(scope="module")
def bomb():
    """33.5 million samples in some hundred kilobytes."""
    return mat_bomb(1 << 28)


def test_a_mat_bomb_is_refused_by_what_it_declares(tmp_path, bomb):
    assert len(bomb) < 500_000
    said = refusal(held(tmp_path, "bomb.mat", bomb))
    assert "x declares more than 25000000 samples" in said


def test_the_parent_never_holds_what_a_file_only_declares(tmp_path, bomb):
    path = held(tmp_path, "bomb.mat", bomb)
    tracemalloc.start()
    refusal(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 5_000_000


def test_a_parquet_bomb_is_refused_by_what_it_declares(tmp_path):
    runs = pa.table({"x": pa.array(np.zeros(26_000_000, np.int8)).dictionary_encode().cast("int8")})
    pq.write_table(runs, tmp_path / "r.parquet", compression="zstd")
    assert (tmp_path / "r.parquet").stat().st_size < 1_000_000
    assert "x declares more than 25000000 samples" in refusal(tmp_path / "r.parquet")


def test_a_carmaker_bomb_is_refused_by_what_it_declares(tmp_path, monkeypatch):
    """Before a byte of the recording is unpacked: here of one packed in an unknown way."""
    monkeypatch.setattr("ridetune.engine.formats.erg.MOST_SAMPLES", 49)
    files.erg_zip(tmp_path / "r.zip")
    data = bytearray((tmp_path / "r.zip").read_bytes())
    for at in (8, data.index(b"PK\x01\x02") + 10):  # the method of the first member
        data[at : at + 2] = b"\x63\x00"
    path = held(tmp_path, "bomb.zip", bytes(data))
    with pytest.raises(MeasurementError, match="24 bytes make 50 samples, more than 49; cut the"):
        ErgFile(path, "bomb.zip", ERG_ZIP)


@pytest.mark.parametrize("kind", [0, 8, 19, 20, 500])
def test_a_mat_file_with_an_impossible_type_of_data_is_refused(tmp_path, kind):
    """Some of these types end scipy's reader with a segmentation fault (scipy issue 25829)."""
    savemat(tmp_path / "r.mat", {"x": np.zeros((1, 1))})
    data = bytearray((tmp_path / "r.mat").read_bytes())
    assert data[176:180] == struct.pack("<I", 9)  # the tag of the numbers: eight bytes each
    data[176:180] = struct.pack("<I", kind)
    said = refusal(held(tmp_path, "r.mat", bytes(data)))
    assert "damaged" in said


def test_objects_functions_and_cells_of_mat_files_are_never_read(tmp_path):
    savemat(tmp_path / "r.mat", {"c": np.array([1, "a"], dtype=object), "t": "text"})
    said = refusal(tmp_path / "r.mat")
    assert "c is a cell array" in said
    assert "t is text" in said


def test_an_opaque_object_of_a_mat_file_is_left_out(tmp_path):
    """An element of class 17, as MATLAB writes its time series, before a vector."""
    savemat(tmp_path / "r.mat", {"time": np.arange(12.0), "chassis": {"z": np.arange(12.0)}})
    data = (tmp_path / "r.mat").read_bytes()
    texts = [b"ts", b"MCOS", b"timeseries"]
    inside = struct.pack("<IIII", 6, 8, 17, 0)
    for text in texts:
        inside += struct.pack("<II", 1, len(text)) + text.ljust(-(-len(text) // 8) * 8, b"\0")
    matrix = struct.pack("<IIII", 6, 8, 6, 0) + struct.pack("<IIii", 5, 8, 1, 1)
    matrix += struct.pack("<II", 1, 0) + struct.pack("<IId", 9, 8, 1.0)
    inside += struct.pack("<II", 14, len(matrix)) + matrix
    opaque = struct.pack("<II", 14, len(inside)) + inside
    path = held(tmp_path, "r.mat", data[:128] + opaque + data[128:])
    with opened(path, "r.mat") as table:
        assert [column.name for column in table.columns] == ["time", "chassis.z"]
        assert any("is an object, which is never read" in said for said in table.warnings)


def only(tmp_path, put):
    path = tmp_path / "r.h5"
    with h5py.File(path, "w") as file:
        put(file)
    return path


def outside(file):
    file.create_dataset("x", (40,), "u1", external=[("/etc/passwd", 0, 40)])


def virtual(file):
    layout = h5py.VirtualLayout((40,), "u1")
    layout[:] = h5py.VirtualSource("/etc/passwd", "x", (40,))
    file.create_virtual_dataset("x", layout)


def declaring(file):
    file.create_dataset("x", (1 << 39,), "f8", chunks=(1 << 16,))


def referring(file):
    group = file.create_group("g")
    del file["g"]
    file.create_dataset("x", (3,), h5py.ref_dtype)
    assert group


def soft(file):
    file["x"] = h5py.SoftLink("/nowhere")


def external(file):
    file["x"] = h5py.ExternalLink("/etc/passwd", "/x")


def circular(file):
    file.create_group("a")["a"] = file["/"]


HOSTILE = [
    (outside, "x is kept in another file, which is not opened"),
    (virtual, "x is put together from other files, which are not opened"),
    (declaring, "x declares 549755813888 numbers"),
    (referring, "x holds no plain numbers"),
    (soft, "x is a link, which is not followed"),
    (external, "x is a link, which is not followed"),
    (circular, "lies beyond what is searched"),
]


@pytest.mark.parametrize(("put", "said"), HOSTILE)
def test_hdf5_never_leads_elsewhere(tmp_path, put, said):
    path = only(tmp_path, put)
    assert path.stat().st_size < 10_000
    assert said in refusal(path)


def test_a_strange_attribute_spoils_nothing(tmp_path):
    def strange(file):
        column = file.create_dataset("x", data=np.arange(5.0))
        column.attrs["MATLAB_class"] = np.arange(3)
        column.attrs.create("unit", b"V" * 20_000, dtype="S20000")
        column.attrs["units"] = h5py.Empty("f8")
        column.attrs["Unit"] = "mm"
        text = file.create_dataset("t", data=np.arange(5, dtype=np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")

    table = Hdf5File(only(tmp_path, strange), "r.h5", "HDF5")
    assert [(column.name, column.unit) for column in table.columns] == [("x", "mm")]
    assert "t is text" in table.warnings[0]


def test_an_hdf5_bomb_is_refused_by_what_it_declares(tmp_path):
    def bomb(file):
        zeros = file.create_dataset("x", (1 << 27,), "f8", chunks=(1 << 20,), compression="gzip")
        zeros[: 1 << 20] = 0.0

    assert "x declares 134217728 numbers" in refusal(only(tmp_path, bomb))
