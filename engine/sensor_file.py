"""A file of sensors, TOML or JSON by its content, and what must hold for a set to be used.

    rate_hz = 200                          # of the recording

    [points]                               # from the sprung mass's CG in the car's axes, m
    "point.boot" = [-1.5, 0.0, 0.2]

    [sensors."wheel.{corner}.z"]           # all four
    unit = "mm"                            # of noise, bias and resolution, and in the files
    noise = 0.5
    resolution = 0.01
    rate_hz = 100
    cutoff_hz = 40                         # anti-alias filter

    [sensors."chassis.a_x"]
    bias = 0.02
    delay = 0.01

What `sensors` lists is recorded, and nothing else; without it the usual channels, ideally.
"""

from codecs import BOM_UTF8
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Any

from .channels import RAW_CHANNELS, channel
from .errors import MeasurementError
from .frames import AXLES, CORNERS
from .json_record import RecordReader, describe
from .json_text import parse_json
from .sensors import RATE, RECORDED, Sensor, SensorSet
from .short_file import read_short
from .toml_text import LARGEST_FILE, parse_toml
from .units import UnitError
from .vehicle import Range

KEYS = ("rate_hz", "points", "sensors")
MOST_CHANNELS = 200
DEEPEST = 8
"""Tables in one another that the name of a channel may be written as."""

Rate = Annotated[float, Range("Hz", 1.0, 1e5)]
Position = tuple[
    Annotated[float, Range("m", -20.0, 20.0)],
    Annotated[float, Range("m", -20.0, 20.0)],
    Annotated[float, Range("m", -20.0, 20.0)],
]


def noisy(noise: Mapping[str, float], source: str) -> SensorSet:
    """The usual channels at the usual rate, with noise on some (standard deviation, SI)."""
    for name in noise:
        if name not in RECORDED:
            raise MeasurementError(
                f"{source}: noise is stated of {name}, which is not recorded; give it for one of"
                f" {', '.join(RECORDED)}, or use a file of sensors."
            )
    sensors = {name: Sensor(noise=noise.get(name, 0.0)) for name in RECORDED}
    return SensorSet(sensors=sensors, source=source)


def read_sensors(path: Path) -> SensorSet:
    """The set in a TOML or JSON file; every message starts with the file's name."""
    data = read_short(path, LARGEST_FILE, MeasurementError)
    return sensors_from_json(content_of(data, path.name), path.name)


def content_of(data: bytes, source: str) -> Any:
    """What a file says, TOML or JSON, as parsed and not looked at; MeasurementError names it."""
    if len(data) > LARGEST_FILE:
        raise MeasurementError(f"{source}: larger than 1 MB; a file of sensors is short.")
    if data.removeprefix(BOM_UTF8).lstrip().startswith(b"{"):
        return parse_json(data, source, MeasurementError)
    return parse_toml(data, source)


def sensors_from_json(data: Any, source: str = "sensors") -> SensorSet:
    """The set in parsed TOML or JSON; MeasurementError names source and place."""
    reader = RecordReader(source, MeasurementError)
    if not isinstance(data, Mapping):
        raise reader.refuse("", f"must be an object {{...}}, not {describe(data)}.")
    reader.check_keys(data, KEYS, "")
    rate = reader.value(Rate, data.get("rate_hz", RATE), "rate_hz")
    points = {
        name: _point(reader, name, value)
        for name, value in _leaves(reader, data.get("points", {}), "points").items()
    }
    if "sensors" not in data:
        return SensorSet(rate, points=points, source=source)
    sensors = {}
    for name, value in _leaves(reader, data["sensors"], "sensors").items():
        sensor = reader.record(Sensor, value, f"sensors.{name}")
        for one in _channels(reader, name):
            try:
                sensor.si_factor(one)
            except UnitError as error:
                raise reader.refuse(
                    f"sensors.{name}.unit", f"cannot be: {error}; correct it."
                ) from error
            sensors[one] = sensor
    if not 0 < len(sensors) <= MOST_CHANNELS:
        raise reader.refuse("sensors", f"lists {len(sensors)} channels; give 1 to {MOST_CHANNELS}.")
    return SensorSet(rate, sensors, points, source)


def check_sensors(
    sensors: SensorSet, *, car: str, step: float, duration: float, offered: Collection[str]
) -> None:
    """Refuse what cannot be measured; MeasurementError names source and sensor.

    step : of the simulation of the car so called, s;  duration : of the shortest run, s
    offered : channels that the car has, its points' accelerations included
    """

    def refuse(place: str, sentence: str) -> MeasurementError:
        return MeasurementError(f"{sensors.source}: {place} {sentence}")

    fastest, rate = 1.0 / step, sensors.rate_hz
    if rate > fastest * (1.0 + 1e-9):
        raise refuse(
            "rate_hz",
            f"is {rate:g}, but the {car} car is simulated in steps of {1e3 * step:g} ms,"
            f" {fastest:g} Hz; take no more than that.",
        )
    if sensors.samples(duration) < 2:
        raise refuse(
            "rate_hz",
            f"is {rate:g}, which leaves a run of {duration:g} s one sample; take {1 / duration:g}"
            " or more.",
        )
    for name, sensor in sensors.sensors.items():
        place, own = f"sensors.{name}", sensor.rate_hz or rate
        if name not in offered:
            raise refuse(place, _not_offered(name, car))
        if own > rate:
            raise refuse(
                f"{place}.rate_hz",
                f"is {own:g}, more than the recording's rate_hz of {rate:g}; raise that or lower"
                " this.",
            )
        if sensor.cutoff_hz is not None and sensor.cutoff_hz >= 0.5 * own:
            raise refuse(
                f"{place}.cutoff_hz",
                f"is {sensor.cutoff_hz:g}, which lets through what {own:g} Hz cannot show; take"
                f" less than {0.5 * own:g}, or leave the filter out.",
            )
        if sensor.delay >= duration:
            raise refuse(
                f"{place}.delay",
                f"is {sensor.delay:g} s, as long as a run of {duration:g} s; shorten it.",
            )


def _not_offered(name: str, car: str) -> str:
    point, dot, axis = name.rpartition(".")
    if axis.startswith("a_") and point.partition(".")[0] in ("seat", "point") and dot:
        return f"is at a point that is not known; add points.{point} = [x, y, z] in metres."
    if name in RAW_CHANNELS:
        return (
            "is what raw instruments record, and no simulated car has it; name what conditioning"
            f" makes of it, such as {', '.join(RECORDED[:4])}, or an accelerometer at a point."
        )
    return f"is nothing that the {car} car on a road has; leave it out."


def _leaves(reader: RecordReader, table: Any, path: str) -> dict[str, Any]:
    """By dotted name, what lies in a table whose names may be written without quotes."""
    if not isinstance(table, Mapping):
        raise reader.refuse(path, f"must be a table, not {describe(table)}.")
    if path.count(".") > DEEPEST:
        raise reader.refuse(path, "is nested deeper than any channel's name has dots; correct it.")
    found: dict[str, Any] = {}
    for name, value in table.items():
        nested = isinstance(value, Mapping) and any(isinstance(v, Mapping) for v in value.values())
        deeper = nested or (path.startswith("points") and isinstance(value, Mapping))
        leaves = _leaves(reader, value, f"{path}.{name}") if deeper else {"": value}
        found |= {f"{name}.{rest}" if rest else name: leaf for rest, leaf in leaves.items()}
    return found


def _point(reader: RecordReader, name: str, value: Any) -> tuple[float, float, float]:
    place = f"points.{name}"
    if name.partition(".")[0] not in ("seat", "point"):
        raise reader.refuse(place, 'must be called "seat.NAME" or "point.NAME"; rename it.')
    _known(reader, f"{name}.a_z", place)
    return reader.value(Position, value, place)


def _channels(reader: RecordReader, name: str) -> list[str]:
    """The channels that a name stands for; one with {corner} or {axle} for several."""
    for place, words in (("{corner}", CORNERS), ("{axle}", AXLES)):
        if place in name:
            names = [name.replace(place, word) for word in words]
            break
    else:
        names = [name]
    for one in names:
        _known(reader, one, f"sensors.{name}")
    if "time" in names:
        raise reader.refuse("sensors.time", "is always recorded; leave it out.")
    return names


def _known(reader: RecordReader, name: str, place: str) -> None:
    try:
        channel(name)
    except MeasurementError as error:
        raise reader.refuse(place, f"is not known: {error}") from error
