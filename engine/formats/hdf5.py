"""HDF5 and MAT 7.3, by h5py: MATLAB, Python and many measurement systems.

Every data set of numbers in one dimension is a column, one of two dimensions up to 64 of them, and
each field of a compound data set. Units are attributes called unit or units. The time of a column
is the data set called time (t, Zeit, ...) of its length in its group or the nearest above. Links
to elsewhere, data kept in other files and references are never followed.
"""

from pathlib import Path
from typing import Any

from .listing import (
    MOST_SAMPLES,
    WIDEST,
    Listing,
    first_text,
    matrix_columns,
    numbers,
    plain,
)
from .table import Array, Column, Table

DEEPEST = 20
"""Most groups within each other."""

MOST_OBJECTS = 100_000
"""Most groups and data sets that are looked at."""

DAMAGE = (OSError, RuntimeError, KeyError, TypeError, ValueError)
"""What h5py raises at a part of a file that cannot be read."""

_UNITS = ("unit", "units", "Unit", "Units", "UNIT", "unit_string")
_BOOKKEEPING = ("#refs#", "#subsystem#")


class Hdf5File(Table):
    """An HDF5 file; one of MATLAB has its names joined by points and its arrays turned."""

    def __init__(self, path: Path, source: str, kind: str):
        import h5py

        self._h5py = h5py
        self.source, self.kind, self.comment = source, kind, ""
        self._file = h5py.File(path, "r", locking=False)
        self._matlab = kind == "MAT 7.3"
        self._listing = Listing(source, kind)
        self._found: list[tuple[tuple[str, ...], Column, Any]] = []
        self._seen = 0
        self._walk(self._file, ())
        self._listing.add_timed(self._found)
        self.columns, self.warnings = self._listing.columns(), self._listing.warnings()
        self._places = self._listing.places

    def _walk(self, group: Any, path: tuple[str, ...]) -> None:
        """Go through the hard links of a group; nothing else is opened."""
        for name in group:
            self._seen += 1
            here = (*path, plain(name))
            shown = self._name(here)
            if self._seen > MOST_OBJECTS or len(path) > DEEPEST:
                self._listing.leave_out(shown, "lies beyond what is searched")
                return
            if path == () and name in _BOOKKEEPING and self._matlab:
                continue
            if not isinstance(group.get(name, getlink=True), self._h5py.HardLink):
                self._listing.leave_out(shown, "is a link, which is not followed")
                continue
            try:
                item = group[name]
                if isinstance(item, self._h5py.Group):
                    self._walk(item, here)
                elif isinstance(item, self._h5py.Dataset):
                    self._take(item, here)
            except DAMAGE:
                self._listing.leave_out(shown, "is damaged or of an unusual type")

    def _take(self, data: Any, path: tuple[str, ...]) -> None:
        name, why = self._name(path), self._unreadable(data)
        if why:
            self._listing.leave_out(name, why)
            return
        shape = data.shape
        # MATLAB's column after column is h5py's row after row.
        if len(shape) == 2 and 1 in shape:
            across, width, samples = 0 if shape[0] == 1 else 1, 1, max(shape)
        elif len(shape) == 2:
            across = 0 if self._matlab else 1
            width, samples = shape[across], shape[1 - across]
        else:
            across, width, samples = None, 1, shape[0]
        if width > WIDEST:
            self._listing.leave_out(name, f"has more than {WIDEST} columns")
            return
        unit = first_text(*(self._text(data, key) for key in _UNITS))
        comment = first_text(self._text(data, "comment"), self._text(data, "description"))
        group = "/".join(path[:-1])
        if data.dtype.names:
            for field in data.dtype.names:
                if data.dtype[field].kind in "iuf" and data.dtype[field].shape == ():
                    column = Column(plain(field), "", samples, name)
                    self._found.append(((*path, plain(field)), column, (data, None, 0, field)))
            return
        for k, title in enumerate(matrix_columns(name, width)):
            column = Column(title, unit, samples, group, comment=comment)
            own = path if width == 1 else (*path[:-1], title)
            self._found.append((own, column, (data, across, k, None)))

    def _unreadable(self, data: Any) -> str:
        """Why a data set is not taken, or nothing; no data are touched."""
        created = data.id.get_create_plist()
        if data.is_virtual:
            return "is put together from other files, which are not opened"
        if created.get_external_count():
            return "is kept in another file, which is not opened"
        if self._text(data, "MATLAB_class") in ("char", "cell"):
            return "is text"
        if data.dtype.names is None and data.dtype.kind not in "iufb":
            return "holds no plain numbers"
        if data.shape is None or data.shape == () or "MATLAB_empty" in data.attrs:
            return "holds no samples"
        if len(data.shape) > 2:
            return "has more than two dimensions"
        if data.size > WIDEST * MOST_SAMPLES or max(data.shape) > MOST_SAMPLES:
            return f"declares {data.size} numbers, more than {MOST_SAMPLES} samples"
        return ""

    def _text(self, data: Any, key: str) -> str:
        if key not in data.attrs:
            return ""
        try:
            if data.attrs.get_id(key).get_storage_size() > 10_000:
                return ""
            value = data.attrs[key]
        except (TypeError, ValueError, OSError, RuntimeError):  # empty, or of a type unknown
            return ""
        return plain(value) if isinstance(value, (str, bytes)) else ""

    def _name(self, path: tuple[str, ...]) -> str:
        return plain(".".join(path) if self._matlab else path[-1])

    def values(self, index: int) -> Array:
        """The numbers of one column."""
        return self.part(index, 0, self.columns[index].samples)

    def part(self, index: int, begin: int, count: int) -> Array:
        """Some numbers of one column; only the chunks that hold them are read."""
        data, across, k, field = self._places[index]
        rows = slice(begin, begin + count)
        if field is not None:
            return numbers(data.fields(field)[rows])
        if across is None:
            return numbers(data[rows])
        return numbers(data[k, rows] if across == 0 else data[rows, k])
