"""TOML: a file's text parsed at a cost that its size bounds, and values as text."""

import json
import re
import tomllib
from collections.abc import Mapping
from typing import Any

from .errors import MeasurementError

LARGEST_FILE = 1_000_000
"""Longest TOML file that is read, bytes."""

MOST_DOTS = 200
"""On one line: the standard library's reader takes the square of the parts of a key, and what walks
the tables goes as deep."""


_KEYS = re.compile(r"\(['\"](.*)['\"],?\)")


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
    except UnicodeDecodeError as error:
        raise MeasurementError(
            f"{source}: not UTF-8 text (byte {error.start + 1}); save it as TOML in UTF-8."
        ) from error
    except RecursionError as error:
        raise MeasurementError(f"{source}: nested too deeply; correct the file.") from error
    except ValueError as error:
        raise MeasurementError(f"{source}: not valid TOML ({_told(error)}); correct it.") from error


def _told(error: ValueError) -> str:
    """What the standard library says, its keys and characters as a person writes them."""
    said = _KEYS.sub(lambda keys: "[" + keys[1].replace("', '", ".") + "]", str(error))
    return said.replace("\\x", "U+00")


def toml_value(value: Any) -> str:
    """A text, a truth value, a number or a list of these as TOML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # As JSON does, but for pairs of escapes and a bare delete.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return "[" + ",".join(f"\n  {toml_value(item)}" for item in value) + "]"
    return repr(float(value)) if isinstance(value, float) else repr(value)


def toml_table(name: str, table: Mapping[str, Any]) -> list[str]:
    """Lines of a table whose values `toml_value` knows; `name` with its brackets."""
    return ["", name, *(f"{toml_value(key)} = {toml_value(one)}" for key, one in table.items())]
