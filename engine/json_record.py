"""Reading JSON objects into frozen records whose type hints say what is accepted.

Understood hints: float and int (with `Annotated[..., Range]`), bool, str, Literal, another record,
tuples of these, and unions. A record with a class variable `kind` is chosen by the JSON key "kind".
A field whose name ends in an underscore is the key without it (`class_` is "class"). Every message
starts with the source and the dotted path of the field and says what to do.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from difflib import get_close_matches
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from .errors import RideError
from .vehicle import Range

LONGEST_LIST = 100_000

MOST_TEXT = 10_000
"""Characters of a text."""


class RecordReader:
    """Builds records; `source` heads every message, which is raised as `error`."""

    def __init__(self, source: str, error: type[RideError]):
        self.source = source
        self.error = error

    def refuse(self, path: str, sentence: str) -> RideError:
        """The error for a field; `sentence` follows its path."""
        return self.error(f"{self.source}: {path + ' ' if path else ''}{sentence}")

    def record(self, kind: Any, data: Any, path: str = "") -> Any:
        """An instance of the dataclass `kind` from a JSON object at a dotted path."""
        if not isinstance(data, Mapping):
            raise self.refuse(path, f"must be an object {{...}}, not {describe(data)}.")
        hints, keys = _shape(kind)
        self.check_keys(data, [*keys, "kind"] if _kind(kind) else list(keys), path)
        values = {}
        for key, field in keys.items():
            place = _join(path, key)
            if key in data:
                values[field.name] = self.value(hints[field.name], data[key], place)
            elif field.default is MISSING and field.default_factory is MISSING:
                wanted = expected(hints[field.name])
                raise self.refuse(place, f"is missing; add {wanted}.")
        try:
            return kind(**values)
        except RideError as error:
            raise self.error(f"{self.source}: {path + ': ' if path else ''}{error}") from error

    def check_keys(self, data: Mapping[str, Any], known: Sequence[str], path: str) -> None:
        """Refuse a key of an object that is none of those known."""
        for key in data:
            if key not in known:
                shown = str(key) if str(key).strip() else '""'
                raise self.refuse(_join(path, shown), f"is not known; {_hint(key, known)}")

    def value(self, hint: Any, data: Any, path: str, accepted: Range | None = None) -> Any:
        """One value as its type, or an error that says what it should be."""
        origin, arguments = get_origin(hint), get_args(hint)
        if origin is Annotated:
            return self.value(arguments[0], data, path, arguments[1])
        if origin in (Union, UnionType):
            return self._one_of(arguments, data, path, accepted)
        if is_dataclass(hint):
            return self.record(hint, data, path)
        if origin is tuple and _fits(hint, data):
            return self._items(arguments, data, path, accepted)
        if not _fits(hint, data):
            wanted = expected(hint, accepted)
            raise self.refuse(path, f"is {describe(data)}, but must be {wanted}; correct it.")
        if isinstance(data, str) and len(data) > MOST_TEXT:
            raise self.refuse(
                path, f"has {len(data)} characters, at most {MOST_TEXT} are taken; shorten it."
            )
        if hint not in (float, int):
            return data
        number = _to_float(data)
        if accepted is not None and not accepted.holds(number):
            raise self.refuse(path, f"is {describe(data)}, but must lie {accepted}; correct it.")
        if not math.isfinite(number):
            raise self.refuse(path, f"is {describe(data)}, but must be finite; correct it.")
        return int(number) if hint is int else number

    def _one_of(self, options: Sequence[Any], data: Any, path: str, accepted: Range | None) -> Any:
        """A value of a union: a record by its "kind", anything else by its JSON type."""
        records = {kind: one for one in options if (kind := _kind(one))}
        if records and isinstance(data, Mapping):
            kind = data.get("kind")
            if not isinstance(kind, str) or kind not in records:
                what = "is missing" if kind is None else f"{describe(kind)} is not known"
                raise self.refuse(_join(path, "kind"), f"{what}; {_hint(kind, list(records))}")
            return self.record(records[kind], data, path)
        for option in options:
            bare = get_args(option)[0] if get_origin(option) is Annotated else option
            if _fits(bare, data):
                return self.value(option, data, path, accepted)
        wanted = " or ".join(expected(one) for one in options if one is not NoneType)
        raise self.refuse(path, f"is {describe(data)}, but must be {wanted}; correct it.")

    def _items(self, hints: Sequence[Any], data: Sequence, path: str, accepted: Range | None):
        """The elements of a list: any number of one type, or as many as types are named."""
        if hints[-1] is Ellipsis:
            hints = [hints[0]] * len(data)
        if len(data) != len(hints):
            raise self.refuse(path, f"has {len(data)} values, but must have {len(hints)}.")
        if len(data) > LONGEST_LIST:
            raise self.refuse(path, f"has more than {LONGEST_LIST} values; thin it out.")
        return tuple(
            self.value(hint, item, f"{path}[{i}]", accepted)
            for i, (hint, item) in enumerate(zip(hints, data, strict=True))
        )


@cache
def _shape(kind: Any) -> tuple[dict[str, Any], dict[str, Field[Any]]]:
    """Type hints by field, and fields by JSON key."""
    keys = {field.name.rstrip("_"): field for field in fields(kind)}
    return get_type_hints(kind, include_extras=True), keys


def record_to_json(record: Any) -> Any:
    """A record as plain JSON data; fields at None are left out."""
    if isinstance(record, tuple):
        return [record_to_json(item) for item in record]
    if not is_dataclass(record):
        return record
    kind = _kind(type(record))
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    return ({"kind": kind} if kind else {}) | {
        name.rstrip("_"): record_to_json(value)
        for name, value in values.items()
        if value is not None
    }


def describe(data: Any) -> str:
    """What a JSON value is, briefly."""
    match data:
        case None:
            return "null"
        case bool():
            return str(data).lower()
        case Mapping():
            return "an object"
        case list() | tuple():
            return "a list"
        case int() if abs(data) > 10**30:
            return "a huge number"
        case int() | float():
            return str(data)
    text = json.dumps(data, ensure_ascii=False, default=str)
    return text if len(text) <= 40 else f"{text[:37]}..."


def expected(hint: Any, accepted: Range | None = None) -> str:
    """What a value of a type should be, in words."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return expected(arguments[0], arguments[1])
    if origin in (Union, UnionType):
        return " or ".join(expected(one) for one in arguments if one is not NoneType)
    if origin is Literal:
        return " or ".join(f'"{choice}"' for choice in arguments)
    if origin is tuple:
        return f"a list of which each is {expected(arguments[0], accepted)}"
    if is_dataclass(hint):
        return f'an object of kind "{_kind(hint)}"' if _kind(hint) else "an object"
    noun = {float: "a number", int: "a whole number", bool: "true or false"}.get(hint, "a text")
    return noun if accepted is None else f"{noun} {accepted}"


def _fits(hint: Any, data: Any) -> bool:
    """Whether a JSON value has the type of a hint."""
    if is_dataclass(hint):
        return isinstance(data, Mapping)
    if get_origin(hint) is Literal:
        return isinstance(data, str) and data in get_args(hint)
    if get_origin(hint) is tuple:
        return isinstance(data, Sequence) and not isinstance(data, str)
    if hint in (float, int):
        whole = (
            hint is float or isinstance(data, int) or (isinstance(data, float) and data % 1 == 0)
        )
        return isinstance(data, int | float) and not isinstance(data, bool) and whole
    return isinstance(hint, type) and isinstance(data, hint)


def _to_float(data: Any) -> float:
    try:
        return float(data)
    except OverflowError:
        return float("inf")


def _kind(hint: Any) -> str | None:
    """What the JSON key "kind" says of a record that is one of several; None for other types."""
    if not is_dataclass(hint) or any(field.name == "kind" for field in fields(hint)):
        return None
    return getattr(hint, "kind", None)


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def _hint(key: Any, known: Sequence[str]) -> str:
    near = get_close_matches(str(key), known, n=1)
    if near:
        return f'did you mean "{near[0]}"?'
    return "use " + (" or ".join(f'"{name}"' for name in known)) + "."
