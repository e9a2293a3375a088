"""How the child and its parent speak: a JSON head with the lengths of the arrays after it.

length of the head, 4 bytes | head, JSON | float64 of each array, little endian
"""

import json
import select
import socket
import struct
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from .table import Array

LONGEST_HEAD = 64_000_000
"""Longest JSON head, bytes: that of some ten thousand columns."""

_LENGTH = struct.Struct("<I")
_PIECE = 1 << 20


class Garbled(Exception):
    """What came is no message."""


class Ended(Exception):
    """The other side has gone."""


class TooSlow(Exception):
    """Nothing came in time."""


def send(to: socket.socket, head: dict[str, Any], arrays: Sequence[Array] = ()) -> None:
    """Send one message."""
    head = {**head, "arrays": [len(one) for one in arrays]}
    text = json.dumps(head, allow_nan=True).encode()
    to.sendall(_LENGTH.pack(len(text)) + text)
    for one in arrays:
        to.sendall(np.ascontiguousarray(one, dtype="<f8").data.cast("B"))


def receive(
    source: socket.socket, most_numbers: int, until: float | None = None
) -> tuple[dict[str, Any], list[Array]]:
    """Take one message.

    most_numbers : most numbers it may bring;  until : when to give up, of `time.monotonic`
    Raises Garbled, Ended or TooSlow.
    """
    (length,) = _LENGTH.unpack(_bytes(source, _LENGTH.size, until))
    if length > LONGEST_HEAD:
        raise Garbled
    try:
        head = json.loads(_bytes(source, length, until))
    except (ValueError, RecursionError) as error:
        raise Garbled from error
    lengths = head.pop("arrays", None) if isinstance(head, dict) else None
    if not isinstance(lengths, list) or not all(type(one) is int and one >= 0 for one in lengths):
        raise Garbled
    if sum(lengths) > most_numbers:
        raise Garbled
    return head, [np.frombuffer(_bytes(source, 8 * one, until), dtype="<f8") for one in lengths]


def _bytes(source: socket.socket, count: int, until: float | None) -> bytearray:
    """So many bytes."""
    held, view, filled = bytearray(count), None, 0
    view = memoryview(held)
    while filled < count:
        if until is not None:
            left = until - time.monotonic()
            if left <= 0.0 or not select.select([source], [], [], left)[0]:
                raise TooSlow
        try:
            got = source.recv_into(view[filled : filled + _PIECE])
        except OSError as error:
            raise Ended from error
        if got == 0:
            raise Ended
        filled += got
    return held
