"""Signs that a file states in words: "nose up", "down positive", "Verzoegerung"."""

import re
from collections.abc import Mapping
from typing import NamedTuple


class Senses(NamedTuple):
    """What says that a channel is turned over, and what that it is not."""

    against: str
    along: str


_IS = r"[ -]?(is[ -]?)?(positive|pos\b|\+)"
_POSITIVE = r"\bpositive[ -]?((is|in|for|when)[ -]?)?"
_PITCH = Senses(r"\bnose[ -]?up\b|\bbug[ -]?hoch\b", r"\bnose[ -]?down\b|\bbug[ -]?(runter|tief)\b")
_ROLL = Senses(
    r"\bright[ -]?(side[ -]?)?up\b|\bleft[ -]?(side[ -]?)?down\b",
    r"\bleft[ -]?(side[ -]?)?up\b|\bright[ -]?(side[ -]?)?down\b",
)
_BACK, _OUT = r"\b(rearward|backward)s?", r"\b(rebound|extension|droop|ausfedern)"

SENSES: Mapping[str, Senses] = {
    "chassis.pitch": _PITCH,
    "chassis.pitch_rate": _PITCH,
    "chassis.roll": _ROLL,
    "chassis.roll_rate": _ROLL,
    "chassis.a_x": Senses(
        r"\bdecel(eration)?\b|\b(laengs|längs|brems)?verz(oe|ö)gerung\b"
        rf"|{_BACK}{_IS}|{_POSITIVE}{_BACK}\b",
        r"\baccel|beschleunigung|\bforwards?\b",
    ),
    "z": Senses(
        rf"\bz[ -]?down\b|\bdown(wards?)?{_IS}|{_POSITIVE}down(wards?)?\b",
        rf"\bz[ -]?up\b|\bup(wards?)?{_IS}|{_POSITIVE}up(wards?)?\b",
    ),
    "travel": Senses(
        rf"{_OUT}{_IS}|{_POSITIVE}{_OUT}\b",
        rf"\b(jounce|bump|compression|einfedern){_IS}"
        rf"|{_POSITIVE}(jounce|bump|compression|einfedern)\b",
    ),
}
"""By channel or its last part, what is said of its sign."""

_DENIED_BEFORE = re.compile(
    r"\b(not|no|non|never|nicht|kein\w*|neg|negative|negativ|minus)\b[^.,;/()]*$", re.IGNORECASE
)
_DENIED_AFTER = re.compile(r"\W*(is\W+|ist\W+)?(not|neg|negative|negativ|minus)\b", re.IGNORECASE)


def stated_sign(channel: str, *texts: str) -> tuple[int, str]:
    """The sign of a channel, and the words that turn it over; 1 and "" where nothing is said.

    A text that denies it, or that speaks of both senses, says nothing.
    """
    senses = SENSES.get(channel) or SENSES.get(channel.rsplit(".", 1)[-1])
    for text in texts if senses else ():
        plain = re.sub(r"_|(?<=[a-z])(?=[A-Z])", " ", text)
        found = [re.search(sense, plain, re.IGNORECASE) for sense in senses or ()]
        if found[0] and not found[1] and not _denied(plain, *found[0].span()):
            return -1, found[0][0]
    return 1, ""


def _denied(text: str, begin: int, end: int) -> bool:
    return bool(_DENIED_BEFORE.search(text[:begin]) or _DENIED_AFTER.match(text[end:]))
