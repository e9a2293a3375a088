"""The text of a JSON file, parsed strictly: one value a key, finite numbers, a clear sentence."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .errors import RideError
from .short_file import read_short

_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")

LARGEST_FILE = 5_000_000
"""Longest JSON file that is read, bytes; a fit with its histories fits in easily."""


def read_json(path: Path, error: type[RideError]) -> Any:
    """Parse a JSON file; whatever is wrong with it is raised as `error`, naming the file."""
    data = read_short(path, LARGEST_FILE, error)
    return parse_json(data, path.name, error)


def parse_json(data: bytes, source: str, error: type[RideError]) -> Any:
    """Parse the bytes of a JSON file; `source` heads every message."""
    if len(data) > LARGEST_FILE:
        raise error(
            f"{source}: larger than {LARGEST_FILE // 1_000_000} MB; choose the right JSON file."
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as cause:
        raise error(
            f"{source}: not UTF-8 text (byte {cause.start + 1}); save it as JSON in UTF-8."
        ) from cause
    try:
        content = json.loads(text, object_pairs_hook=_Object)
        doubled = next(_doubled(content), None)
        whole = _SURROGATE.search(text) is None or _is_writable(content)
    except json.JSONDecodeError as cause:
        raise error(
            f"{source}: line {cause.lineno}, column {cause.colno}: not valid JSON ({cause.msg});"
            " correct it there or just before."
        ) from cause
    except (ValueError, RecursionError) as cause:
        raise error(
            f"{source}: nested too deeply or with an endless number; correct the file."
        ) from cause
    if doubled is not None:
        raise error(f"{source}: {doubled} is given twice; keep one of them.")
    if not whole:
        raise error(f"{source}: it holds half a character (a lone surrogate); write it whole.")
    return content


def _is_writable(content: Any) -> bool:
    """Whether every text can be written in UTF-8, which half a character cannot."""
    try:
        json.dumps(content, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        return False
    return True


class _Object(dict[str, Any]):
    """A JSON object that remembers a key which appeared twice."""

    def __init__(self, pairs: list[tuple[str, Any]]):
        super().__init__(pairs)
        self.doubled: str | None = None
        if len(self) < len(pairs):
            seen: set[str] = set()
            for name, _ in pairs:
                if name in seen:
                    self.doubled = name
                    return
                seen.add(name)


def _doubled(content: Any, path: str = "") -> Iterator[str]:
    """Dotted paths of keys that appeared twice in one object."""
    if isinstance(content, _Object):
        if content.doubled is not None:
            yield path + content.doubled
        for name, value in content.items():
            yield from _doubled(value, f"{path}{name}.")
    elif isinstance(content, list):
        for index, value in enumerate(content):
            yield from _doubled(value, f"{path.removesuffix('.')}[{index}].")
