"""The text of a TOML file, parsed at a cost that its size bounds, with a clear sentence."""

import tomllib
from typing import Any

from .errors import MeasurementError

LARGEST_FILE = 1_000_000
"""Longest TOML file that is read, bytes."""

MOST_DOTS = 200
"""On one line: the standard library's reader takes the square of the parts of a key, and what walks
the tables goes as deep."""


def parse_toml(data: bytes, source: str) -> dict[str, Any]:
    """Parse the bytes of a TOML file; `source` heads every message of a MeasurementError."""
    if len(data) > LARGEST_FILE:
        raise MeasurementError(f"{source}: larger than 1 MB; choose the right TOML file.")
    for number, line in enumerate(data.splitlines(), 1):
        if line.count(b".") > MOST_DOTS:
            raise MeasurementError(
                f"{source}: line {number} has more than {MOST_DOTS} dots; break it up, or correct"
                " its key."
            )
    try:
        return tomllib.loads(data.decode("utf-8-sig").replace("\r\n", "\n"))
    except (ValueError, RecursionError) as error:
        raise MeasurementError(f"{source}: not valid TOML ({error}); correct it.") from error
