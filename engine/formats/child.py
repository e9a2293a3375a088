"""A file opened in a process of its own, which may crash, hang or swell without harm to this one.

The child (`answers`) has limits on memory, processor time, open files and what it writes, an empty
folder to work in, no environment to speak of, no input, no output but the socket it answers on,
and, where the system lets it, no network. It reads one file and ends with the table. Numbers come
back as plain float64; nothing that comes back is executed or unpickled, and all of it is checked.
"""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeasurementError, UnmappedError
from . import wire
from .envelope import Envelope
from .listing import MOST_COLUMNS, MOST_SAMPLES, SPENT, plain
from .table import Array, Column, Table

LONGEST_SENTENCE = 2000
"""Longest sentence that is believed to be one, characters."""

COMMAND = f"from {__package__}.answers import main; main()"
"""What the child runs."""

WRITTEN = 1 << 20
"""Longest file a child may write, bytes: asammdf begins one, in the folder that goes with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """What a child may take.

    memory : address space, bytes; what a file maps of itself comes on top
    cpu, wall : processor time in all, and time for one answer, s
    numbers : most numbers that one answer may bring
    """

    memory: int = 2 << 30
    cpu: int = 20
    wall: float = 60.0
    numbers: int = MOST_SAMPLES


BOUNDS = Bounds()
"""What a child may take unless it is told otherwise."""


class ChildTable(Table):
    """A table whose file a child holds open; `close` it, or use it with `with`."""

    def __init__(
        self,
        path: Path,
        source: str,
        *,
        kind: str = "",
        options: Mapping[str, float] | None = None,
        bounds: Bounds = BOUNDS,
        folder: Path | None = None,
    ):
        """Open a file of a kind, looked for in its first bytes where it is not told.

        folder : where the child's own folder is made; None for the system's temporary one
        """
        self.source = source
        self._bounds = bounds
        self._listed: dict[str, Any] | None
        self._titles: tuple[tuple[str, str], ...] | None
        size = path.stat().st_size
        self._limits = {
            "memory": bounds.memory + size,
            "cpu": bounds.cpu,
            "wall": int(10 * bounds.wall) + bounds.cpu,
            "written": WRITTEN,
            # Beside it what the readers of CarMaker and TDMS look for.
            "reads": [f"{path.absolute()}{ending}" for ending in ("", ".info", "_index")],
        }
        self._folder = tempfile.mkdtemp(prefix="ridetune-", dir=folder and folder.absolute())
        self._speak, theirs = socket.socketpair()
        try:
            with theirs:
                self._process = self._started(theirs)
        except OSError as error:
            self.close()
            raise self._refused(
                f"its reader cannot be started ({error.strerror}); try again later"
            ) from error
        try:
            self._open(path, kind, options or {})
        except BaseException:
            self.close()
            raise

    def _open(self, path: Path, kind: str, options: Mapping[str, float]) -> None:
        self._listed = self._titles = None
        head, _ = self._ask(
            "open", path=str(path.absolute()), source=self.source, kind=kind, options=options
        )
        self.kind = plain(head.get("kind", ""))

    def _started(self, theirs: socket.socket) -> subprocess.Popen[bytes]:
        threads = ("OPENBLAS", "OMP", "MKL", "NUMEXPR", "NUMEXPR_MAX")
        environment = {
            "HOME": self._folder,
            "TMPDIR": self._folder,
            "HDF5_PLUGIN_PATH": self._folder,
            "LANG": "C.UTF-8",
            "TZ": "UTC",
            "ARROW_DEFAULT_MEMORY_POOL": "system",
            "MALLOC_ARENA_MAX": "2",
            **{f"{name}_NUM_THREADS": "1" for name in threads},
            "NUMEXPR_MAX_THREADS": "1",
        }
        arguments = [str(theirs.fileno()), json.dumps(self._limits)]
        return subprocess.Popen(
            [sys.executable, "-I", "-B", "-c", COMMAND, *arguments],
            cwd=self._folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=[theirs.fileno()],
            start_new_session=True,
        )

    @property
    def pid(self) -> int:
        """The child's process."""
        return self._process.pid

    def __enter__(self) -> "ChildTable":
        """The table itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the child."""
        self.close()

    def close(self) -> None:
        """End the child and remove its folder; closing twice does no harm."""
        self._speak.close()
        process = getattr(self, "_process", None)
        if process is not None and process.poll() is None:
            self._kill()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _kill(self) -> None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def _ask(self, question: str, **what: Any) -> tuple[dict[str, Any], list[Array]]:
        """The child's answer; MeasurementError for its sentence, or for its end."""
        until = time.monotonic() + self._bounds.wall
        try:
            wire.send(self._speak, {"ask": question, **what})
            head, arrays = wire.receive(self._speak, self._bounds.numbers, until)
        except wire.TooSlow as error:
            self._kill()
            raise self._refused(
                f"reading it took more than {self._bounds.wall:g} s{SPENT}"
            ) from error
        except wire.Garbled as error:
            self._kill()
            raise self._refused(
                "its reader answered nothing sensible; the file is damaged, so export it again"
            ) from error
        except (wire.Ended, OSError) as error:
            raise self._refused(self._why_ended()) from error
        if "error" in head:
            error = UnmappedError if head.get("unmapped") is True else MeasurementError
            raise error(_sentence(head["error"], self.source))
        return head, arrays

    def _why_ended(self) -> str:
        try:
            code = self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._kill()
            code = self._process.wait()
        if code == -signal.SIGXCPU:
            return f"reading it took more than {self._bounds.cpu} s of processor time{SPENT}"
        if code == -signal.SIGKILL:
            return "its reader was killed, probably for want of memory; cut the recording"
        name = signal.Signals(-code).name if code < 0 else f"exit status {code}"
        return f"its reader crashed ({name}); the file is damaged or hostile, so export it again"

    def _refused(self, what: str) -> MeasurementError:
        return MeasurementError(f"{self.source}: {what}.")

    def _listing(self) -> dict[str, Any]:
        if self._listed is None:
            head, _ = self._ask("columns")
            try:
                columns = tuple(map(_column, head["columns"][:MOST_COLUMNS]))
                _check_clocks(columns)
                self._listed = {
                    "columns": columns,
                    "warnings": tuple(_sentence(one, self.source) for one in head["warnings"]),
                    "comment": str(head["comment"]),
                }
            except (KeyError, TypeError, ValueError) as error:
                raise self._refused(
                    "its reader answered nothing sensible; the file is damaged, so export it again"
                ) from error
        return self._listed

    @property
    def columns(self) -> tuple[Column, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Every column of numbers."""
        return self._listing()["columns"]

    @property
    def warnings(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """What is doubtful in the file."""
        return self._listing()["warnings"]

    @property
    def comment(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        """What the file says of itself."""
        return self._listing()["comment"]

    def titles(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of every column."""
        if self._titles is None:
            head, _ = self._ask("titles")
            self._titles = tuple((str(name), str(unit)) for name, unit in head["titles"])
        return self._titles

    def values(self, index: int) -> Array:
        """Physical values (samples,) of one column."""
        _, arrays = self._ask("values", index=index)
        return self._checked(arrays, [self.columns[index].samples])[0]

    def in_si(self, columns: Sequence[tuple[int, float, float]]) -> Array:
        """Numbers (samples, len(columns)) as factor * number + offset, all finite."""
        _, arrays = self._ask("in_si", columns=[list(one) for one in columns])
        lengths = [len(arrays[0]) if arrays else 0] * len(columns)
        return np.column_stack(self._checked(arrays, lengths))

    def place(self, row: int) -> str:
        """Where a sample stands in the file."""
        head, _ = self._ask("place", row=row)
        return plain(head.get("place", ""))

    def envelope(self, index: int, points: int) -> Envelope:
        """What a column looks like in few points; see `envelope`."""
        _, arrays = self._ask("envelope", index=index, points=points)
        lengths = [len(arrays[0]) if arrays else 0] * 3
        return Envelope(*self._checked(arrays, lengths))

    def _checked(self, arrays: list[Array], lengths: list[int]) -> list[Array]:
        if [len(one) for one in arrays] != lengths:
            raise self._refused(
                "its reader found another number of samples than the file declares; the file is"
                " damaged, so export it again"
            )
        return arrays


def _column(fields: Any) -> Column:
    """A column as the child describes it, every field of the kind it must be."""
    name, unit, samples, group, clock, start, step, comment = fields
    return Column(
        plain(name),
        plain(unit),
        int(samples),
        plain(group),
        None if clock is None else int(clock),
        float(start),
        None if step is None else float(step),
        plain(comment),
    )


def _check_clocks(columns: Sequence[Column]) -> None:
    """Raise ValueError for a time that is no column or of another length."""
    for column in columns:
        clock = column.clock
        if clock is not None and not (
            0 <= clock < len(columns) and columns[clock].samples == column.samples
        ):
            raise ValueError("clock")


def _sentence(text: Any, source: str) -> str:
    said = " ".join(str(text)[:LONGEST_SENTENCE].split())
    return said or f"{source}: the file cannot be read; export it again."
