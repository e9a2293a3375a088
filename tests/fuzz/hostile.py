"""Files that are sound and hard to bear: the two channels of `files_of_kinds` among odd others.

Oracle: the two channels must come back as they were written, whatever stands beside them.
"""

import random
import struct
import zipfile
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pyopencrg
import pyuff
import rpc3
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter
from scipy import sparse
from scipy.io import savemat

from tests import files_of_kinds
from tests.files_of_kinds import A_X, CHANNELS, TIME, Z

NAMES = ("time", "t", "Zeit", "a/b", "a\nb", "\u00fc \u00b0", "x" * 300, "wheel.fl.z", "=1+1", ".")
NAMES += ("\u202eabc", "<b>", "NaN", "chassis.pitch", "chassis.z.z", "a\u2028b", "{x}", "%s")
UNITS = ("", "-", "m", "\u00b0", "m/s\u00b2", "1e9", "(", "furlong", "s", "ms", "x" * 300, "%")
REALS = (np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, 0.0, -0.0, 1e-3, -999.0, 2.0**63)
LENGTHS = (0, 1, 2, 49, 50, 50, 50, 51, 3000)


def odd(chance: random.Random, length: int | None = None) -> np.ndarray:
    """Numbers of some type that are not a measurement."""
    length = chance.choice(LENGTHS) if length is None else length
    form = chance.choice(["f8", "f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"])
    rng = np.random.default_rng(chance.randrange(2**32))
    values = rng.normal(0.0, 10.0 ** chance.randint(-9, 9), length)
    if chance.random() < 0.5:
        values[rng.random(length) < chance.choice([0.05, 1.0])] = chance.choice(REALS)
    if chance.random() < 0.3:
        values.sort()
    with np.errstate(all="ignore"):
        return values.astype(form)


def csv(path: Path, chance: random.Random) -> None:
    """Any delimiter, decimal sign, encoding and line end, with cells that hold no numbers."""
    delimiter, end = chance.choice(",;\t"), chance.choice(["\n", "\r\n", "\r"])
    comma = delimiter != "," and chance.random() < 0.5
    cells = ["", "nan", "inf", "x", "1e999", "-", "0", '"a"', "1" * 400, "1 2", "\u00e4"]
    names = [name for name in NAMES if not set(name) & set(',;\t\n\u2028"[(') and name != "time"]
    titles = [("time", "s", TIME), ("chassis.z", "mm", Z), ("chassis.a_x", "m/s^2", A_X)]
    titles += [(chance.choice(names), "", None) for _ in range(chance.randint(0, 5))]
    lines = [delimiter.join(f"{name} [{unit}]" if unit else name for name, unit, _ in titles)]
    odds = chance.choice([["1.5"], cells])
    for row in range(50):
        texts = [
            chance.choice(odds) if one is None else repr(float(one[row])) for *_, one in titles
        ]
        if comma:
            texts = [text.replace(".", ",") for text in texts]
        lines.append(delimiter.join(texts))
        if chance.random() < 0.02:
            lines.append("")
    encodings = ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-32"]
    path.write_bytes(end.join(lines).encode(chance.choice(encodings)))


def mdf(version: str) -> Callable[[Path, random.Random], None]:
    """Other groups with their own clocks, texts, whole numbers, invalid samples, conversions."""

    def write(path: Path, chance: random.Random) -> None:
        with MDF(version=version) as file:
            for _ in range(chance.randint(0, 3)):
                length = chance.choice(LENGTHS[1:])
                clock = odd(chance, length).astype(float)
                if chance.random() < 0.7:
                    clock = np.sort(np.nan_to_num(clock, posinf=1e9, neginf=-1e9))
                many, invalidates = chance.randint(1, 3), version >= "4"
                signals = [_signal(chance, clock, invalidates) for _ in range(many)]
                file.append(signals, acq_name=chance.choice(NAMES), common_timebase=True)
            sound = [Signal(one, TIME, name=n, unit=u) for n, (one, u) in CHANNELS.items()]
            file.append(sound, acq_name="ride", common_timebase=True)
            file.save(path, overwrite=True, compression=chance.choice([0, 1, 2]))

    return write


def _signal(chance: random.Random, clock: np.ndarray, invalidates: bool) -> Signal:
    values = odd(chance, len(clock))
    if chance.random() < 0.2:
        values = np.array([b"text"] * len(clock))
    conversion = None
    if chance.random() < 0.3 and values.dtype.kind in "iu":
        conversion = {"a": chance.choice(REALS), "b": chance.choice(REALS)}
    name, unit = chance.choice(NAMES), chance.choice(UNITS)
    encoding = "latin-1" if values.dtype.kind == "S" else None
    invalid = np.arange(len(clock)) % 3 == 0 if invalidates and chance.random() < 0.3 else None
    return Signal(
        values,
        clock,
        name=name,
        unit=unit,
        conversion=conversion,
        encoding=encoding,
        invalidation_bits=invalid,
    )


def mat5(path: Path, chance: random.Random) -> None:
    """Structures within structures, cells, texts, sparse and complex matrices, empty arrays."""
    inner: object = {"z": odd(chance)}
    for _ in range(chance.choice([0, 1, 12])):
        inner = {"s": inner, "time": odd(chance)}
    cell = np.empty(2, dtype=object)
    cell[:] = ["a", 1]
    records = np.array([(1.0, "a"), (2.0, "b")], dtype=[("a", object), ("b", object)])
    others = [inner, odd(chance), odd(chance), odd(chance)[:, None] * np.ones((1, 70)), cell]
    others += [records, "text", sparse.csc_matrix(np.eye(3)), 1j * np.ones(5), np.ones((2, 2, 2))]
    others += [np.zeros((0, 3)), np.ones(50, bool), np.array(["ab", "cd"]), chance.choice(REALS)]
    held = {"time": TIME, "chassis": {"z": Z, "a_x": A_X, "unit": chance.choice(UNITS)}}
    taken = chance.sample(others, chance.randint(0, 6))
    held |= {f"{chance.choice('abcdef')}{k}": one for k, one in enumerate(taken)}
    savemat(
        path, held, oned_as=chance.choice(["row", "column"]), do_compression=chance.random() < 0.5
    )


def hdf5(path: Path, chance: random.Random) -> None:
    """Deep groups, all types, filters, dimensions without data, odd attributes."""
    with h5py.File(path, "w", libver=chance.choice(["earliest", "latest"])) as file:
        files_of_ride(file, chance)
        for _ in range(chance.randint(0, 6)):
            group = file
            for _ in range(chance.choice([0, 1, 3, 40])):
                group = group.require_group(chance.choice(["g", "h", "\u00fc"]))
            name = chance.choice([one for one in NAMES if one != "."]) + chance.choice("12345678")
            if name not in group:
                _data_set(group, name, chance)


def files_of_ride(file: h5py.File, chance: random.Random) -> None:
    filters = chance.choice([{}, {"compression": "gzip"}, {"shuffle": True, "fletcher32": True}])
    filters = filters and {**filters, "chunks": (7,)}
    file.create_dataset("ride/time", data=TIME, **filters)
    for name, (values, unit) in CHANNELS.items():
        file.create_dataset(f"ride/{name}", data=values, **filters).attrs["unit"] = unit


def _data_set(group: h5py.Group, name: str, chance: random.Random) -> None:
    compound = np.zeros(50, dtype=[("time", "f8"), ("a", "i2"), ("b", "S3"), ("c", "f4", (3,))])
    what = [odd(chance), odd(chance), odd(chance).astype(">f4"), odd(chance).astype("f2"), "text"]
    what += [compound, np.ones((50, 3)), np.ones((3, 50)), np.ones((2, 70, 70)), 1j * np.ones(50)]
    what += [np.zeros((0, 3)), np.ones(50, bool), np.array([b"a", b"b"]), 1.0, h5py.Empty("f8")]
    kind = chance.randrange(5)
    if kind == 0:
        shape = chance.choice([(2**40,), (2**20, 2**20), (2**31, 1), (10**8,), (1, 10**9)])
        data = group.create_dataset(name, shape, "f8", chunks=True)
    elif kind == 1:
        data = group.create_dataset(name, (3,), h5py.vlen_dtype("i4"))
    else:
        data = group.create_dataset(name, data=chance.choice(what))
    for key in ("unit", "units", "comment", "MATLAB_class"):
        if chance.random() < 0.2:
            values = [
                chance.choice(UNITS),
                1.0,
                odd(chance),
                h5py.Empty("f8"),
                ["a", "b"],
                compound,
            ]
            data.attrs[key] = chance.choice(
                [*values, b"\xff\xfe", np.bytes_(b"double"), "x" * 9000]
            )


def mat73(path: Path, chance: random.Random) -> None:
    """The same behind MATLAB's block, whose groups are structures."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["time"] = TIME[None, :]
        for name, (values, unit) in CHANNELS.items():
            file[name.replace(".", "/")] = values[None, :]
            file[name.replace(".", "/")].attrs["unit"] = unit
        for k in range(chance.randint(0, 6)):
            _data_set(file, f"v{k}", chance)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def tdms(path: Path, chance: random.Random) -> None:
    """Several segments and groups, texts and dates, waveforms without sense."""
    with TdmsWriter(path) as writer:
        for k in range(chance.randint(0, 4)):
            dates = np.array(["2020-01-01T00:00:00", "2020-01-02"], "datetime64[us]")
            data = chance.choice([odd(chance), odd(chance), dates, ["a", "b\n"]])
            properties = {
                "wf_increment": chance.choice([*REALS, "x", 0, -1, 1]),
                "wf_start_offset": chance.choice([*REALS, "x", datetime(2020, 1, 1)]),
                "unit_string": chance.choice([*UNITS, 3]),
            }
            taken = {key: one for key, one in properties.items() if chance.random() < 0.7}
            names = chance.choice(["ride", *NAMES]), f"{chance.choice(NAMES)}{k}"
            writer.write_segment([ChannelObject(*names, data, taken)])
        waveform = {"wf_increment": 0.01, "wf_start_offset": 0.0}
        for begin, end in chance.choice([[(0, 50)], [(0, 20), (20, 50)]]):
            writer.write_segment(
                [
                    ChannelObject("ride", name, one[begin:end], {"unit_string": unit, **waveform})
                    for name, (one, unit) in CHANNELS.items()
                ]
            )


def uff(path: Path, chance: random.Random) -> None:
    """Sets of other types, spectra and complex ones, before the two."""
    file = pyuff.UFF(str(path))
    for _ in range(chance.randint(0, 2)):
        length = chance.choice([2, 7, 50])
        values = np.nan_to_num(odd(chance, length).astype(float), posinf=1e30, neginf=-1e30)
        values = np.clip(values, -1e90, 1e90)
        data = {
            "type": 58,
            "func_type": chance.choice([0, 1, 2, 4, 6]),
            "rsp_node": 7,
            "rsp_dir": 3,
        }
        data |= {"ref_node": 0, "ref_dir": 0, "id1": chance.choice(["NONE", "a", "x" * 70])}
        data |= {"x": np.linspace(0.0, 1.0, length), "binary": chance.randint(0, 1)}
        data["data"] = values * chance.choice([1.0, 1.0 + 1j])
        data["abscissa_spec_data_type"] = chance.choice([0, 17, 18])
        data["orddenom_spec_data_type"] = 0
        files_of_kinds.write_set(file, data)
    files_of_kinds.uff_sets(file, chance.random() < 0.5, chance.random() < 0.5)


def rpc(path: Path, chance: random.Random) -> None:
    """Other channels, and groups of other lengths."""
    channels = [rpc3.Channel(name, unit, 0.01, one) for name, (one, unit) in CHANNELS.items()]
    for _ in range(chance.randint(0, 4)):
        name = chance.choice(NAMES)[:60].encode("ascii", "replace").decode()
        values = np.clip(np.nan_to_num(odd(chance, 50).astype(float)), -1e30, 1e30)
        channels.append(rpc3.Channel(name, "m", 0.01, values))
    rpc3.rpc3.progressbar = False
    group = chance.choice([1, 8, 64, 2048])
    rpc3.write(str(path), channels, datatype=float, pts_per_group=group, overwrite=True)


def parquet(path: Path, chance: random.Random) -> None:
    """Nested, packed, timed and empty columns; row groups of all sizes."""
    fifty = [
        pa.array([[1, 2]] * 50),
        pa.array([{"a": 1.0, "b": [1]}] * 50),
        pa.array(["a", None] * 25),
        pa.array(["a"] * 50).dictionary_encode(),
        pa.array([1, None] * 25, pa.int8()),
        pa.array([None] * 50),
        pa.array([True] * 50),
        pa.array(range(50), pa.timestamp("ns", "UTC")),
        pa.array(range(50), pa.duration("us")),
        pa.array(range(50), pa.date32()),
        pa.array(range(50), pa.int32()).cast(pa.decimal128(20, 3)),
        pa.array([2**64 - 1] * 50, pa.uint64()),
        pa.array(np.arange(50, dtype=np.float16)),
        pa.array(odd(chance, 50)),
        pa.array(odd(chance, 50)),
    ]
    fields = [pa.field("time [s]", pa.float64())]
    columns = [pa.array(TIME)]
    for one in chance.sample(fifty, chance.randint(0, 6)):
        fields.append(
            pa.field(chance.choice(NAMES), one.type, metadata={"unit": chance.choice(UNITS)})
        )
        columns.append(one)
    for name, (values, unit) in CHANNELS.items():
        fields.append(pa.field(name, pa.float64(), metadata={"unit": unit}))
        columns.append(pa.array(values))
    pq.write_table(
        pa.table(columns, schema=pa.schema(fields)),
        path,
        compression=chance.choice(["none", "snappy", "gzip", "zstd", "lz4"]),
        row_group_size=chance.choice([1, 7, 50, 1000]),
        use_dictionary=chance.random() < 0.5,
        data_page_version=chance.choice(["1.0", "2.0"]),
    )


def erg(path: Path, chance: random.Random) -> None:
    """Quantities of every type with odd factors, in either byte order, packed or beside."""
    big = chance.random() < 0.3
    order = "><"[not big]
    types = {
        "Float": "f4",
        "Double": "f8",
        "LongLong": "i8",
        "ULong": "u4",
        "Short": "i2",
        "Char": "i1",
    }
    fields = [("Time", "Double", "s", TIME), ("chassis.z", "Double", "mm", Z)]
    fields += [("chassis.a_x", "Double", "m/s^2", A_X)]
    for k in range(chance.randint(0, 5)):
        name = "".join(one for one in chance.choice(NAMES) if one not in "\n\u2028=") + str(k)
        fields.append((name, chance.choice([*types, "3 Bytes"]), chance.choice(UNITS), None))
    chance.shuffle(fields)
    record = [
        (f"f{k}", order + types[t] if t in types else "S3") for k, (_, t, *_) in enumerate(fields)
    ]
    records = np.zeros(50, dtype=record)
    lines = [
        "#INFOFILE1.1",
        "File.Format = erg",
        f"File.ByteOrder = {'Big' if big else 'Little'}Endian",
    ]
    for k, (name, kind, unit, values) in enumerate(fields):
        if values is not None:
            records[f"f{k}"] = values
        elif chance.random() < 0.5:
            lines.append(f"Quantity.{name}.Factor = {chance.choice(REALS)}")
            lines.append(f"Quantity.{name}.Offset = {chance.choice(REALS)}")
        lines += [f"File.At.{k + 1}.Name = {name}", f"File.At.{k + 1}.Type = {kind}"]
        lines.append(f"Quantity.{name}.Unit = {unit}")
    length = struct.pack(order + "H", records.itemsize)
    data = b"CM-ERG\0\0" + bytes([1, big]) + length + bytes(4) + records.tobytes()
    info = chance.choice(["\n", "\r\n"]).join(lines).encode("utf-8", "replace")
    with zipfile.ZipFile(path, "w", chance.choice([0, 8, 12, 14])) as archive:
        archive.writestr("a.erg", data)
        archive.writestr("a.erg.info", info)


HEIGHT = 0.03 * np.sin(0.3 * np.arange(121))


def crg(path: Path, chance: random.Random) -> None:
    """Heights that only vary along the road, in every form, with a curved or steep line."""
    v = np.linspace(-1.5, 1.5, chance.choice([2, 3, 13]))
    z = HEIGHT[:, None] + np.zeros(len(v))
    beside = chance.random() < 0.3 and len(v) == 13
    if beside:
        z[:, [0, -1]] = np.nan
    options = {}
    if chance.random() < 0.3:
        options["heading"] = np.full(120, chance.choice([0.0, 0.01, 3.0]))
    if chance.random() < 0.3:
        options["slope"] = np.full(120, chance.choice([0.0, 0.01, 0.5]))
    if chance.random() < 0.3:
        options["comments"] = [
            chance.choice(NAMES).replace("\n", "")[:60].encode("ascii", "replace").decode()
        ]
    road = pyopencrg.CrgRoad(z, 0.1, v, **options)
    road.save(str(path), fmt=chance.choice(["KRBI", "KDBI", "LRFI", "LDFI"]))


HOSTILE: dict[str, Callable[[Path, random.Random], None]] = {
    "CSV": csv,
    "MDF3": mdf("3.30"),
    "MDF4": mdf("4.10"),
    "MAT 5": mat5,
    "MAT 7.3": mat73,
    "HDF5": hdf5,
    "TDMS": tdms,
    "UFF58": uff,
    "RPC III": rpc,
    "Parquet": parquet,
    "CarMaker ERG": erg,
    "OpenCRG": crg,
}
"""Who writes such a file of a kind."""
