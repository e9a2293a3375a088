"""Files that are damaged or no recordings: one sentence each, or what is left of them is read.

Oracle: what was done to the file, which the sentence must name.
"""

import gzip
import io
import pickle
import re
import struct
import zipfile

import numpy as np
import pytest
from ridetune.engine.errors import MeasurementError
from ridetune.engine.extras import how_to_install
from ridetune.engine.formats import readers
from ridetune.engine.formats.child import Bounds
from ridetune.engine.formats.opening import opened
from scipy.io import savemat

from tests import files_of_kinds as files

from .refusals import held, read_all, refusal


def packed(**members):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in members.items():
            archive.writestr(name.replace("__", "/"), data)
    return stream.getvalue()


def encrypted():
    data = bytearray(packed(recording=b"1"))
    # The flag of encryption, in the local head and in the directory.
    data[6] |= 1
    data[data.index(b"PK\x01\x02") + 8] |= 1
    return bytes(data)


def array_file():
    stream = io.BytesIO()
    np.save(stream, np.zeros(3))
    return stream.getvalue()


FOREIGN = {
    "array.npy": (array_file(), "is a NumPy array"),
    "arrays.npz": (packed(**{"a.npy": array_file()}), "is an archive of NumPy arrays"),
    "object.pkl": (pickle.dumps({"time": [1, 2]}), "is a pickle of Python, which is never opened"),
    "run.csv.gz": (gzip.compress(b"time,chassis.z\n0,1\n"), "is packed with gzip; unpack it"),
    "run.xlsx": (packed(xl__workbook="<xml/>"), "is an Excel workbook; save the sheet as CSV"),
    "secret.zip": (encrypted(), "is an encrypted zip archive; unpack it"),
    "two.zip": (packed(a="1", b="2"), "is a zip archive; unpack it and send one of the files"),
    "pair.zip": (packed(**{"a.erg": "1", "b.txt": "2"}), "exactly a CarMaker recording NAME.erg"),
    "old.xls": (b"\xd0\xcf\x11\xe0" + bytes(600), "is an old Excel workbook"),
    "empty.csv": (b"", "the file is empty; export the recording again"),
    "empty.mf4": (b"", "the file is empty; export the recording again"),
    "logger.mf4": (b"UnFinMF 4.10    " + bytes(600), "finalize it with the logger's own program"),
    "index.tdms_index": (b"TDSh" + bytes(100), "is the index of a TDMS file"),
    "locked.parquet": (b"PARE" + bytes(100) + b"PARE", "is an encrypted Parquet file"),
    "four.mat": (struct.pack("<5i", 0, 2, 2, 0, 2) + b"a\0" + bytes(32), 'the option "-v7"'),
    "road.crg": (b"$CT\ncomment\n$!*****\n$ROAD_CRG\n", "is an OpenCRG road, not a recording"),
    "noise.bin": (bytes(range(256)) * 4, "is a binary file, not text"),
    "wide.csv": (b"time," * 5_000_000 + b"\n1\n", "is longer than 100000 characters"),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_what_is_no_recording_is_named(tmp_path, name):
    data, said = FOREIGN[name]
    assert said in refusal(held(tmp_path, name, data))


@pytest.mark.parametrize("name", [name for name in files.WRITERS if name != "r.csv"])
def test_a_file_cut_short_is_refused_or_told(tmp_path, name):
    """Half of the bytes: refused, or what is left is read and is what was written."""
    write, _, off = files.WRITERS[name]
    write(tmp_path / name)
    data = (tmp_path / name).read_bytes()
    path = held(tmp_path, name, data[: len(data) // 2])
    try:
        found, said = read_all(path, Bounds()), ""
    except MeasurementError as error:
        found, said = [], str(error)
    assert found or (said.startswith(name) and said.endswith("."))
    for channel, values in found:
        if channel in files.CHANNELS:
            written = files.CHANNELS[channel][0][: len(values)]
            np.testing.assert_allclose(values, written, rtol=0, atol=off)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kept", [0.3, 0.9])
def test_a_mat_file_cut_within_a_variable_is_read_up_to_it(tmp_path, compressed, kept):
    """Oracle: where the last of three variables begins in the file, and what the first two hold."""
    rng = np.random.default_rng(8)
    whole = {name: rng.standard_normal((500, 1)) for name in ("time", "chassis_z", "Vx")}
    path = tmp_path / "cut.mat"
    savemat(path, dict(list(whole.items())[:2]), do_compression=compressed)
    begin = path.stat().st_size
    savemat(path, whole, do_compression=compressed)
    data = path.read_bytes()
    path.write_bytes(data[: begin + int(kept * (len(data) - begin))])
    with opened(path, path.name, apart=True) as table:
        assert [one.name for one in table.columns] == ["time", "chassis_z"]
        np.testing.assert_array_equal(table.values(1), whole["chassis_z"][:, 0])
        [said] = table.warnings
    assert "Vx is cut short, since the file ends within it" in said
    path.write_bytes(data[: begin + 30])
    with opened(path, path.name, apart=True) as table:
        assert len(table.columns) == 2
        assert "is cut short, since the file ends within it" in table.warnings[0]


@pytest.mark.parametrize("binary", [False, True])
def test_a_uff_file_that_ends_within_a_data_set_says_so(tmp_path, binary):
    """All but the last of its bytes: the first data set is whole, the second has no end."""
    files.uff(tmp_path / "r.uff", binary=binary)
    data = (tmp_path / "r.uff").read_bytes().rstrip()
    path = held(tmp_path, "r.uff", data[:-2])
    with opened(path, "r.uff") as table:
        assert [column.name for column in table.columns] == ["chassis.z"]
        assert any("the last data set is cut short" in said for said in table.warnings)


def test_a_spectrum_is_named(tmp_path):
    files.uff(tmp_path / "r.uff")
    text = (tmp_path / "r.uff").read_text()
    # Function type 2, an auto spectrum, in the first columns of record 6.
    assert text.count("    1         0    0") == 2
    spectra = text.replace("    1         0    0", "    2         0    0")
    said = refusal(held(tmp_path, "r.uff", spectra.encode()))
    assert "chassis.z, chassis.a_x is a spectrum, not a time history" in said


def test_a_missing_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(readers, "find_spec", lambda name: None)
    files.tdms(tmp_path / "r.tdms")
    how = re.escape(how_to_install("formats"))
    with pytest.raises(MeasurementError, match=f"TDMS needs nptdms.*; {how}, or"):
        readers.read_as("TDMS", tmp_path / "r.tdms", "r.tdms", {})
