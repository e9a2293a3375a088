"""The heads of the variables of a MAT 5 file: name, class and dimensions, without their numbers.

    file    = 128 bytes of text, version and byte order | element ...
    element = type, length: 4 bytes each | data, padded to 8; a short one packs both into 4 bytes
    type 14 = a matrix: flags (type 6) with its class, dimensions (5), name (1), ...
    type 15 = such an element, compressed by zlib

An object of a class of MATLAB's own has no dimensions. Source: "MAT-File Format", MathWorks.
"""

import struct
import zlib
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

HEAD = 128
MATRIX, COMPRESSED = 14, 15
LONGEST_HEAD = 4096
"""Bytes of a variable that must hold its head."""

_CLASSES = (
    *("unknown", "cell", "struct", "object", "char", "sparse", "double", "single", "int8"),
    *("uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "function", "opaque"),
)


class Head(NamedTuple):
    """One variable; shape is () where it has none.

    begin, length : of its element with its type and length, bytes; a file that was cut ends before
    """

    name: str
    form: str
    shape: tuple[int, ...]
    complex: bool
    begin: int
    length: int


def heads(stream: BinaryIO) -> Iterator[Head]:
    """Every variable in the order of the file; ValueError for what is no MAT 5 file."""
    stream.seek(HEAD - 2)
    order = {b"IM": "<", b"MI": ">"}.get(stream.read(2))
    if order is None:
        raise ValueError("byte order")
    while True:
        tag = stream.read(8)
        if len(tag) < 8:
            # A conversion of line ends moves the last numbers behind the end of their variable.
            if tag.strip(b"\0"):
                raise ValueError("bytes behind the last variable")
            return
        kind, length = struct.unpack(f"{order}II", tag)
        start = stream.tell()
        data = stream.read(min(length, LONGEST_HEAD))
        place = start - 8, 8 + length
        try:
            yield Head(*_variable(kind, data, order), *place)
        except struct.error:
            if len(data) == min(length, LONGEST_HEAD):
                raise
            yield Head("", "", (), False, *place)
        stream.seek(start + length)


def _variable(kind: int, data: bytes, order: str) -> tuple[str, str, tuple[int, ...], bool]:
    """Name, class, dimensions and whether it is complex, by the first bytes of an element."""
    if kind == COMPRESSED:
        data = zlib.decompressobj().decompress(data, LONGEST_HEAD)
        kind, data = struct.unpack_from(f"{order}I", data)[0], data[8:]
    if kind != MATRIX:
        raise ValueError("type of element")
    return _head(data, order)


def _head(data: bytes, order: str) -> tuple[str, str, tuple[int, ...], bool]:
    flags, at = _element(data, 0, order)
    (word,) = struct.unpack_from(f"{order}I", flags)
    number = word & 0xFF
    form = _CLASSES[number] if number < len(_CLASSES) else "unknown"
    shape: tuple[int, ...] = ()
    if form != "opaque":
        dimensions, at = _element(data, at, order)
        shape = struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions)
    name, _ = _element(data, at, order)
    return name.rstrip(b"\0").decode("latin-1"), form, shape, bool(word & 0x800)


def _element(data: bytes, at: int, order: str) -> tuple[bytes, int]:
    """The data of the element at a place, and the place of the next."""
    (word,) = struct.unpack_from(f"{order}I", data, at)
    if word >> 16:
        return data[at + 4 : at + 4 + (word >> 16)], at + 8
    (length,) = struct.unpack_from(f"{order}I", data, at + 4)
    return data[at + 8 : at + 8 + length], at + 8 + -(-length // 8) * 8
