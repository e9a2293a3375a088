"""Unit texts as test departments write them, turned into factors to SI.

`pint` knows the units. In front of it stands a small grammar, because pint's own parser evaluates
whatever arithmetic a file's header holds, and a table of words that mean something else to pint
(`g` is gram, `G` gauss, `Nm` newton-metre written as one word):

    unit   = factor { separator factor }        separator: space * . · (times) or / (per)
    factor = word [ [^ or **] exponent ]        km/h, m/s^2, m/s2, m s-2, m·s⁻², 1/s

`/` divides by the next factor only: N/m/s is N/(m s).
"""

import math
import re
from collections.abc import Sequence
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

from .errors import RideError

if TYPE_CHECKING:
    from pint import UnitRegistry

LONGEST_TEXT = 40
"""Longest unit text that is looked at, characters."""

LEAST_PERCENT = 0.01
"""Below it a share in per cent is only said to be less."""


class UnitError(RideError):
    """A unit text is unknown or measures something else; the caller adds file and column."""

    code = "unit"


def after_number(unit: str) -> str:
    """A unit as it stands behind a number in a sentence; nothing for that of a plain number."""
    return "" if unit == "1" else f" {unit}"


def in_percent(share: float) -> str:
    """A share as it stands in a sentence: in per cent, two digits, never with an exponent."""
    value = 100.0 * share
    if value == 0.0:
        return "0 %"
    if abs(value) < LEAST_PERCENT:
        return f"<{LEAST_PERCENT:g} %"
    return f"{round(value, 1 - math.floor(math.log10(abs(value)))):.15g} %"


def listed(words: Sequence[str]) -> str:
    """Words as they stand in a sentence: "a", "a and b", "a, b and c"."""
    return f"{', '.join(words[:-1])}{' and ' if words[1:] else ''}{words[-1]}"


def counted(count: int, noun: str) -> str:
    """ "1 step", "2 steps"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


_PLAIN_NUMBER = {"", "-", "1"}

_ALIASES = {
    "%": "percent",
    "°": "degree",
    "rev": "turn",
    "kp": "kgf",
    "kmh": "km/h",
    "nm": "N m",
    "knm": "kN m",
    "nmm": "N mm",
    "nms": "N m s",
    "ns": "N s",
}
"""Words (lower case) that pint does not know or takes for something else."""

_ACCELERATION_ALIASES = {"g": "g_0", "gn": "g_0", "g_n": "g_0", "mg": "mg_0"}
"""Words that mean standard gravity, but only where an acceleration is expected."""

_SPELLINGS = {
    "grad": "deg",
    "dps": "deg/s",
    "sek": "s",
    "sekunde": "s",
    "sekunden": "s",
    "mps": "m/s",
    "m/s/s": "m/s^2",
    "km/std": "km/h",
    "g's": "g",
}
"""Unit texts of test departments; pint takes Grad for the gradian."""

_EVERYDAY = {("mm", "m"): 1e-3, ("deg", "rad"): math.pi / 180.0, ("km/h", "m/s"): 1.0 / 3.6}
"""What our own files are written in: pint takes a second to start, as much as all of a service."""

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻−", "0123456789--")
_WORD = r"[A-Za-z\u00b5\u03bc°%]+(?:_[A-Za-z0-9]+)?"
_SEPARATOR = re.compile(r"\s*[*·⋅./]\s*|\s+")
_FACTOR = re.compile(rf"(?P<word>{_WORD})(?:(?:\^|\*\*)?(?P<exponent>[+-]?\d)(?![\d.]))?")


@lru_cache(maxsize=4096)
def plain_unit(text: str) -> str:
    """A file's unit as `to_si` reads it: without brackets, m|s2 as m/s2; "" for none."""
    text = re.sub(r"^[\[(](.*)[\])]$", r"\1", text.strip()).strip().replace("|", "/")
    text = re.sub(r"(?<![A-Za-z])m?sec(?![A-Za-z])", lambda one: one[0].replace("sec", "s"), text)
    return _SPELLINGS.get(text.lower(), "" if text in {"-", "--", "1", "none", "n/a"} else text)


def to_si(text: str, si_unit: str) -> tuple[float, float]:
    """Factor and offset that turn a number with unit `text` into one with unit `si_unit`.

    value_SI = factor * value + offset
    Raises UnitError for an unknown unit and for one of another quantity. An angle is not a plain
    number here, so Hz is no rad/s. Capitals are forgiven where that leaves one meaning (KM/H).
    """
    text = " ".join(text.split())
    factor = 1.0 if text == si_unit else _EVERYDAY.get((text, si_unit))
    return _converted(text, si_unit) if factor is None else (factor, 0.0)


@lru_cache(maxsize=1000)
def _converted(text: str, si_unit: str) -> tuple[float, float]:
    si_one, si_zero, si_powers = _root(si_unit)
    readings = dict.fromkeys((_without_aliases(text, si_unit), text, text.lower()))
    known = False
    for reading in readings:
        try:
            one, zero, powers = _root(reading)
        except UnitError:
            continue
        known = True
        if powers == si_powers:
            scale = si_one - si_zero
            return (one - zero) / scale, (zero - si_zero) / scale
    if known:
        raise UnitError(f"the unit '{text}' does not measure the same quantity as '{si_unit}'")
    raise _unknown(text)


def _without_aliases(text: str, si_unit: str) -> str:
    """The text with every word that means something else to pint replaced."""
    if si_unit == "m/s^2" and text.lower() in _ACCELERATION_ALIASES:
        return _ACCELERATION_ALIASES[text.lower()]
    return re.sub(_WORD, lambda word: _ALIASES.get(word[0].lower(), word[0]), text)


def _root(text: str) -> tuple[float, float, dict[str, Any]]:
    """The values 1 and 0 of a unit in pint's root units, and those units with their powers."""
    units = _registry()
    try:
        product = units.Unit("dimensionless")
        for word, power in _factors(text):
            product = product * units.parse_units(word) ** power
        one = units.Quantity(1.0, product).to_root_units()
        zero = units.Quantity(0.0, product).to_root_units()
    except UnitError:
        raise
    except Exception as error:  # pint's own parser raises whatever Python's tokenizer does
        raise _unknown(text) from error
    return one.magnitude, zero.magnitude, dict(one.unit_items())


def _factors(text: str) -> list[tuple[str, int]]:
    """The words of a unit text with their powers; no words for a plain number."""
    if text in _PLAIN_NUMBER:
        return []
    rest, sign = text.translate(_SUPERSCRIPTS), 1
    if len(rest) > LONGEST_TEXT:
        raise _unknown(text)
    if over := re.match(r"1\s*/\s*", rest):
        rest, sign = rest[over.end() :], -1
    found = []
    while match := _FACTOR.match(rest):
        found.append((match["word"], sign * int(match["exponent"] or 1)))
        rest = rest[match.end() :]
        if not rest:
            return found
        separator = _SEPARATOR.match(rest)
        if separator is None:
            break
        sign = -1 if "/" in separator[0] else 1
        rest = rest[separator.end() :]
    raise _unknown(text)


def _unknown(text: str) -> UnitError:
    return UnitError(f"the unit '{text[:LONGEST_TEXT]}' is not known")


@cache
def _registry() -> "UnitRegistry":
    """The one registry; it takes a second to import and build, so the first odd unit does it."""
    from pint import UnitRegistry

    return UnitRegistry()
