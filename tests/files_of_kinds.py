"""Files of every kind, each written by its own library (CarMaker's and RPC III's by their layout).

All hold the same two channels over the same half second, so that one oracle serves all.
"""

import gc
import struct
import warnings
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pyuff
import rpc3
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

TIME = 0.01 * np.arange(50)
Z = 12.0 * np.sin(30.0 * TIME)
A_X = 1.5 * np.cos(20.0 * TIME)
CHANNELS = {"chassis.z": (Z, "mm"), "chassis.a_x": (A_X, "m/s^2")}


def mdf(path: Path, version: str = "4.10") -> None:
    with MDF(version=version) as file:
        file.append(
            [Signal(one, TIME, name=name, unit=unit) for name, (one, unit) in CHANNELS.items()],
            acq_name="ride",
            common_timebase=True,
        )
        file.save(path, overwrite=True)


def mdf3(path: Path) -> None:
    mdf(path, "3.30")


def mat5(path: Path) -> None:
    chassis = {
        "z": {"time": TIME, "signals": {"values": Z[:, None], "label": "chassis.z", "unit": "mm"}},
        "a_x": {"Time": TIME, "Data": A_X[:, None], "DataInfo": {"Units": "m/s^2"}},
    }
    savemat(path, {"chassis": chassis}, oned_as="column", do_compression=True)


def mat73(path: Path) -> None:
    """As MATLAB writes it: HDF5 behind a block of 512 bytes, vectors as rows."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["time"] = TIME[None, :]
        for name, (values, unit) in CHANNELS.items():
            data = file.create_dataset(name.replace(".", "/"), data=values[None, :])
            data.attrs["MATLAB_class"] = np.bytes_("double")
            data.attrs["unit"] = unit
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        ride = file.create_group("ride")
        ride["time"] = TIME
        for name, (values, unit) in CHANNELS.items():
            data = ride.create_dataset(name, data=values, chunks=(16,), compression="gzip")
            data.attrs["unit"] = unit


def tdms(path: Path) -> None:
    with TdmsWriter(path) as writer:
        waveform = {"wf_increment": 0.01, "wf_start_offset": 0.0}
        writer.write_segment(
            [
                ChannelObject("ride", name, values, {"unit_string": unit, **waveform})
                for name, (values, unit) in CHANNELS.items()
            ]
        )


def uff(path: Path, binary: bool = False, even: bool = True) -> None:
    uff_sets(pyuff.UFF(str(path)), binary, even)


def uff_sets(file: pyuff.UFF, binary: bool, even: bool) -> None:
    for name, (values, unit) in CHANNELS.items():
        write_set(
            file,
            {
                "type": 58,
                "func_type": 1,
                "rsp_node": 1,
                "rsp_dir": 3,
                "ref_node": 0,
                "ref_dir": 0,
                "id1": name,
                "x": TIME,
                "data": values,
                "ordinate_axis_units_lab": unit,
                "abscissa_axis_units_lab": "s",
                "abscissa_spec_data_type": 17,
                "ordinate_spec_data_type": 8,
                "orddenom_spec_data_type": 0,
                "abscissa_spacing": int(even),
                "binary": int(binary),
            },
        )


def write_set(file: pyuff.UFF, data: dict) -> None:
    """Add a data set; pyuff leaves the file open behind a binary one."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        file.write_sets(data, "add")
        gc.collect()


def uff_binary(path: Path) -> None:
    uff(path, binary=True)


def uff_uneven(path: Path) -> None:
    uff(path, even=False)


def rpc(path: Path, kind: type = float) -> None:
    channels = [rpc3.Channel(name, unit, 0.01, one) for name, (one, unit) in CHANNELS.items()]
    rpc3.rpc3.progressbar = False
    rpc3.write(str(path), channels, datatype=kind)


def rpc_whole(path: Path) -> None:
    rpc(path, int)


def parquet(path: Path) -> None:
    fields = [pa.field("time [s]", pa.float64())]
    fields += [
        pa.field(name, pa.float64(), metadata={"unit": unit})
        for name, (_, unit) in CHANNELS.items()
    ]
    columns = [TIME, *(values for values, _ in CHANNELS.values())]
    pq.write_table(pa.table(columns, schema=pa.schema(fields)), path)


def erg(path: Path) -> None:
    """By the layout that IPG describes; cmerg reads it (see the test)."""
    fields = [("Time", "<f8"), ("chassis.z", "<f8"), ("chassis.a_x", "<f4"), ("pad", "S4")]
    records = np.zeros(len(TIME), dtype=fields)
    records["Time"], records["chassis.z"], records["chassis.a_x"] = TIME, Z, A_X
    head = b"CM-ERG\0\0" + bytes([1, 0]) + struct.pack("<H", records.itemsize) + bytes(4)
    path.write_bytes(head + records.tobytes())
    described = [
        ("Time", "Double", "s"),
        ("chassis.z", "Double", "mm"),
        ("chassis.a_x", "Float", "m/s^2"),
        ("$none$", "4 Bytes", "-"),
    ]
    lines = ["#INFOFILE1.1", "File.Format = erg", "File.ByteOrder = LittleEndian"]
    lines += ["File.DateInSeconds = 1500000000", ""]
    for number, (name, kind, unit) in enumerate(described, 1):
        lines += [f"File.At.{number}.Name = {name}", f"File.At.{number}.Type = {kind}"]
        lines += [f"Quantity.{name}.Unit = {unit}", ""]
    path.with_name(f"{path.name}.info").write_text("\n".join(lines))


def erg_zip(path: Path) -> None:
    inner = path.with_name("inner.erg")
    erg(inner)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for one in (inner, inner.with_name("inner.erg.info")):
            archive.write(one, one.name)


def csv(path: Path) -> None:
    titles = [f"{name} [{unit}]" for name, (_, unit) in CHANNELS.items()]
    lines = [",".join(["time [s]", *titles])]
    lines += [",".join(map(repr, row)) for row in np.column_stack([TIME, Z, A_X]).tolist()]
    path.write_text("\n".join(lines))


WRITERS = {
    "r.csv": (csv, "CSV", 0.0),
    "r.mf4": (mdf, "MDF4", 0.0),
    "r.mdf": (mdf3, "MDF3", 0.0),
    "r.mat": (mat5, "MAT 5", 0.0),
    "r73.mat": (mat73, "MAT 7.3", 0.0),
    "r.h5": (hdf5, "HDF5", 0.0),
    "r.tdms": (tdms, "TDMS", 0.0),
    # pyuff writes eleven digits after the first: half a unit of the last one of numbers from 10 on.
    "r.uff": (uff, "UFF58", 5.1e-11),
    "binary.uff": (uff_binary, "UFF58", 0.0),
    "uneven.uff": (uff_uneven, "UFF58", 5.1e-11),
    # float32 has 24 bits; of numbers up to 12 that is 12 / 2**24.
    "r.rsp": (rpc, "RPC III", 12.0 / 2**24),
    # Whole numbers count in 1 / 32752 of the greatest value; a step either way by float32's scale.
    "whole.rsp": (rpc_whole, "RPC III", 1.1 * 12.0 / 32752),
    "r.parquet": (parquet, "Parquet", 0.0),
    "r.erg": (erg, "CarMaker ERG", 1.5 / 2**24),
    "r.zip": (erg_zip, "CarMaker ERG", 1.5 / 2**24),
}
"""Name of a file -> who writes it, its kind, and how far its numbers may be off by its own form."""
