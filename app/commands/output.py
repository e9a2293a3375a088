"""What the commands write: files that appear whole or not at all, aligned tables, times."""

import contextlib
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import BinaryIO

from ...engine.errors import RideError


class OutputError(RideError):
    """A file cannot be written where it was asked for."""

    code = "output"


def write_file(path: str | Path, text: str) -> None:
    """Write a text file in one step, see `whole_file`."""
    with whole_file(path) as stream:
        stream.write(text.encode())


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[BinaryIO]:
    """A stream to a file that appears with the end of the block: a reader sees the old content or
    the new, never a part, and the old one where the block fails.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    direct = path.is_relative_to("/dev") or (path.exists() and not path.is_file())
    try:
        if direct:
            with path.open("wb") as stream:
                yield stream
            return
        try:
            with temporary.open("wb") as stream:
                yield stream
            temporary.replace(os.path.realpath(path))
        except BaseException:
            with contextlib.suppress(OSError):
                temporary.unlink()
            raise
    except OSError as error:
        raise OutputError(
            f"{path}: the file cannot be written ({error.strerror or error}); choose another place"
            " with -o."
        ) from error


def require_place(path: str | Path | None, inputs: Iterable[str | Path | None]) -> None:
    """Refuse a place that no file can be written to, before hours of work are done for it, and one
    of the files that the work is done from; `inputs` as of `refuse_input`.
    """
    if path is None:
        return
    folder = Path(path).parent
    if not folder.is_dir():
        raise OutputError(
            f"{path}: there is no folder {folder}; make it or choose another with -o."
        )
    if Path(path).is_dir():
        raise OutputError(f"{path}: this is a folder; name a file with -o.")
    refuse_input(path, inputs)
    if not os.access(folder, os.W_OK):
        raise OutputError(f"{path}: {folder} does not let you write; choose another with -o.")


def refuse_input(path: str | Path, inputs: Iterable[str | Path | None]) -> None:
    """Refuse to write over one of the files that the command reads.

    inputs : where they are, None and a key in place of a path are passed over
    """
    if not Path(path).is_file():
        return
    for one in filter(None, inputs):
        if Path(one).exists() and Path(path).samefile(one):
            raise OutputError(
                f"{path}: this is {one} itself, which the command reads; choose another place."
            )


def make_folder(path: str | Path) -> Path:
    """The folder, made where it is missing."""
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{path}: the folder cannot be made ({error.strerror}); choose another one."
        ) from error
    return path


def require_writable(folder: Path) -> None:
    """Refuse a folder that no file can be written to, before the work is done for it."""
    if not os.access(folder, os.W_OK):
        raise OutputError(f"{folder}: this folder does not let you write; choose another with -o.")


def refuse_to_overwrite(paths: Iterable[Path]) -> None:
    """Refuse before the first of several files is written where one of them is already there.

    A single file that is named with -o is written over: its name was chosen.
    """
    if there := [path for path in paths if path.exists()]:
        raise OutputError(
            f"{there[0]}: the file is there already; choose another folder, or write over it with"
            " --force."
        )


def print_table(rows: Sequence[Sequence[str]], right: Iterable[int] = ()) -> None:
    """Print rows with aligned columns; those in `right` are flush right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = [">" if column in set(right) else "<" for column in range(len(widths))]
    for row in rows:
        cells = (
            f"{cell:{side}{width}}" for cell, side, width in zip(row, sides, widths, strict=True)
        )
        print("  ".join(cells).rstrip())


def minute(time: float) -> str:
    """A time, s since 1970, as a table shows it."""
    return f"{datetime.fromtimestamp(time):%Y-%m-%d %H:%M}"


def print_warnings(warnings: Iterable[str]) -> None:
    """Print each warning as a line of the report."""
    for warning in warnings:
        print("Warning:", warning)


def significant(value: float, digits: int) -> str:
    """A number with as many significant digits, without an exponent where one can read it."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    magnitude = math.floor(math.log10(abs(value)))
    if not -5 <= magnitude < 9:
        return f"{value:.{digits - 1}e}"
    return f"{round(value, digits - 1 - magnitude):.{max(0, digits - 1 - magnitude)}f}"


def print_fit_percent(runs: Mapping[str, Mapping[str, float]]) -> None:
    """Print how much of each measured channel's variation the model follows, run by run."""
    rows = [["fit percent", *runs]]
    for name in dict.fromkeys(name for fits in runs.values() for name in fits):
        rows.append(
            [name, *(f"{fits[name]:.1f}" if name in fits else "-" for fits in runs.values())]
        )
    print_table(rows, right=range(1, len(runs) + 1))
