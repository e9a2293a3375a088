"""MAT 5 (MATLAB's -v6 and -v7), by scipy: vectors, and the vectors within structures.

A matrix is up to 64 columns. Structures are gone through: `s.time` is the time of the other
vectors of its length in `s` and in what lies in it, as in Simulink's {time, signals.values}; a
structure of Time and Data, as a time series is exported, is one column. Names are joined by points.
Objects, functions and cells are left out.
"""

import io
import math
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeasurementError
from .listing import (
    MOST_SAMPLES,
    WIDEST,
    Listing,
    first_text,
    matrix_columns,
    numbers,
    plain,
)
from .mat5_heads import HEAD, Head, heads
from .table import Array, Column, Table

DEEPEST = 8
"""Most structures within each other."""

MOST_RECORDS = 1000
"""Most elements of an array of structures."""

LARGEST = 1_000_000_000
"""Longest MAT 5 file, bytes; a variable is read as a whole."""

CUT = (
    "is cut short, since the file ends within it; what came after it is missing, so transfer the"
    " file again"
)
"""Why the last variable of a file that was cut is not read."""

_NUMERIC = frozenset(
    ("double", "single")
    + tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
)
_REASONS = {
    "char": "is text",
    "cell": "is a cell array",
    "sparse": "is a sparse matrix",
    "function": "is a function, which is never read",
    "object": "is an object, which is never read: save its time and data as plain vectors",
    "opaque": "is an object, which is never read: save its time and data as plain vectors",
}
_UNITS = ("unit", "units", "Unit", "Units")


class Mat5File(Table):
    """A MAT file of version 5; vectors on their own are only read when asked for."""

    def __init__(self, path: Path, source: str, kind: str):
        self.source, self.kind, self.comment = source, kind, ""
        self._path = path
        size = path.stat().st_size
        if size > LARGEST:
            raise MeasurementError(
                f"{source}: a MAT 5 file of more than {LARGEST / 1e9:g} GB is not read; save it"
                ' with "-v7.3".'
            )
        self._listing = Listing(source, kind)
        self._found: list[tuple[tuple[str, ...], Column, Any]] = []
        with path.open("rb") as stream:
            for head in heads(stream):
                if head.begin + head.length > size:
                    self._listing.leave_out(head.name or "a variable", CUT)
                else:
                    self._variable(head)
        self._listing.add_timed(self._found)
        self.columns, self.warnings = self._listing.columns(), self._listing.warnings()
        self._places = self._listing.places
        self._held: tuple[Head | None, Any] = (None, None)

    def _variable(self, head: Head) -> None:
        name, shape = head.name, head.shape
        if not name:
            return  # MATLAB's own bookkeeping of objects
        elements = math.prod(shape)
        if min(shape, default=0) < 0 or elements > WIDEST * MOST_SAMPLES:
            self._listing.leave_out(name, f"declares more than {MOST_SAMPLES} samples")
        elif head.complex:
            self._listing.leave_out(name, "is complex")
        elif head.form in _NUMERIC:
            self._array((plain(name),), name, shape, "", head)
        elif head.form == "struct" and elements > MOST_RECORDS:
            self._listing.leave_out(name, "is a structure of too many elements")
        elif head.form == "struct":
            self._struct((plain(name),), self._load(head), 1)
        else:
            self._listing.leave_out(name, _REASONS.get(head.form, "holds no plain numbers"))

    def _load(self, head: Head) -> Any:
        """One variable, as that of a file which holds no other: scipy looks through all before."""
        from scipy.io import loadmat

        with self._path.open("rb") as stream:
            alone = stream.read(HEAD)
            stream.seek(head.begin)
            alone += stream.read(head.length)
        kept = loadmat(io.BytesIO(alone), struct_as_record=True)
        if head.name not in kept:
            raise MeasurementError(
                f"{self.source}: {plain(head.name) or 'a variable'} cannot be read; save it again."
            )
        return kept[head.name]

    def _array(
        self, path: tuple[str, ...], name: str, shape: tuple[int, ...], unit: str, data: Any
    ) -> None:
        """List a vector or matrix; `data` is the array itself, or the head to load it by."""
        if len(shape) != 2:
            self._listing.leave_out(name, "has more than two dimensions")
            return
        if 0 in shape:
            self._listing.leave_out(name, "holds no samples")
            return
        along = 0 if shape[1] == 1 or (shape[0] > 1 and shape[1] <= WIDEST) else 1
        width = shape[1 - along] if shape[0] > 1 and shape[1] > 1 else 1
        if width > WIDEST:
            self._listing.leave_out(name, f"has more than {WIDEST} columns")
            return
        for k, title in enumerate(matrix_columns(plain(name), width)):
            own = path if width == 1 else (*path[:-1], title)
            column = Column(title, unit, shape[along], ".".join(path[:-1]))
            self._found.append((own, column, (data, along, k)))

    def _struct(self, path: tuple[str, ...], records: Any, depth: int) -> None:
        """List what a structure, or an array of them, holds."""
        if depth > DEEPEST or records.dtype.names is None:
            self._listing.leave_out(".".join(path), "lies beyond what is searched")
            return
        several = records.size > 1
        for number, record in enumerate(records.reshape(-1)):
            here = (*path[:-1], f"{path[-1]}({number + 1})") if several else path
            fields = {plain(name): record[name] for name in records.dtype.names}
            unit = first_text(*(_text(fields.get(key)) for key in _UNITS), _data_unit(fields))
            title = first_text(_text(fields.get("label")), _text(fields.get("signalName")))
            for name, value in fields.items():
                inner = (*here, name)
                if not isinstance(value, np.ndarray):
                    self._listing.leave_out(".".join(inner), _REASONS["object"])
                elif value.dtype.names:
                    self._struct(inner, value, depth + 1)
                elif value.dtype.kind in "iufb" and value.size > 1:
                    self._field(inner, value, unit, title)
                elif value.dtype.kind == "O" and value.size:
                    self._listing.leave_out(".".join(inner), _REASONS["cell"])

    def _field(self, path: tuple[str, ...], value: Any, unit: str, title: str) -> None:
        last = path[-1].lower()
        if last == "values":
            shown = title or ".".join(path[:-1])
        elif last == "data":
            shown = ".".join(path[:-1])
        else:
            shown, unit = ".".join(path), "" if last in ("time", "t") else unit
        self._array(path, shown, value.shape, unit, value)

    def values(self, index: int) -> Array:
        """The numbers of one column."""
        data, along, k = self._places[index]
        if isinstance(data, Head):
            if self._held[0] != data:
                self._held = (data, self._load(data))
            data = self._held[1]
        return numbers(data[:, k] if along == 0 else data[k, :])


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.dtype.kind == "U" and value.size == 1:
        return plain(value.reshape(-1)[0])
    return ""


def _data_unit(fields: dict[str, Any]) -> str:
    """DataInfo.Units of a time series."""
    info = fields.get("DataInfo")
    if not isinstance(info, np.ndarray) or not info.dtype.names or info.size != 1:
        return ""
    return _text(info.reshape(-1)[0]["Units"]) if "Units" in info.dtype.names else ""
