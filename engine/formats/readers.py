"""Who reads which kind, and what package that takes."""

from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import MeasurementError
from ..extras import how_to_install
from .kinds import CSV, ERG_ZIP
from .table import Table

ROAD = "OpenCRG"
"""The kind of a road, which is told and not looked for."""

HALF_TRACK = 0.75
"""How far left and right of a road's reference line the wheels run unless it is told, m."""


class Reader(NamedTuple):
    """A module here with its class, and the package it needs."""

    module: str
    name: str
    package: str = ""


READERS: Mapping[str, Reader] = {
    CSV: Reader("csv_file", "CsvFile.at"),
    "MDF3": Reader("mdf", "MdfFile", "asammdf"),
    "MDF4": Reader("mdf", "MdfFile", "asammdf"),
    "MAT 5": Reader("mat5", "Mat5File"),
    "MAT 7.3": Reader("hdf5", "Hdf5File", "h5py"),
    "HDF5": Reader("hdf5", "Hdf5File", "h5py"),
    "TDMS": Reader("tdms", "TdmsTable", "nptdms"),
    "UFF58": Reader("uff", "UffFile", "pyuff"),
    "RPC III": Reader("rpc", "RpcFile", "rpc3"),
    "Parquet": Reader("parquet", "ParquetTable", "pyarrow"),
    "CarMaker ERG": Reader("erg", "ErgFile"),
    ERG_ZIP: Reader("erg", "ErgFile"),
    ROAD: Reader("crg", "CrgFile", "pyopencrg"),
}

SUFFIXES = (
    *(".csv", ".txt", ".tsv", ".dat", ".asc", ".mf4", ".mdf", ".mf3", ".mat", ".h5", ".hdf5"),
    *(".hdf", ".tdms", ".uff", ".unv", ".uf58", ".rsp", ".rpc", ".tim", ".drv", ".parquet"),
    *(".erg", ".zip"),
)
"""What the names of recordings usually end in; the content decides."""


def missing_package(kind: str) -> str:
    """What to do where a kind cannot be read or written for want of a package; else empty."""
    package = READERS[kind].package
    if not package or find_spec(package) is not None:
        return ""
    how = how_to_install("formats")
    return f"{kind} needs {package}, which is not installed; {how}, or take CSV."


def require_package(kind: str) -> None:
    """Raise MeasurementError where a kind cannot be read or written."""
    if said := missing_package(kind):
        raise MeasurementError(said)


def read_as(kind: str, path: Path, source: str, options: Mapping[str, Any]) -> Table:
    """Open a file of a kind in this process; errors of the packages are those of the packages."""
    if said := missing_package(kind):
        raise MeasurementError(f"{source}: {said}")
    reader = READERS[kind]
    found: Any = import_module(f".{reader.module}", __package__)
    for name in reader.name.split("."):
        found = getattr(found, name)
    return found(path, source, kind, options) if kind == ROAD else found(path, source, kind)
