"""Texts that people write, JSON and TOML, with their values, keys and letters spoilt.

A text is read or refused with one sentence; what was read is written and reads back equal, and
does what it is for: a manoeuvre makes a demand, a mapping a run, sensors are checked.
"""

import json
import random
import signal
import time
import tomllib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from ridetune.engine.errors import ManoeuvreError, MeasurementError, RideError
from ridetune.engine.formats.table import Column, HeldTable
from ridetune.engine.json_text import parse_json
from ridetune.engine.manoeuvre import manoeuvre_from_json, manoeuvre_to_json, reference_manoeuvres
from ridetune.engine.mapping.apply import apply
from ridetune.engine.mapping.mapping import mapping_from_json, mapping_to_json
from ridetune.engine.run_notes import parse_notes
from ridetune.engine.sensor_file import check_sensors, content_of, sensors_from_json
from ridetune.engine.sensors import RECORDED
from ridetune.engine.vehicle_file import (
    reference_vehicles,
    vehicle_from_json,
    vehicle_from_text,
    vehicle_to_json,
)

from tests.files_of_kinds import A_X, TIME, Z
from tests.fuzz.findings import SLOWEST, Tally, check_text, sentence, shape
from tests.fuzz.mutations import spoilt

NAN, INF = float("nan"), float("inf")
VALUES: tuple[Any, ...] = (None, True, False, 0, 1, -1, -0.0, 1e308, -1e308, 5e-324, 1e-12, 10**30)
VALUES += (
    10**400,
    NAN,
    INF,
    -INF,
    "",
    "x" * 10_000,
    "\ud800",
    "\0",
    "a\nb",
    "\u2028",
    "nan",
    "1e5",
)
VALUES += ("{", "'", '"', "\\", [], {}, [[]], {"kind": "x"}, {"kind": None}, [1, "a"], [0.0] * 3)
VALUES += ([1] * 100_001, {"": {}}, {"a": 1}, 2**63, -(2**64), 0.1, 1e5, "chassis.z", "time", "mm")

TABLE = HeldTable(
    "texts.csv",
    "CSV",
    tuple(Column(name, unit, 50) for name, unit in (("time", "s"), ("z", "mm"), ("a", "m/s^2"))),
    (TIME, Z, A_X),
)


def vehicle(data: bytes, name: str) -> None:
    """Read, write, read."""
    found = vehicle_from_text(data, name)
    assert vehicle_from_json(_written(vehicle_to_json(found))) == found, "reads back another"


def manoeuvre(data: bytes, name: str) -> None:
    """The same, and what it asks of a car."""
    found = manoeuvre_from_json(parse_json(data, name, ManoeuvreError), name)
    assert manoeuvre_from_json(_written(manoeuvre_to_json(found))) == found, "reads back another"
    try:
        found.demand(reference_vehicles()["paper"])
    except RideError as error:
        check_text(str(error))


def mapping(data: bytes, name: str) -> None:
    """The same, and the run of a table."""
    found = mapping_from_json(parse_json(data, name, MeasurementError), name)
    assert mapping_from_json(_written(mapping_to_json(found))) == found, "reads back another"
    try:
        apply(found, TABLE)
    except RideError as error:
        sentence(error, TABLE.source)


def sensors(data: bytes, name: str) -> None:
    """Read and checked."""
    found = sensors_from_json(content_of(data, name), name)
    check_sensors(found, car="car", step=0.0025, duration=20.0, offered={*RECORDED})


def notes(data: bytes, name: str) -> None:
    """Read."""
    parse_notes(data, name)


def _written(data: Any) -> Any:
    return json.loads(json.dumps(data, allow_nan=False))


MAPPING = {
    "columns": [
        {"column": "time", "channel": "time", "unit": "s"},
        {"column": "z", "group": "", "channel": "chassis.z", "unit": "mm", "sign": -1, "gain": 1.0},
        {"column": "a", "channel": "chassis.a_x", "unit": "m/s^2", "missing": [-64.0], "note": "n"},
    ],
    "longest_gap": 0.1,
    "step": 0.01,
}
SENSORS = """
rate_hz = 100
[points]
"point.boot" = [-1.5, 0, 0.2]
[sensors."wheel.{corner}.z"]
unit = "mm"
noise = 0.5
resolution = 0.01
rate_hz = 50
cutoff_hz = 20
[sensors.chassis.a_x]
bias = 0.02
delay = 0.01
"""
NOTES = """
description = "wet road"
date = 2026-05-04T00:00:00+00:00
[noise]
"chassis.z" = 0.0005
wheel.fl.z = 1e-4
[[conditioning]]
channels = ["chassis.z"]
sentences = ["Resampled."]
[conditioning.step]
kind = "resample"
[conditioning.numbers]
step = 0.005
[conditioning.band_hz]
high = 40.0
"""


def _vehicles() -> list[Any]:
    found = [vehicle_to_json(one) for one in reference_vehicles().values()]
    return [*found, {"vehicle": found[0], "runs": []}]


KINDS: dict[str, tuple[Callable[[bytes, str], None], Callable[[], list[Any]], str]] = {
    "vehicle": (vehicle, _vehicles, "json"),
    "manoeuvre": (
        manoeuvre,
        lambda: [manoeuvre_to_json(one) for one in reference_manoeuvres().values()],
        "json",
    ),
    "mapping": (mapping, lambda: [MAPPING], "json"),
    "sensors": (sensors, lambda: [SENSORS], "toml"),
    "notes": (notes, lambda: [NOTES], "toml"),
}
"""Who reads a kind, what is sound of it (data of JSON, or TOML), and how it is written."""


def outcomes(kind: str, seconds: float, seed: int, keep: Path, fewest: int = 10) -> Tally:
    """What comes of texts of one kind, for some seconds; see `fuzz.outcomes`."""
    read, make, form = KINDS[kind]
    tally, begun, many = Tally(), time.monotonic(), 0
    chance, sound = random.Random(f"{kind} {seed}"), make()
    signal.signal(signal.SIGVTALRM, _too_long)
    while many < fewest or time.monotonic() - begun < seconds:
        many += 1
        data = text(chance.choice(sound), form, chance)
        name, here = f"wrong.{form}", time.process_time()
        signal.setitimer(signal.ITIMER_VIRTUAL, SLOWEST)
        try:
            read(data, name)
            outcome = "read"
        except RideError as error:
            try:
                outcome = shape(sentence(error, name), name)
            except AssertionError as wrong:
                outcome = tally.found(wrong, {name: data}, keep)
        except Exception as error:
            outcome = tally.found(error, {name: data}, keep)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        tally.cpu = max(tally.cpu, time.process_time() - here)
        tally.outcomes[outcome] += 1
    tally.seconds = time.monotonic() - begun
    return tally


def _too_long(*_: object) -> None:
    raise AssertionError("slow")


def text(sound: Any, form: str, chance: random.Random) -> bytes:
    """A text whose values, keys or letters are spoilt."""
    data = tomllib.loads(sound) if isinstance(sound, str) else sound
    plain = sound if isinstance(sound, str) else json.dumps(data)
    if chance.random() < 0.35:
        return _encoded(_letters(plain, chance), chance)
    for _ in range(chance.choice([1, 1, 1, 2, 4])):
        data = changed(data, chance)
    if form == "json" or chance.random() < 0.2:
        return json.dumps(data, default=str).encode("utf-8", "surrogatepass")
    return _toml(data, chance).encode("utf-8", "surrogatepass")


def changed(data: Any, chance: random.Random) -> Any:
    """Data with one value or key changed somewhere."""
    if isinstance(data, dict) and data and chance.random() < 0.85:
        key = chance.choice(list(data))
        return _at_key(data, key, chance)
    if isinstance(data, list) and data and chance.random() < 0.8:
        at, what = chance.randrange(len(data)), chance.randrange(6)
        if what == 0:
            return data[:at] + data[at + 1 :]
        if what == 1:
            return data * (300 if len(str(data)) < 1000 else 2)
        return [*data[:at], changed(data[at], chance), *data[at + 1 :]]
    if isinstance(data, int | float) and chance.random() < 0.5:
        with suppress(OverflowError):
            return data * chance.choice([-1, 0, 2, 1e3, 1e-3, 1e9, 1e300, 0.5])
    what = chance.randrange(12)
    if what == 0:
        return [data]
    if what == 1:
        return {"a": data}
    if what == 2:
        return _nested(chance.choice([3, 100, 900, 5000]), chance)
    return chance.choice(VALUES)


def _at_key(data: dict[str, Any], key: str, chance: random.Random) -> dict[str, Any]:
    what = chance.randrange(10)
    if what == 0:
        return {name: one for name, one in data.items() if name != key}
    if what == 1:
        wrong = [key + "x", key.upper(), key[:-1], "", "\n", "x" * 5000, "\ud800", "kind", "a.b"]
        return {chance.choice(wrong) if name == key else name: one for name, one in data.items()}
    if what == 2:
        return {**data, key: data[chance.choice(list(data))]}
    if what == 3:
        return {**data, **{f"{key}{k}": data[key] for k in range(chance.choice([1, 500]))}}
    return {**data, key: changed(data[key], chance)}


def _nested(depth: int, chance: random.Random) -> Any:
    held: Any = 1
    for _ in range(min(depth, 200)):
        held = {"a": held} if chance.random() < 0.5 else [held]
    return held


def _letters(plain: str, chance: random.Random) -> str:
    """The text itself spoilt, or in a way that a reader may not bear."""
    what, at = chance.randrange(8), chance.randrange(len(plain))
    depth = chance.choice([100, 1000, 100_000])
    if what == 0:
        return plain[:at] + "[" * depth + plain[at:]
    if what == 1:
        return plain + "\n" + plain
    if what == 2:
        dots = ".".join(["a"] * chance.choice([10, 150, 199, 250, 20_000]))
        return f"{plain}\n[{dots}]\n{dots} = {'{a=' * (depth // 10)}1{'}' * (depth // 10)}\n"
    if what == 3:
        return plain.replace("\n", chance.choice(["\r\n", "\r", "\n\n", "\u2028", ""]))
    if what == 4:
        tail = chance.choice(
            ["[[x]]\n", "[noise]\n", "[x]\n", "x = 1\n", "'''", '{"a": ', "1e5 = 1\n"]
        )
        return plain + tail * chance.choice([1, 2, 3000])
    return spoilt(plain.encode(), b"0.5 [noise] {}", chance).decode("utf-8", "surrogateescape")


def _encoded(said: str, chance: random.Random) -> bytes:
    encoding = chance.choice(["utf-8"] * 6 + ["utf-8-sig", "utf-16", "cp1252"])
    errors = "surrogateescape" if encoding == "utf-8" else "replace"
    with suppress(UnicodeEncodeError):
        return said.encode(encoding, errors)
    return said.encode("utf-8", "replace")


def _toml(data: Any, chance: random.Random) -> str:
    if not isinstance(data, dict):
        return _inline(data)
    lines = []
    for key, one in data.items():
        if isinstance(one, dict) and one and chance.random() < 0.5:
            lines.append(f"[{json.dumps(key)}]")
            lines += [f"{json.dumps(name)} = {_inline(inner)}" for name, inner in one.items()]
        else:
            lines.insert(0, f"{json.dumps(key)} = {_inline(one)}")
    return "\n".join(lines)


def _inline(data: Any) -> str:
    if isinstance(data, dict):
        inner = ", ".join(f"{json.dumps(key)} = {_inline(one)}" for key, one in data.items())
        return f"{{{inner}}}"
    if isinstance(data, list):
        return f"[{', '.join(map(_inline, data))}]"
    if data is None:
        return '""'
    if isinstance(data, str | bool):
        return json.dumps(data)
    return str(data)
