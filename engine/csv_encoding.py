"""How a text file is encoded, by its first bytes; what is no text is refused."""

import re
from typing import BinaryIO

from .errors import MeasurementError

_HEAD = 65_536
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x19\x1b-\x1f]")
_MARKS = (
    (b"\xff\xfe\x00\x00", "utf-32"),
    (b"\x00\x00\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)


def find_encoding(stream: BinaryIO, source: str) -> str:
    """The encoding of a text; MeasurementError naming `source` for anything else."""
    stream.seek(0)
    head = stream.read(_HEAD)
    if not head.strip():
        raise MeasurementError(f"{source}: the file is empty; export the recording again.")
    for mark, encoding in _MARKS:
        if head.startswith(mark):
            return encoding
    if head.count(0) > 0.3 * len(head) and not _CONTROL.search(head.replace(b"\0", b"")):
        return "utf-16-le" if head[1::2].count(0) > head[0::2].count(0) else "utf-16-be"
    if head.startswith(b"PK\x03\x04"):
        raise MeasurementError(
            f"{source}: this is a workbook or a zip archive, not text; save the sheet as CSV."
        )
    if _CONTROL.search(head):
        raise MeasurementError(
            f"{source}: this is a binary file, not text; export the recording as CSV."
        )
    return "utf-8-sig"
