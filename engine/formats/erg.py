"""CarMaker ERG (IPG): records of fixed length, described by the text NAME.erg.info beside them.

A record holds one sample of every quantity. 16 bytes stand before the first: "CM-ERG", two zero
bytes, the version, the byte order (0 little, 1 big endian) and the length of a record, which must
be what the description says. Times are those of the quantity Time, in s.
"""

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeasurementError
from .kinds import ERG_ZIP, erg_pair
from .listing import (
    CONVERTED,
    MOST_SAMPLES,
    Listing,
    first_text,
    line_ends_converted,
    plain,
)
from .table import Array, Column, Table

HEAD_BYTES = 16
LONGEST_DESCRIPTION = 20_000_000
"""Longest description, bytes."""

LARGEST_UNPACKED = 1_000_000_000
"""Longest recording in an archive, bytes."""

_TYPES = {
    "Float": "f4",
    "Double": "f8",
    "LongLong": "i8",
    "ULongLong": "u8",
    "Long": "i4",
    "ULong": "u4",
    "Int": "i4",
    "UInt": "u4",
    "Short": "i2",
    "UShort": "u2",
    "Char": "i1",
    "UChar": "u1",
}
_BYTES = re.compile(r"(\d{1,6}) Bytes?")


class ErgFile(Table):
    """A CarMaker recording, beside its description or packed with it."""

    def __init__(self, path: Path, source: str, kind: str):
        self.source, self.kind, self.comment = source, "CarMaker ERG", ""
        packed = kind == ERG_ZIP
        size, info = self._packed(path) if packed else self._beside(path)
        stated = dict(_stated(info))
        order = ">" if stated.get("File.ByteOrder", "").lower().startswith("big") else "<"
        fields, factors, units = self._fields(stated, order)
        record = np.dtype(fields)
        width = max(record.itemsize, 1)
        samples, rest = divmod(size - HEAD_BYTES, width)
        if samples > MOST_SAMPLES:
            raise MeasurementError(
                f"{source}: its records of {record.itemsize} bytes make {samples} samples, more"
                f" than {MOST_SAMPLES}; cut the recording or give the .erg.info that was written"
                " with it."
            )
        data = self._unpacked(path) if packed else np.memmap(path, np.uint8, "r")
        if data[:6].tobytes() != b"CM-ERG":
            raise MeasurementError(
                f"{source}: this is no CarMaker recording; choose the .erg file."
            )
        said = int.from_bytes(data[10:12].tobytes(), "little" if order == "<" else "big")
        if said not in (0, record.itemsize & 0xFFFF):
            raise MeasurementError(
                f"{source}: its records are {said} bytes long but described as {record.itemsize};"
                " give the .erg.info that was written with it."
            )
        added = line_ends_converted(data[HEAD_BYTES:])
        if added and (added - rest) % width == 0:
            raise MeasurementError(f"{source}: {CONVERTED}.")
        self._records = data[HEAD_BYTES : HEAD_BYTES + samples * record.itemsize].view(record)
        listing = Listing(source, self.kind)
        found = []
        for name, kind_of_field in fields:
            if kind_of_field.lstrip("<>|")[0] in "fiu":
                unit = units[name] or ("s" if name.lower() == "time" else "")
                column = Column(plain(name), unit, samples)
                found.append(((name,), column, (name, *factors[name])))
            elif not name.startswith("\0"):
                listing.leave_out(name, "holds no plain numbers")
        listing.add_timed(found)
        self.columns, self.warnings = listing.columns(), listing.warnings()
        if rest:
            self.warnings += (
                "The file ends within a record; it was cut short or changed in transfer.",
            )
        self._places = listing.places

    def _beside(self, path: Path) -> tuple[int, bytes]:
        """Length of the recording and its description, in a file of its own."""
        info = path.with_name(f"{path.name}.info")
        if not info.is_file():
            raise MeasurementError(
                f"{self.source}: a CarMaker recording needs its description; keep"
                f" {self.source}.info beside it, or pack the two into one .zip and send that."
            )
        with info.open("rb") as stream:
            return path.stat().st_size, self._short(stream.read(LONGEST_DESCRIPTION + 1))

    def _packed(self, path: Path) -> tuple[int, bytes]:
        """The same of an archive, whose recording is not unpacked."""
        with zipfile.ZipFile(path) as archive:
            recording, description = erg_pair(archive, self.source)
            if recording.file_size > LARGEST_UNPACKED:
                raise MeasurementError(
                    f"{self.source}: {plain(recording.filename)} unpacks to more than"
                    f" {LARGEST_UNPACKED / 1e9:g} GB; cut the recording."
                )
            with archive.open(description) as stream:
                return recording.file_size, self._short(stream.read(LONGEST_DESCRIPTION + 1))

    def _unpacked(self, path: Path) -> Any:
        with zipfile.ZipFile(path) as archive:
            recording, _ = erg_pair(archive, self.source)
            with archive.open(recording) as stream:
                return np.frombuffer(stream.read(recording.file_size), np.uint8)

    def _short(self, info: bytes) -> bytes:
        if len(info) > LONGEST_DESCRIPTION:
            raise MeasurementError(
                f"{self.source}: its description is longer than {LONGEST_DESCRIPTION / 1e6:.0f} MB;"
                " give the .erg.info that was written with it."
            )
        return info

    def _fields(self, stated: dict[str, str], order: str) -> tuple[Any, dict, dict]:
        """Name and type of each field of a record, its factor and offset, and its unit."""
        fields: list[tuple[str, str]] = []
        factors, units, number = {}, {}, 1
        while (name := stated.get(f"File.At.{number}.Name")) is not None:
            said = stated.get(f"File.At.{number}.Type", "")
            gap = _BYTES.fullmatch(said)
            form = f"S{gap[1]}" if gap else _TYPES.get(said)
            if form is None or name in factors:
                what = "there twice" if form else f"of the unknown type '{plain(said)}'"
                raise MeasurementError(
                    f"{self.source}: quantity {number} of its description, {plain(name)}, is"
                    f" {what}; give the .erg.info that was written with it."
                )
            # Bytes that only fill up a record have a name of dollar signs or none.
            key = f"\0{number}" if gap and name.strip("$ ") in ("", "none") else name
            fields.append((key, form if gap else order + form))
            factors[name] = factors[key] = (
                self._number(stated, name, "Factor", 1.0),
                self._number(stated, name, "Offset", 0.0),
            )
            units[key] = first_text(stated.get(f"Quantity.{name}.Unit"))
            units[key] = "" if units[key] == "-" else units[key]
            number += 1
        if not fields:
            raise MeasurementError(
                f"{self.source}: its description names no quantities; give the .erg.info that was"
                " written with it."
            )
        return fields, factors, units

    def _number(self, stated: dict[str, str], name: str, key: str, default: float) -> float:
        text = stated.get(f"Quantity.{name}.{key}", "")
        try:
            return float(text) if text else default
        except ValueError as error:
            raise MeasurementError(
                f"{self.source}: Quantity.{plain(name)}.{key} of its description is"
                f" '{plain(text)}'; write a number."
            ) from error

    def values(self, index: int) -> Array:
        """Physical values of one quantity."""
        return self.part(index, 0, self.columns[index].samples)

    def part(self, index: int, begin: int, count: int) -> Array:
        """Some physical values of one quantity."""
        name, factor, offset = self._places[index]
        return factor * self._records[name][begin : begin + count].astype(np.float64) + offset


def _stated(info: bytes) -> Iterator[tuple[str, str]]:
    """The entries `key = value` of a description; a continued text (key:) is left out."""
    try:
        text = info.decode("utf-8")
    except UnicodeDecodeError:
        text = info.decode("latin-1")
    for line in text.splitlines():
        key, equals, value = line.partition("=")
        if equals:
            yield key.strip().strip('"'), value.strip().strip('"')
