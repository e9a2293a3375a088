"""Files that are damaged, foreign or hostile: one sentence each, in bounded time and memory.

Oracle: what was done to the file, which the sentence must name.
"""

import gzip
import io
import os
import pickle
import re
import struct
import tracemalloc
import zipfile
import zlib

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from ridetune.engine.errors import MeasurementError
from ridetune.engine.extras import how_to_install
from ridetune.engine.formats import readers
from ridetune.engine.formats.child import Bounds
from ridetune.engine.formats.confine import landlock_version
from ridetune.engine.formats.erg import ErgFile
from ridetune.engine.formats.hdf5 import Hdf5File
from ridetune.engine.formats.kinds import ERG_ZIP
from ridetune.engine.formats.opening import opened
from ridetune.engine.formats.syscalls import filtered
from ridetune.engine.measurement import parse_run
from scipy.io import savemat

from tests import files_of_kinds as files


def read_all(path, bounds):
    with opened(path, path.name, apart=True, bounds=bounds) as table:
        return [(column.name, table.values(k)) for k, column in enumerate(table.columns)]


def refusal(path, bounds=None):
    """The one sentence a file is refused with, wherever that happens."""
    with pytest.raises(MeasurementError) as caught:
        read_all(path, bounds or Bounds())
    said = str(caught.value)
    assert said.startswith(path.name)
    assert said.endswith(".")
    assert "Traceback" not in said
    assert not re.search(r"\w(Error|Exception)\b", said)
    assert "\n" not in said
    return said


def held(tmp_path, name, data):
    path = tmp_path / name
    path.write_bytes(data)
    return path


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


@pytest.mark.parametrize("kind", [0, 8, 19, 20, 500])
def test_a_mat_file_with_an_impossible_type_of_data_is_refused(tmp_path, kind):
    """Some of these types end scipy's reader with a segmentation fault (scipy issue 25829)."""
    savemat(tmp_path / "r.mat", {"x": np.zeros((1, 1))})
    data = bytearray((tmp_path / "r.mat").read_bytes())
    assert data[176:180] == struct.pack("<I", 9)  # the tag of the numbers: eight bytes each
    data[176:180] = struct.pack("<I", kind)
    said = refusal(held(tmp_path, "r.mat", bytes(data)))
    assert "damaged" in said


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


def test_a_spectrum_is_named(tmp_path):
    files.uff(tmp_path / "r.uff")
    text = (tmp_path / "r.uff").read_text()
    # Function type 2, an auto spectrum, in the first columns of record 6.
    assert text.count("    1         0    0") == 2
    spectra = text.replace("    1         0    0", "    2         0    0")
    said = refusal(held(tmp_path, "r.uff", spectra.encode()))
    assert "chassis.z, chassis.a_x is a spectrum, not a time history" in said


@pytest.mark.parametrize("binary", [False, True])
def test_a_uff_file_that_ends_within_a_data_set_says_so(tmp_path, binary):
    """All but the last of its bytes: the first data set is whole, the second has no end."""
    files.uff(tmp_path / "r.uff", binary=binary)
    data = (tmp_path / "r.uff").read_bytes().rstrip()
    path = held(tmp_path, "r.uff", data[:-2])
    with opened(path, "r.uff") as table:
        assert [column.name for column in table.columns] == ["chassis.z"]
        assert any("the last data set is cut short" in said for said in table.warnings)


def slow(monkeypatch, code):
    """A reader that does something else, under the name of TDMS."""
    monkeypatch.setattr("ridetune.engine.formats.child.COMMAND", code)


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


STUB = (
    "import ridetune.engine.formats.answering as b; "
    "b.read_as = lambda *_: ({}); import ridetune.engine.formats.answers as a; a.main()"
)


@pytest.mark.parametrize(
    ("does", "bounds", "said"),
    [
        ("__import__('os').kill(__import__('os').getpid(), 11)", Bounds(), "crashed (SIGSEGV)"),
        ("__import__('os').kill(__import__('os').getpid(), 9)", Bounds(), "its reader was killed"),
        ("[0 for _ in iter(int, 1)]", Bounds(cpu=1), "more than 1 s of processor time"),
        (
            "__import__('time').sleep(60)",
            Bounds(wall=1.0),
            "took more than 1 s, as a damaged file may",
        ),
        ("bytearray(1 << 32)", Bounds(), "takes more than 2 GB of memory, as a damaged"),
        ("__import__('os').write(int(__import__('sys').argv[1]), b'{}' * 99)", Bounds(), "nothing"),
        ("open('garbage', 'wb').write(bytes(1 << 21))", Bounds(), "cannot be read as TDMS; it is"),
        ("1 / 0", Bounds(), "cannot be read as TDMS; it is damaged, cut short"),
    ],
)
def test_a_reader_gone_wrong_is_one_sentence(tmp_path, monkeypatch, does, bounds, said):
    """Oracle: what the reader was made to do."""
    slow(monkeypatch, STUB.format(does))
    path = held(tmp_path, "r.tdms", b"TDSm" + bytes(100))
    assert said in refusal(path, bounds)


def test_a_child_has_nothing_of_its_parents(tmp_path, monkeypatch):
    """No variables, no standard input, an empty folder that goes with it."""
    monkeypatch.setenv("RIDETUNE_TOKEN", "secret")
    code = (
        "(_ for _ in ()).throw(__import__('ridetune').engine.errors.MeasurementError("
        "str([__import__('os').environ.get('RIDETUNE_TOKEN'), __import__('sys').stdin.read(),"
        " __import__('os').listdir(), __import__('os').getcwd()]) + '.'))"
    )
    slow(monkeypatch, STUB.format(code))
    path = held(tmp_path, "r.tdms", b"TDSm" + bytes(100))
    with pytest.raises(MeasurementError) as caught, opened(path, "r.tdms"):
        pass
    said = str(caught.value)
    assert said.startswith("[None, '', [], ")
    assert not os.path.exists(said.split("'")[-2])


TRIES = """
import os, socket, subprocess, sys
tries = {
    "makes": lambda: open(victim + ".new", "w"),
    "writes": lambda: open(victim, "r+"),
    "truncates": lambda: os.truncate(victim, 0),
    "removes": lambda: os.unlink(victim),
    "renames": lambda: os.rename(victim, victim + ".new"),
    "reads": lambda: open(victim),
    "lists": lambda: os.listdir(os.path.dirname(victim)),
    "passwords": lambda: open("/etc/passwd"),
    "signals": lambda: os.kill(os.getppid(), 0),
    "chmods": lambda: os.chmod(victim, 0o777),
    "touches": lambda: os.utime(victim, (0, 0)),
    "forks": lambda: os.fork() or os._exit(0),
    "runs": lambda: subprocess.run([sys.executable, "-c", "0"]),
    "connects": lambda: socket.socket(),
    "escapes": os.setsid,
    "works": lambda: open("own", "w").write("1"),
}
done = []
for name, attempt in tries.items():
    try:
        attempt()
        done.append(name)
    except OSError:
        pass
import ridetune.engine.errors
raise ridetune.engine.errors.MeasurementError(" ".join(done) + ".")
"""


@pytest.mark.skipif(
    landlock_version() < 6 or not filtered(), reason="this system confines a child less"
)
def test_a_child_can_do_nothing_outside_its_folder(tmp_path, monkeypatch):
    """Nor read anything else, nor have processes of its own, which its limits would not end."""
    victim = tmp_path / "elsewhere" / "victim"
    victim.parent.mkdir()
    victim.write_text("kept")
    before = victim.stat()
    tries = f"victim = {str(victim)!r}\n{TRIES}"
    slow(monkeypatch, STUB.format(f"exec({tries!r}, {{}})"))
    path = held(tmp_path, "r.tdms", b"TDSm" + bytes(100))
    with pytest.raises(MeasurementError, match=r"^works\.$"), opened(path, "r.tdms"):
        pass
    assert victim.read_text() == "kept"
    assert list(victim.parent.iterdir()) == [victim]
    after = victim.stat()
    assert (after.st_mode, after.st_mtime_ns) == (before.st_mode, before.st_mtime_ns)


def test_a_missing_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(readers, "find_spec", lambda name: None)
    files.tdms(tmp_path / "r.tdms")
    how = re.escape(how_to_install("formats"))
    with pytest.raises(MeasurementError, match=f"TDMS needs nptdms.*; {how}, or"):
        readers.read_as("TDMS", tmp_path / "r.tdms", "r.tdms", {})


def test_the_parent_never_holds_what_a_file_only_declares(tmp_path, bomb):
    path = held(tmp_path, "bomb.mat", bomb)
    tracemalloc.start()
    refusal(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 5_000_000


def test_text_from_strangers_is_refused_as_our_own_is():
    """The same sentence from the child as from this process."""
    data = b"time [s],chassis.z [mm]\n" + b"".join(b"%d,%d\n" % (k, k) for k in range(20))
    data += b"21,x\n"
    said = []
    for apart in (False, True):
        with pytest.raises(MeasurementError) as caught:
            parse_run(data, "run.csv", apart=apart)
        said.append(str(caught.value))
    assert said[0] == said[1]
    assert "line 22, column chassis.z [mm]: 'x' is not a number" in said[0]
