"""How well a name's words fit each channel.

A pattern says, for each thing that words can say, which values fit and how well; "" is for names
that do not say it. The fit of a name is the product, less a little for every word that is not
known. Nothing else than what is listed fits.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from ..channels import find_channel
from ..frames import AXLES, CORNERS, AxleName, Corner
from .names import Reading

STRANGE_WORD, MOST_STRANGE = 0.95, 4
"""What each unknown word leaves of a fit, and how many count."""

BARE_AXIS = 0.7
"""What a name leaves of a fit that says an axis, x, y or z, and nothing else."""

Fits = Mapping[str, float]

_CORNER_OF: Mapping[tuple[str, str], Corner] = {
    (axle, side): corner
    for corner, (axle, side) in zip(
        CORNERS, [(axle, side) for axle in AXLES for side in ("left", "right")], strict=True
    )
}


@dataclass(frozen=True, slots=True)
class Pattern:
    """What a name of a channel says; `{corner}` or `{axle}` in `channel` is what the name says."""

    channel: str
    quantity: Fits
    axis: Fits = field(default_factory=lambda: {"": 1.0})
    part: Fits = field(default_factory=lambda: {"": 1.0})


_BODY: Fits = {"chassis": 1.0, "": 0.9}
_HEIGHT: Fits = {"displacement": 1.0, "": 0.85}
_UP: Fits = {"z": 1.0, "": 0.9}
_RATE: Fits = {"rate": 1.0, "velocity": 0.95}
_FORCE: Fits = {"force": 1.0}

PATTERNS = (
    Pattern("time", {"time": 1.0}),
    Pattern("chassis.z", {"displacement": 1.0, "travel": 0.6, "": 0.75}, {"z": 1.0}, _BODY),
    Pattern("chassis.pitch", {"angle": 1.0, "": 0.9}, {"pitch": 1.0}, _BODY),
    Pattern("chassis.pitch", {"angle": 0.9}, {"y": 1.0}, _BODY),
    Pattern("chassis.roll", {"angle": 1.0, "": 0.9}, {"roll": 1.0}, _BODY),
    Pattern("chassis.roll", {"angle": 0.9}, {"x": 1.0}, _BODY),
    Pattern("chassis.a_x", {"acceleration": 1.0}, {"x": 1.0, "": 0.5}, {**_BODY, "brake": 0.8}),
    # Which of the two an acceleration along the car is, the other columns tell.
    Pattern("chassis.body_a_x", {"acceleration": 0.4}, {"x": 1.0}, _BODY),
    Pattern("chassis.body_a_y", {"acceleration": 1.0}, {"y": 1.0}, _BODY),
    Pattern("chassis.body_a_z", {"acceleration": 1.0}, {"z": 1.0}, _BODY),
    Pattern("chassis.a_z", {"acceleration": 0.9}, {"z": 1.0}, _BODY),
    Pattern("chassis.v_x", {"velocity": 1.0}, {"x": 1.0, "": 0.95}, _BODY),
    Pattern("chassis.x", {"displacement": 1.0}, {"x": 1.0, "": 0.4}, _BODY),
    Pattern("chassis.z_rate", {"velocity": 1.0, "rate": 0.9}, {"z": 1.0}, _BODY),
    Pattern("chassis.pitch_rate", _RATE, {"pitch": 1.0, "y": 0.9}, _BODY),
    Pattern("chassis.roll_rate", _RATE, {"roll": 1.0}, _BODY),
    Pattern("chassis.roll_rate", {"rate": 1.0}, {"x": 0.9}, _BODY),
    Pattern("wheel.{corner}.z", {**_HEIGHT, "travel": 0.55}, _UP, {"wheel": 1.0, "": 0.55}),
    Pattern("wheel.{corner}.a_z", {"acceleration": 1.0}, _UP, {"wheel": 1.0, "hub": 1.0}),
    Pattern("wheel.{corner}.speed", {"velocity": 1.0}, {"": 1.0, "x": 0.9}, {"wheel": 1.0}),
    Pattern(
        "suspension.{corner}.travel",
        {"travel": 1.0, "displacement": 0.95, "": 0.7},
        _UP | {"": 1.0},
        {"suspension": 1.0, "spring": 0.9, "damper": 0.9, "wheel": 0.7, "": 0.6},
    ),
    Pattern(
        "tyre.{corner}.load",
        _FORCE,
        {"z": 1.0, "": 0.8},
        {"tyre": 1.0, "wheel": 0.95, "chassis": 0.8, "": 0.8},
    ),
    Pattern("suspension.{corner}.spring_force", _FORCE, _UP | {"": 1.0}, {"spring": 1.0}),
    Pattern("suspension.{corner}.damper_force", _FORCE, _UP | {"": 1.0}, {"damper": 1.0}),
    Pattern("arm.{corner}.angle", {"angle": 1.0, "": 0.7}, {"": 1.0}, {"arm": 1.0}),
    Pattern("road.{corner}.z", {**_HEIGHT}, _UP, {"road": 1.0}),
    Pattern("post.{corner}.z", {**_HEIGHT}, _UP, {"post": 1.0}),
    Pattern("drive.{corner}.torque", {"torque": 1.0}, {"": 1.0, "y": 1.0}, {"drive": 1.0}),
    Pattern("brake.{corner}.torque", {"torque": 1.0}, {"": 1.0, "y": 1.0}, {"brake": 1.0}),
    Pattern("stabilizer_bar.{axle}.torque", {"torque": 1.0}, part={"stabilizer": 1.0}),
    *(
        Pattern(f"seat.{{point}}.a_{axis}", {"acceleration": 1.0}, {axis: 1.0}, {"seat": 1.0})
        for axis in "xyz"
    ),
)

MEASURES: Mapping[str, str] = {
    "s": "time",
    "m": "displacement",
    "rad": "angle",
    "m/s": "velocity",
    "rad/s": "rate",
    "m/s^2": "acceleration",
    "N": "force",
    "N m": "torque",
}
"""The quantity that a unit in SI measures."""


def fits(reading: Reading, measured: str) -> Iterator[tuple[str, float]]:
    """Channels that a name fits, each with how well, from above 0 to 1; perhaps more than once.

    measured : what the column's unit measures, "" where it has none; it stands for what the name
        does not say
    """
    quantity = reading.said.get("quantity", "") or measured
    kept = STRANGE_WORD ** min(reading.strange, MOST_STRANGE)
    if reading.said.keys() == {"axis"} and reading.said["axis"] in "xyz":
        kept *= BARE_AXIS
    for pattern in PATTERNS:
        fit = kept * pattern.quantity.get(quantity, 0.0)
        fit *= pattern.axis.get(reading.said.get("axis", ""), 0.0)
        fit *= pattern.part.get(reading.said.get("part", ""), 0.0)
        if fit > 0.0 and find_channel(name := _placed(pattern.channel, reading.said)):
            yield name, fit


def _placed(channel: str, said: Mapping[str, str]) -> str:
    """The channel at the place on the car that a name says, "" where it says another one."""
    axle, side = said.get("axle", ""), said.get("side", "")
    if "{corner}" in channel:
        corner = _CORNER_OF.get((axle, side))
        return channel.replace("{corner}", corner) if corner else ""
    if "{axle}" in channel:
        known: AxleName | None = next((one for one in AXLES if one == axle), None)
        return channel.replace("{axle}", known) if known and not side else ""
    if "{point}" in channel:
        return channel.replace("{point}", said.get("point", "driver"))
    return "" if axle or side or "point" in said else channel
