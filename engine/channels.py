"""The table of channels: name, unit and sign of every time history, wherever it appears.

Simulation output, measurement files, charts, REST and the command line use these names. A row
with `{corner}` or `{axle}` stands for four or two channels; accelerations at chassis points such
as `seat.driver.a_z` follow a pattern, since the points are the user's own.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from types import MappingProxyType

from .errors import MeasurementError
from .frames import AXLES, CORNERS

_MILLI = ("mm", 1e3)
_DEGREE = ("deg", 180.0 / math.pi)
_KILO = ("kN", 1e-3)


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """What a channel is: SI unit, how a page shows it (display = SI * factor), sign.

    largest, smallest : magnitudes in SI between which the greatest value of a real recording
        lies; outside them the unit in the file is doubtful. 0 and infinity where none is known.
    """

    name: str
    unit: str
    quantity: str
    label: str
    sign: str
    display_unit: str
    display_factor: float
    largest: float = math.inf
    smallest: float = 0.0


def _row(
    name: str,
    unit: str,
    quantity: str,
    label: str,
    sign: str,
    display: tuple[str, float] | None = None,
    *,
    largest: float = math.inf,
    smallest: float = 0.0,
) -> ChannelInfo:
    shown, factor = display or (unit, 1.0)
    return ChannelInfo(name, unit, quantity, label, sign, shown, factor, largest, smallest)


WHEEL_CHANNELS = tuple(f"wheel.{corner}.z" for corner in CORNERS)
INPUT_CHANNELS = (*WHEEL_CHANNELS, "chassis.a_x")
"""What drives the model in the rims mode."""

OUTPUT_CHANNELS = ("chassis.z", "chassis.pitch", "chassis.roll")
"""What the model is compared with there; a recording needs at least one."""

SMALLEST_NOISE, LARGEST_NOISE = 1e-12, 1e12
"""Between which the standard deviation of a channel's noise must lie, SI: far beyond what any
sensor has, and squares of residuals over it are numbers still."""

CHANNEL_KINDS: tuple[ChannelInfo, ...] = (
    _row("time", "s", "time", "Time", "strictly increasing"),
    _row(
        "chassis.z",
        "m",
        "displacement",
        "Chassis vertical displacement",
        "of the sprung mass's CG from rest, up",
        _MILLI,
        largest=0.5,
        smallest=1e-4,
    ),
    _row("chassis.pitch", "rad", "angle", "Chassis pitch", "nose down", _DEGREE, largest=0.35),
    _row("chassis.roll", "rad", "angle", "Chassis roll", "left side up", _DEGREE, largest=0.35),
    _row(
        "chassis.a_x",
        "m/s^2",
        "acceleration",
        "Chassis longitudinal acceleration",
        "forward, inertial",
        largest=20.0,
    ),
    _row("chassis.v_x", "m/s", "speed", "Speed", "forward", ("km/h", 3.6), largest=120.0),
    _row("chassis.x", "m", "distance", "Distance travelled", "forward"),
    _row(
        "wheel.{corner}.z",
        "m",
        "displacement",
        "{corner} wheel centre vertical displacement",
        "of the rim centre from rest, up",
        _MILLI,
        largest=0.5,
        smallest=1e-4,
    ),
    _row(
        "tyre.{corner}.load", "N", "force", "{corner} tyre load", "compression", _KILO, largest=1e5
    ),
    _row(
        "suspension.{corner}.travel",
        "m",
        "displacement",
        "{corner} suspension travel",
        "jounce",
        _MILLI,
        largest=0.5,
    ),
    _row(
        "suspension.{corner}.spring_force",
        "N",
        "force",
        "{corner} spring force",
        "compression, preload included",
        _KILO,
        largest=1e5,
    ),
    _row(
        "suspension.{corner}.damper_force",
        "N",
        "force",
        "{corner} damper force",
        "compression",
        _KILO,
        largest=1e5,
    ),
    _row(
        "arm.{corner}.angle",
        "rad",
        "angle",
        "{corner} trailing arm angle",
        "about +y relative to the chassis: the front wheel falls, the rear wheel rises",
        _DEGREE,
        largest=1.6,
    ),
    _row(
        "road.{corner}.z", "m", "displacement", "Road height under the {corner} wheel", "up", _MILLI
    ),
    _row(
        "drive.{corner}.torque",
        "N m",
        "torque",
        "{corner} drive torque",
        "forward, from the chassis on the arm",
        largest=2e4,
    ),
    _row(
        "brake.{corner}.torque",
        "N m",
        "torque",
        "{corner} brake torque",
        "braking, a positive number",
        largest=2e4,
    ),
    _row(
        "post.{corner}.z",
        "m",
        "displacement",
        "{corner} post height",
        "of the contact point, up",
        _MILLI,
        largest=0.5,
        smallest=1e-4,
    ),
    _row("chassis.z_rate", "m/s", "speed", "Chassis vertical rate", "up", largest=20.0),
    _row(
        "chassis.pitch_rate",
        "rad/s",
        "angular rate",
        "Chassis pitch rate",
        "nose down",
        ("deg/s", _DEGREE[1]),
        largest=5.0,
    ),
    _row(
        "chassis.roll_rate",
        "rad/s",
        "angular rate",
        "Chassis roll rate",
        "left side up",
        ("deg/s", _DEGREE[1]),
        largest=5.0,
    ),
    _row(
        "stabilizer_bar.{axle}.torque",
        "N m",
        "torque",
        "{axle} stabilizer bar torque",
        "by the left arm's angle less the right one's",
        largest=2e5,
    ),
    _row(
        "mount.{corner}.force_x",
        "N",
        "force",
        "{corner} mount force on the chassis, along",
        "forward, in the chassis's axes",
        _KILO,
    ),
    _row(
        "mount.{corner}.force_z",
        "N",
        "force",
        "{corner} mount force on the chassis, vertical",
        "up, in the chassis's axes",
        _KILO,
    ),
    _row(
        "pivot.{corner}.force_x",
        "N",
        "force",
        "{corner} pivot force on the chassis, along",
        "forward, in the chassis's axes",
        _KILO,
    ),
    _row(
        "pivot.{corner}.force_z",
        "N",
        "force",
        "{corner} pivot force on the chassis, vertical",
        "up, in the chassis's axes",
        _KILO,
    ),
    _row(
        "chassis.a_z",
        "m/s^2",
        "acceleration",
        "Chassis vertical acceleration",
        "of the CG, up, inertial",
        largest=50.0,
    ),
    _row(
        "chassis.body_a_x",
        "m/s^2",
        "acceleration",
        "Body-fixed accelerometer, along",
        "forward in the body's axes, gravity included",
        largest=50.0,
    ),
    _row(
        "chassis.body_a_y",
        "m/s^2",
        "acceleration",
        "Body-fixed accelerometer, across",
        "left in the body's axes, gravity included",
        largest=50.0,
    ),
    _row(
        "chassis.body_a_z",
        "m/s^2",
        "acceleration",
        "Body-fixed accelerometer, vertical",
        "up in the body's axes, gravity included: 9.81 at rest",
        largest=60.0,
    ),
    _row(
        "wheel.{corner}.a_z",
        "m/s^2",
        "acceleration",
        "{corner} hub accelerometer, vertical",
        "up in the wheel carrier's axes, gravity included: 9.81 at rest",
        largest=1000.0,
    ),
    _row(
        "wheel.{corner}.speed",
        "m/s",
        "speed",
        "{corner} wheel speed",
        "forward, of the tread",
        ("km/h", 3.6),
        largest=120.0,
    ),
)
"""The rows as documented."""

_POINT = re.compile(r"(seat|point)\.([a-z][a-z0-9_]{0,39})\.a_([xyz])")
_POINT_SIGN = {"x": "forward", "y": "left", "z": "up"}
_CORNER_WORDS = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}


def _expanded(row: ChannelInfo) -> Iterator[ChannelInfo]:
    """The channels a row stands for."""
    for place, words in (
        ("{corner}", {corner: _CORNER_WORDS[corner] for corner in CORNERS}),
        ("{axle}", {axle: axle for axle in AXLES}),
    ):
        if place in row.name:
            for key, word in words.items():
                label = row.label.replace(place, word)
                label = label[0].upper() + label[1:]
                yield replace(row, name=row.name.replace(place, key), label=label)
            return
    yield row


CHANNELS: Mapping[str, ChannelInfo] = MappingProxyType(
    {info.name: info for row in CHANNEL_KINDS for info in _expanded(row)}
)
"""Every channel with a fixed name, in the order of the table."""

RAW_CHANNELS: frozenset[str] = frozenset(
    name
    for name in CHANNELS
    if name == "chassis.a_z"
    or name.startswith("chassis.body_a_")
    or (name.startswith("wheel.") and not name.endswith(".z"))
)
"""What instruments record and no simulation has; `conditioning` makes other channels of them."""

_ORDER = {name: position for position, name in enumerate(CHANNELS)}


def in_order(names: Iterable[str]) -> list[str]:
    """Names of channels in the order of the table; those of points come last, by name."""
    return sorted(names, key=lambda name: (_ORDER.get(name, len(_ORDER)), name))


def find_channel(name: str) -> ChannelInfo | None:
    """What a channel is, or None for a name that is not ours."""
    if name in CHANNELS:
        return CHANNELS[name]
    if match := _POINT.fullmatch(name):
        kind, point, axis = match.groups()
        where = f"{point.replace('_', ' ')}{' seat' if kind == 'seat' else ''}"
        return _row(
            name,
            "m/s^2",
            "acceleration",
            f"Acceleration along {axis} at {where}",
            _POINT_SIGN[axis],
            largest=300.0,
        )
    return None


def channel(name: str) -> ChannelInfo:
    """What a channel is; an unknown name is refused with the nearest known one."""
    info = find_channel(name)
    if info is None:
        near = near_channel(name)
        hint = f"did you mean {near}?" if near else "see the table of channels."
        raise MeasurementError(f"No channel is called '{name}'; {hint}")
    return info


def near_channel(name: str) -> str | None:
    """The known channel a name may be a misspelling of; case and separators do not count."""
    bare = _bare(name)
    # At a ratio of 0.8 the longer text has at most 1.5 times the letters of the other.
    alike = [known for known in CHANNELS if len(bare) <= 1.5 * len(_bare(known))]
    ratio, best = max(
        ((SequenceMatcher(None, bare, _bare(known)).ratio(), known) for known in alike),
        default=(0.0, None),
    )
    return best if ratio >= 0.8 else None


def _bare(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


_RAW = re.compile(r"chassis\.(body_a_[xyz]|a_z|pitch_rate|roll_rate)|wheel\.\w+\.a_z")


def conditioned_first(names: Iterable[str]) -> str:
    """What to do with a run that lacks what a fit needs, where gyros and accelerometers are among
    its channels: the end of a sentence, else empty.
    """
    raw = [name for name in names if _RAW.fullmatch(name)]
    if not raw:
        return ""
    return f"; make them of raw sensors such as {raw[0]} first, with ridetune condition"
