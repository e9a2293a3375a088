"""A column's name taken apart: what its words say, and a unit that it ends in.

Words are divided by anything that is no letter, by capitals (VehSpd), and inside compounds of
known words (Nickwinkel, wheelflz). Of two ways to divide the one is taken that leaves fewer
letters unexplained.
"""

import re
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache

from .words import CORNER_WORDS, LETTERS, NO_CHANNEL, SILENT, WORDS

LONGEST_NAME = 200
"""Characters of a name that are looked at."""

SHORTEST_STEM = 4
"""Letters of an abbreviation, longit for longitudinal, that is still taken for the word."""

_UMLAUTS = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue"}
)
_CAMEL = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
_PLAIN = re.compile(r"[a-z]+|\d+")

ENDINGS: Mapping[str, tuple[str, ...]] = {
    "m": ("m",),
    "mm": ("mm",),
    "cm": ("cm",),
    "deg": ("deg",),
    "grad": ("deg",),
    "rad": ("rad",),
    "mrad": ("mrad",),
    "g": ("g",),
    "mg": ("mg",),
    "kmh": ("km/h",),
    "kph": ("km/h",),
    "mph": ("mph",),
    "mps": ("m/s",),
    "ms": ("ms", "m/s"),
    "mss": ("m/s^2",),
    "mps2": ("m/s^2",),
    "ms2": ("m/s^2",),
    "mms": ("mm/s",),
    "dps": ("deg/s",),
    "degs": ("deg/s",),
    "rads": ("rad/s",),
    "s": ("s",),
    "sec": ("s",),
    "sek": ("s",),
    "us": ("us",),
    "n": ("N",),
    "kn": ("kN",),
    "nm": ("N m",),
    "knm": ("kN m",),
}
"""Units that a name ends in where the column has none of its own (acc_x_g)."""

_PARTS = ("chassis", "wheel", "tyre", "suspension", "spring", "damper", "road", "post")
_LAST = ("arm", "brake", "drive", "stabilizer", "seat")
PRECEDENCE = {part: rank for rank, part in enumerate((*_PARTS, *_LAST))}
"""Of two parts in one name the later one is meant: Car.Wheel is the wheel."""

_TOGETHER = {
    frozenset(("angle", "velocity")): "rate",
    frozenset(("angle", "rate")): "rate",
    frozenset(("rate", "velocity")): "rate",
    frozenset(("angle", "displacement")): "angle",
    frozenset(("travel", "displacement")): "travel",
}
"""The quantity that two words mean together: an angle's velocity is a rate."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One way to read a name.

    said : what its words say; "?" where two of them contradict each other
    strange : how many words are not known
    ending : units that the name's last word may stand for
    """

    said: Mapping[str, str]
    strange: int
    ending: tuple[str, ...] = ()


_STEMS = {
    word[:length]: word
    for word in reversed(list(WORDS))
    for length in range(SHORTEST_STEM, len(word))
}
"""Abbreviations of known words."""


@lru_cache(maxsize=65_536)
def readings(name: str) -> tuple[Reading, ...]:
    """Every way to read a name: as it is, and with its last word as a unit; none of a column that
    says to be something else.
    """
    name = _folded(name[:LONGEST_NAME])
    found = []
    by_case = _CAMEL.findall(name)
    plain = _PLAIN.findall(name.lower())
    for tokens, ending in ((t, e) for t in (by_case, plain) for e in (False, True)):
        units = _ending(tokens) if ending else ((), 0)
        if ending and not units[0]:
            continue
        words = _words(tokens[: len(tokens) - units[1]])
        if NO_CHANNEL.intersection(words):
            continue
        reading = _read(words, units[0])
        if reading.said:
            found.append(reading)
    return tuple(found)


def _folded(name: str) -> str:
    name = unicodedata.normalize("NFC", name).translate(_UMLAUTS)
    return unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()


def _ending(tokens: list[str]) -> tuple[tuple[str, ...], int]:
    """The units that the last tokens stand for, and how many tokens those are."""
    for count in (2, 1):
        units = ENDINGS.get("".join(tokens[-count:]).lower(), ())
        if units and len(tokens) > count:
            return units, count
    return (), 0


def _words(tokens: Iterable[str]) -> list[str]:
    """Lower-case words: single letters of a corner joined (f_l), compounds divided, no numbers."""
    joined: list[str] = []
    for token in (token.lower() for token in tokens):
        both = joined[-1] + token if joined and len(joined[-1]) == len(token) == 1 else ""
        if both in CORNER_WORDS:
            joined[-1] = both
        elif not token.isdigit():
            joined.append(token)
    return [word for token in joined for word in _divided(token)]


@lru_cache(maxsize=65_536)
def _divided(token: str) -> tuple[str, ...]:
    """A token as known words, as the one that it abbreviates, or itself."""
    if _known(token):
        return (token,)
    best: list[list[str] | None] = [[], *(None for _ in token)]
    for end in range(1, len(token) + 1):
        for start in range(end):
            head, word = best[start], token[start:end]
            if head is None or not _may_stand(word, start, end == len(token)):
                continue
            if (now := best[end]) is None or len(head) + 1 < len(now):
                best[end] = [*head, word]
    whole = best[-1]
    if whole is not None and any(len(word) > 2 for word in whole):
        return tuple(whole)
    return (_STEMS.get(token, token),)


def _known(word: str) -> bool:
    return word in WORDS or word in SILENT or word in NO_CHANNEL


def _may_stand(word: str, start: int, last: bool) -> bool:
    """Whether a piece of a token may be a word of its own: symbols only at its end."""
    if len(word) > 2:
        return _known(word)
    if word == "s":  # between German nouns
        return start > 5 and not last
    return word in CORNER_WORDS or (last and word in LETTERS)


def _read(words: Iterable[str], ending: tuple[str, ...]) -> Reading:
    said: dict[str, str] = {}
    strange, hub = 0, False
    for word in words:
        known = WORDS.get(word)
        if known is None:
            strange += word not in SILENT
            continue
        for slot, value in known.items():
            if value == "hub":
                hub = True
            else:
                said[slot] = _merged(slot, said.get(slot, value), value)
    if hub:
        _add_hub(said)
    return Reading(said, strange, ending)


def _add_hub(said: dict[str, str]) -> None:
    """English hub is a wheel's, German Hub is a rise: a part that is named otherwise rises."""
    if "part" not in said and "side" in said:
        said["part"] = "wheel"
    elif said.get("part") != "wheel":
        said.setdefault("axis", "z")
        said.setdefault("quantity", "displacement")


def _merged(slot: str, one: str, other: str) -> str:
    if one == other:
        return one
    if slot == "part":
        return max(one, other, key=lambda part: PRECEDENCE[part])
    if slot == "quantity":
        return _TOGETHER.get(frozenset((one, other)), "?")
    return "?"
