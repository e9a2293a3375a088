"""UFF58, ASCII and binary, by pyuff: functions of time, one a data set.

The name is the first line of the data set's description or its response node and direction, the
unit that of the ordinate's axis. Where none is stated there, numbers of a known quantity are in the
units of the last data set 164 before, and turned into SI by it. Spectra and complex functions are
left out, by name.
"""

import math
import mmap
import re
from pathlib import Path
from typing import Any

from ..errors import MeasurementError
from ..units import UnitError, to_si
from .listing import CONVERTED, Listing, first_text, numbers, plain
from .table import Array, Column, Table

LARGEST = 400_000_000
"""Longest UFF file, bytes; it is searched as a whole."""

HEAD_LINES = 13
"""Lines of a data set before its numbers, two of which begin it."""

_TIME, _FREQUENCY = 17, 18
_SPECTRA = frozenset((2, 3, 4, 6, 9, 10, 12, 13))
"""Cross, auto and power spectra, frequency responses, coherences, transfer functions, ..."""

_ENDS = re.compile(rb"    -1(?=[\r\n]|$| {74})")
"""Both ends of a data set, as pyuff looks for them."""

_QUANTITIES = {
    8: ("length", "m"),
    11: ("length", "m/s"),
    12: ("length", "m/s^2"),
    9: ("force", "N"),
    13: ("force", "N"),
}
"""Displacement, velocity, acceleration, reaction and excitation force: by the number of a data
type, which factor of data set 164 it is divided by, and what results."""

_DIRECTIONS = {1: "+X", -1: "-X", 2: "+Y", -2: "-Y", 3: "+Z", -3: "-Z", 0: ""}
_SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}


class UffFile(Table):
    """A universal file with data sets 58."""

    def __init__(self, path: Path, source: str, kind: str):
        import pyuff

        self.source, self.kind, self.comment = source, kind, ""
        if path.stat().st_size > LARGEST:
            raise MeasurementError(
                f"{source}: a UFF file of more than {LARGEST / 1e6:.0f} MB is not read; export it"
                " in parts."
            )
        self._file: Any = pyuff.UFF(str(path))
        self._path = path
        self._held: tuple[int, Any] = (-1, None)
        listing = Listing(source, kind)
        self._said: list[str] = []
        self._factors: dict[str, float] = {}
        forms = self._file.get_set_types()
        for k, form in enumerate(forms):
            if form == 164:
                self._factors = self._units(k)
            elif form == 58:
                self._list(listing, k, self._file.read_sets(k, header_only=True))
        if _is_cut(path):
            listing.leave_out("the last data set", "is cut short")
        if 58 not in forms:
            listing.leave_out("the file", "holds no data set 58")
        self.columns = listing.columns()
        self.warnings = (*listing.warnings(), *self._said)
        self._places = listing.places

    def _list(self, listing: Listing, k: int, head: Any) -> None:
        name = _name(head) or f"data set {k + 1}"
        form, abscissa = head["func_type"], head["abscissa_spec_data_type"]
        if form in _SPECTRA or abscissa == _FREQUENCY:
            listing.leave_out(name, "is a spectrum, not a time history")
        elif head["ord_data_type"] in (5, 6):
            listing.leave_out(name, "is complex, not a time history")
        elif form not in (0, 1) and abscissa != _TIME:
            listing.leave_out(name, "is no time history")
        else:
            self._add(listing, k, name, head)

    def _units(self, k: int) -> dict[str, float]:
        """The factors of a data set 164: file units over SI."""
        try:
            found = self._file.read_sets(k)
            factors = {one: float(found[one]) for one in ("length", "force")}
        except Exception:  # pyuff raises no other
            factors = {}
        if not factors or not all(0.0 < one < math.inf for one in factors.values()):
            self._said.append(
                f"The units in data set {k + 1} cannot be read; see in which the columns are."
            )
            return {}
        return factors

    def _unit(self, name: str, head: Any) -> tuple[str, float]:
        """The unit of a data set, and what its numbers are multiplied by to be in it."""
        label = _label(head["ordinate_axis_units_lab"])
        kind, si = _QUANTITIES.get(int(head["ordinate_spec_data_type"]), ("", ""))
        factor = self._factors.get(kind)
        if factor is None or not label:
            return (label, 1.0) if factor is None else (si, 1.0 / factor)
        try:
            stated = to_si(label, si)[0]
        except UnitError:
            return label, 1.0
        if not math.isclose(stated * factor, 1.0, rel_tol=1e-4):
            self._said.append(
                f"{name} is in {label} by its axis, but in {1.0 / factor:.4g} {si} by the file's"
                " units (data set 164); the axis was believed."
            )
        return label, 1.0

    def _add(self, listing: Listing, k: int, name: str, head: Any) -> None:
        unit, factor = self._unit(name, head)
        shown, samples = _label(head["abscissa_axis_units_lab"]), int(head["num_pts"])
        comment = first_text(_label(head["id2"]), _label(head["id3"]))
        group = f"data set {k + 1}"
        if head["abscissa_spacing"] == 1:
            second = _SECONDS.get(shown.lower())
            start, step = float(head["abscissa_min"]), float(head["abscissa_inc"])
            if second is None or not (math.isfinite(start) and 0.0 < step < math.inf):
                listing.leave_out(name, "has no time in seconds")
                return
            column = Column(
                name, unit, samples, group, None, second * start, second * step, comment
            )
        else:
            clock = listing.add(Column("time", shown or "s", samples, group), (k, "x", 1.0))
            column = Column(name, unit, samples, group, clock, comment=comment)
        listing.add(column, (k, "data", factor))

    def values(self, index: int) -> Array:
        """The ordinate of one data set, or its abscissa."""
        k, part, factor = self._places[index]
        if self._held[0] != k:
            self._held = (k, self._read(k))
        values, declared = numbers(self._held[1][part]), self.columns[index].samples
        if len(values) < declared:
            raise MeasurementError(
                f"{self.source}: {self.columns[index].group} holds {len(values)} samples but"
                f" declares {declared}; it is cut short, so export it again."
            )
        return factor * values[:declared]

    def _read(self, k: int) -> Any:
        """A data set; of a binary one, nothing but a line end may stand behind the numbers."""
        held = self._file.read_sets(k)
        if held["binary"]:
            # The number of bytes in the head does not count the abscissa with some programs.
            size = (4 if held["ord_data_type"] == 2 else 8) * (1 + (held["abscissa_spacing"] != 1))
            declared = size * int(held["num_pts"])
            begin, end = self._file._block_ind[k]
            with self._path.open("rb") as stream:
                stream.seek(begin)
                lines = stream.read(end - begin + 1).splitlines(keepends=True)
            if b"".join(lines[HEAD_LINES:])[declared:].strip(b"\r\n\0 "):
                raise MeasurementError(f"{self.source}: data set {k + 1}: {CONVERTED}.")
        return held


def _is_cut(path: Path) -> bool:
    """Whether a data set begins that does not end, which pyuff passes over."""
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        return sum(1 for _ in _ENDS.finditer(data)) % 2 == 1


def _label(text: Any) -> str:
    said = plain(text)
    return "" if said.upper() in ("NONE", "UNKNOWN", "NONE NONE") else said


def _name(head: Any) -> str:
    described = _label(head["id1"])
    if described:
        return described
    direction = _DIRECTIONS.get(head["rsp_dir"], "")
    place = f"{head['rsp_node']}{direction}" if head["rsp_node"] or direction else ""
    return " ".join(part for part in (_label(head["rsp_ent_name"]), place) if part)
