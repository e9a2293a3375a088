"""What a session is called: as its visitor says, else by a name that tells it from their others."""

import unicodedata
from collections.abc import Collection
from itertools import count

LONGEST = 80
DEFAULT = "Project"
JOINERS = "\u200c\u200d"
"""Of Persian words and of emoji; other controls of formatting may not be seen at all."""


def on_one_line(name: str) -> str:
    """A name without the white space around it; ValueError unless it can be read on a line."""
    told = name.strip()
    if not 1 <= len(told) <= LONGEST or not all(map(_is_seen, told)):
        raise ValueError(f"give 1 to {LONGEST} characters without control characters")
    return told


def _is_seen(letter: str) -> bool:
    return letter in JOINERS or unicodedata.category(letter) not in ("Cc", "Cf", "Cs", "Zl", "Zp")


def free_name(taken: Collection[str]) -> str:
    """The usual name, with the first number that makes it one of its own."""
    numbered = (f"{DEFAULT} {number}" for number in count(2))
    return DEFAULT if DEFAULT not in taken else next(one for one in numbered if one not in taken)
