"""What a file is, by its first bytes; its name only where those of two kinds are alike."""

import re
import zipfile
from pathlib import Path
from typing import BinaryIO

from ..errors import MeasurementError

HEAD = 4096
"""Bytes that are looked at."""

CSV = "CSV"
ERG_ZIP = "CarMaker ERG in a zip archive"
LARGEST_DIRECTORY = 1000
"""Most files of a zip archive that is looked into."""

_PACKED = {
    b"\x1f\x8b": "gzip",
    b"BZh": "bzip2",
    b"\xfd7zXZ\x00": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"7z\xbc\xaf\x27\x1c": "7z",
    b"Rar!": "rar",
}
_AS_CSV = "export the recording as CSV"
_FOREIGN = {
    b"\x93NUMPY": f"is a NumPy array, which does not name its columns; {_AS_CSV}",
    b"\xd0\xcf\x11\xe0": "is an old Excel workbook or an Office document; save the sheet as CSV",
    b"%PDF": f"is a PDF; {_AS_CSV}",
    b"\x7fELF": f"is a program; {_AS_CSV}",
    b"MZ": f"is a program; {_AS_CSV}",
    b"ARROW1": "is an Arrow file; save the table as Parquet",
    b"FEA1": "is a Feather file; save the table as Parquet",
    b"PARE": "is an encrypted Parquet file; save it without encryption",
    b"TDSh": "is the index of a TDMS file; choose the .tdms file itself",
    b"SQLite format 3": f"is a database; {_AS_CSV}",
    b"\x89PNG": f"is a picture; {_AS_CSV}",
    b"\xff\xd8\xff": f"is a picture; {_AS_CSV}",
    b"UnFinMF ": "was not finished by its logger; finalize it with the logger's own program",
}
_PICKLE = re.compile(rb"\x80[\x02-\x05]")
_UFF = re.compile(rb"\s*-1\s*[\r\n]+\s*\d{2,4}\s?[bB]?[ \d]*[\r\n]")
_ERG_INFO = re.compile(rb"\s*#?.*File\.Format\s*=\s*erg", re.IGNORECASE | re.DOTALL)


def kind_of(stream: BinaryIO, source: str) -> str:
    """The kind of a file; MeasurementError for those that are not read, with the remedy."""
    return kind_by_head(stream, source) or _zipped(stream, source)


def kind_by_head(stream: BinaryIO, source: str) -> str:
    """The same without a look into a zip archive, whose kind is "" here."""
    stream.seek(0)
    head = stream.read(HEAD)
    for magic, program in _PACKED.items():
        if head.startswith(magic):
            raise _refused(source, f"is packed with {program}; unpack it and send what is in it")
    for magic, what in _FOREIGN.items():
        if head.startswith(magic):
            raise _refused(source, what)
    if _PICKLE.match(head) and (b"c" in head[:64] or b"\x8c" in head[:64] or head[2:3] in b"}]K("):
        raise _refused(source, f"is a pickle of Python, which is never opened; {_AS_CSV}")
    if head.startswith(b"PK\x03\x04") or head.startswith(b"PK\x05\x06"):
        return ""
    return _recognized(head, source)


def _recognized(head: bytes, source: str) -> str:
    suffix = Path(source).suffix.lower()
    if head.startswith(b"MDF     "):
        return "MDF4" if head[8:9] == b"4" else "MDF3"
    if head.startswith(b"MATLAB 7.3") or (head[512:520] == _HDF5 and suffix == ".mat"):
        return "MAT 7.3"
    if any(head[at : at + 8] == _HDF5 for at in (0, 512, 1024, 2048)):
        return "HDF5"
    if head[126:128] in (b"IM", b"MI") and head[124:126] in (b"\x00\x01", b"\x01\x00"):
        return "MAT 5"
    for magic, kind in _MAGIC.items():
        if head.startswith(magic):
            return kind
    if head[:32].rstrip(b"\0 ") == b"FORMAT" and len(head) >= 128:
        return "RPC III"
    if _UFF.match(head):
        return "UFF58"
    if suffix == ".mat":
        raise _refused(
            source, 'is no MAT file of version 5 or 7.3; save it in MATLAB with the option "-v7"'
        )
    if head.startswith(b"$") and (b"$CT" in head or b"$ROAD_CRG" in head):
        raise _refused(
            source, "is an OpenCRG road, not a recording; drive on it with ridetune simulate --road"
        )
    if suffix == ".info" or (b"File.At.1.Name" in head and _ERG_INFO.match(head)):
        raise _refused(
            source,
            "is the description beside a CarMaker recording; choose the .erg with it beside, or"
            " pack the two into one .zip and send that",
        )
    return CSV


_HDF5 = b"\x89HDF\r\n\x1a\n"
_MAGIC = {b"TDSm": "TDMS", b"PAR1": "Parquet", b"CM-ERG": "CarMaker ERG"}


def _zipped(stream: BinaryIO, source: str) -> str:
    try:
        with zipfile.ZipFile(stream) as archive:
            entries = archive.infolist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError, RuntimeError) as error:
        raise _refused(source, "is a damaged zip archive; pack or send it again") from error
    names = [entry.filename for entry in entries[:LARGEST_DIRECTORY]]
    if any(name.startswith("xl/") for name in names):
        raise _refused(source, "is an Excel workbook; save the sheet as CSV")
    if any(entry.flag_bits & 0x1 for entry in entries):
        raise _refused(source, "is an encrypted zip archive; unpack it and send what is in it")
    if names and all(name.endswith(".npy") for name in names):
        raise _refused(source, f"is an archive of NumPy arrays; {_AS_CSV}")
    if any(name.lower().endswith(".erg") for name in names):
        return ERG_ZIP
    raise _refused(source, "is a zip archive; unpack it and send one of the files in it")


def erg_pair(archive: zipfile.ZipFile, source: str) -> tuple[zipfile.ZipInfo, zipfile.ZipInfo]:
    """The recording and its description in an archive that holds exactly these two."""
    entries = {entry.filename: entry for entry in archive.infolist() if not entry.is_dir()}
    recordings = [name for name in entries if name.lower().endswith(".erg")]
    if len(recordings) != 1 or len(entries) != 2 or f"{recordings[0]}.info" not in entries:
        raise _refused(
            source,
            "must hold exactly a CarMaker recording NAME.erg and its description NAME.erg.info;"
            " pack the two and nothing else",
        )
    return entries[recordings[0]], entries[f"{recordings[0]}.info"]


def _refused(source: str, what: str) -> MeasurementError:
    return MeasurementError(f"{source}: the file {what}.")
