"""What can be asked about an opened file, and the sentence for everything that goes wrong."""

from collections.abc import Callable, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Any

from ..errors import RideError, UnmappedError
from ..extras import how_to_install
from .envelope import envelope
from .kinds import kind_of
from .listing import SPENT
from .readers import read_as
from .table import Array, Table

Answer = tuple[dict[str, Any], Sequence[Array]]

INSTALL = how_to_install("formats")
"""Found before the process is confined and sees no files."""


class Answering:
    """One file and the answers about it.

    memory : what the process may take, bytes, for the sentence when it is spent
    """

    def __init__(self, memory: int):
        self._memory = memory
        self._table: Table | None = None
        self._source, self._kind = "", ""
        self._questions: dict[str, Callable[..., Answer]] = {
            "open": self._open,
            "titles": self._titles,
            "columns": self._columns,
            "values": self._values,
            "in_si": self._in_si,
            "place": self._place,
            "envelope": self._envelope,
        }

    def to(self, request: dict[str, Any]) -> Answer:
        """The answer to a question, or {"error": sentence}."""
        try:
            return self._questions[request.pop("ask")](**request)
        except RideError as error:
            return {"error": str(error), "unmapped": isinstance(error, UnmappedError)}, ()
        except MemoryError:
            return self._out_of_memory()
        except ImportError as error:
            return self._error(f"{error.name or 'a package'} cannot be loaded; {INSTALL}")
        except Exception as error:  # the readers raise whatever a spoilt file drives them to
            if "allocate" in str(error).lower():
                return self._out_of_memory()
            kind = f" as {self._kind}" if self._kind else ""
            return self._error(
                f"the file cannot be read{kind}; it is damaged, cut short or written in an unusual"
                " way, so export it again"
            )

    def _out_of_memory(self) -> Answer:
        return self._error(
            f"reading it takes more than {self._memory / 2**30:.3g} GB of memory{SPENT}"
        )

    def _error(self, what: str) -> Answer:
        return {"error": f"{self._source}: {what}."}, ()

    @property
    def _opened(self) -> Table:
        assert self._table is not None
        return self._table

    def _open(self, path: str, source: str, kind: str, options: dict[str, Any]) -> Answer:
        self._source = source
        if not kind:
            with Path(path).open("rb") as stream:
                kind = kind_of(stream, source)
        self._kind, self._table = kind, None
        self._table = read_as(kind, Path(path), source, options)
        return {"kind": self._table.kind}, ()

    def _titles(self) -> Answer:
        return {"titles": self._opened.titles()}, ()

    def _columns(self) -> Answer:
        table = self._opened
        return {
            "columns": [astuple(column) for column in table.columns],
            "warnings": table.warnings,
            "comment": table.comment[:100_000],
        }, ()

    def _values(self, index: int) -> Answer:
        return {}, [self._opened.values(index)]

    def _in_si(self, columns: list[tuple[int, float, float]]) -> Answer:
        return {}, list(self._opened.in_si([(int(i), f, o) for i, f, o in columns]).T)

    def _place(self, row: int) -> Answer:
        return {"place": self._opened.place(row)}, ()

    def _envelope(self, index: int, points: int) -> Answer:
        found = envelope(self._opened, index, points)
        return {}, [found.time, found.minimum, found.maximum]
