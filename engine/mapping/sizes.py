"""The unit that a column's numbers fit: what a header says, held against how far a car moves.

Headers lie (a column called _g that held mg), so that the stated unit is believed only where the
numbers, turned into SI by it, have the size that a recording of the channel has. Where they have
not, and where no unit is stated, the unit is proposed that brings them nearest to the typical size,
and said why.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

from ..channels import ChannelInfo
from ..units import UnitError, to_si
from .numbers import Statistics
from .patterns import MEASURES

Measure = Literal["step", "peak", "swing", "level"]


class Size(NamedTuple):
    """The size of a channel in SI, by `measure` of `Statistics`: from, typically, to."""

    measure: Measure
    least: float
    typical: float
    most: float


UPRIGHT = Size("level", 9.0, 9.81, 10.6)
"""Of an accelerometer that reads gravity, m/s2, tilted or off by what sensors are."""

SIZES: Mapping[str, Size] = {
    "time": Size("step", 2e-6, 0.01, 0.21),
    "chassis.z": Size("swing", 3e-4, 0.02, 0.45),
    "chassis.pitch": Size("swing", 5e-4, 0.015, 0.35),
    "chassis.roll": Size("swing", 3e-4, 0.015, 0.35),
    "chassis.a_x": Size("swing", 0.03, 2.0, 16.0),
    "chassis.a_z": Size("swing", 0.03, 2.0, 60.0),
    "chassis.body_a_x": Size("swing", 0.03, 2.0, 30.0),
    "chassis.body_a_y": Size("swing", 5e-3, 1.0, 30.0),
    "chassis.body_a_z": UPRIGHT,
    "chassis.v_x": Size("peak", 0.3, 15.0, 95.0),
    "chassis.x": Size("peak", 0.5, 200.0, 1e6),
    "chassis.z_rate": Size("swing", 3e-3, 0.2, 8.0),
    "chassis.pitch_rate": Size("swing", 1e-3, 0.1, 4.0),
    "chassis.roll_rate": Size("swing", 1e-3, 0.1, 4.0),
    "wheel.a_z": UPRIGHT,
    "wheel.speed": Size("peak", 0.3, 15.0, 95.0),
    "wheel.z": Size("swing", 3e-4, 0.02, 0.45),
    "tyre.load": Size("peak", 100.0, 4000.0, 4e4),
    "suspension.travel": Size("swing", 3e-4, 0.02, 0.45),
    "suspension.spring_force": Size("peak", 50.0, 4000.0, 4e4),
    "suspension.damper_force": Size("peak", 20.0, 800.0, 2e4),
    "arm.angle": Size("swing", 5e-4, 0.03, 1.2),
    "road.z": Size("swing", 3e-4, 0.02, 5.0),
    "drive.torque": Size("peak", 5.0, 300.0, 8000.0),
    "brake.torque": Size("peak", 5.0, 500.0, 8000.0),
    "post.z": Size("swing", 3e-4, 0.02, 0.45),
    "stabilizer_bar.torque": Size("peak", 5.0, 300.0, 2e4),
}
"""By channel, its place left out. From a smooth road to what an axle reaches between its stops."""

OF_A_POINT = Size("swing", 0.03, 2.0, 80.0)
"""Of an acceleration at a point of the chassis, m/s2."""

UNITS: Mapping[str, tuple[str, ...]] = {
    "s": ("s", "ms", "us", "ns"),
    "m": ("m", "mm", "cm"),
    "rad": ("rad", "deg", "mrad"),
    "m/s": ("m/s", "km/h", "mm/s", "mph"),
    "rad/s": ("rad/s", "deg/s"),
    "m/s^2": ("m/s^2", "g", "mg", "mm/s^2"),
    "N": ("N", "kN"),
    "N m": ("N m", "kN m"),
}
"""Units that numbers of each SI unit may be in, the two usual ones first."""

ALTERNATIVE = 2.0
"""Natural logarithm of sizes within which a second unit fits as well as the best one."""

RARE = 2.5
"""What the third unit of a list and later ones must be nearer by."""


@dataclass(frozen=True, slots=True)
class TakenUnit:
    """The unit that a column's numbers are taken to be in.

    belief : from 0 to 1, what the unit leaves of the confidence in a guess
    reason : what speaks for it
    doubted : whether it is another one than the header says
    """

    unit: str
    belief: float
    reason: str
    doubted: bool = False


@lru_cache(maxsize=4096)
def measured_by(unit: str) -> str:
    """The SI unit of what a plain unit measures, among those of channels; "" for anything else."""
    if not unit:
        return ""
    for si in MEASURES:
        if _factor(unit, si) is not None:
            return si
    return ""


def differ(one: str, other: str, si: str) -> bool:
    """Whether a known unit is not the same as another one, which measures what `si` does."""
    factor, wanted = _factor(one, si), _factor(other, si)
    if factor is None or wanted is None:
        return bool(measured_by(one))
    return not math.isclose(factor, wanted, rel_tol=1e-9)


def taken_unit(
    info: ChannelInfo,
    stated: str,
    ending: tuple[str, ...],
    known: Statistics | None,
    by: str = "name",
) -> TakenUnit:
    """The unit in which a column is taken for a channel.

    stated : the header's, plain;  ending : units that the column's name ends in
    known : what its numbers say; None where nobody looked at them
    by : what takes it for that channel, in a word
    """
    fits = bool(stated) and _factor(stated, info.unit) is not None
    if fits:
        header, said = stated, f"{by} and unit"
    else:
        usable = [unit for unit in ending if _factor(unit, info.unit) is not None]
        header = usable[0] if usable and not stated else ""
        said = "name with its unit" if header else f"{by} only"
    size = size_of(info.name)
    number = None if known is None or size is None else float(getattr(known, size.measure))
    if known is None or size is None or number is None or not number > 0.0:
        return _untested(info, stated, header, said, fits, by)
    shown = _shown(known, size.measure)
    likely = _likely_units(info, size, number)
    if header:
        if size.least <= number * _scale(header, info.unit) <= size.most:
            return TakenUnit(header, 1.0 if fits else 0.97, said)
        if not likely:
            doubt = f"{said}, but {shown} fit no unit of {info.quantity}"
            return TakenUnit(header, 0.6, doubt, doubted=True)
        lie = f"{'unit' if fits else 'the unit in the name'} lies: {shown} fit {likely[0]}"
        return TakenUnit(likely[0], 0.75, f"{lie}, not {header}", doubted=True)
    if stated:
        measures = measured_by(stated)
        said = (
            f"{by}, but its unit {stated} measures {MEASURES[measures]}"
            if measures
            else f"{by}; the unit {stated} is not known"
        )
    belief = 0.35 if stated and measured_by(stated) else 0.85
    if not likely:
        return TakenUnit(info.unit, 0.6 * belief, f"{said}; {shown} fit no unit", doubted=True)
    also = f", or {likely[1]}" if len(likely) > 1 else ""
    belief *= 0.9 if also else 1.0
    return TakenUnit(likely[0], belief, f"{said}; {shown} fit {likely[0]}{also}", doubted=True)


def size_of(channel: str) -> Size | None:
    """How large a channel is, None where nobody knows."""
    parts = channel.split(".")
    if parts[0] in ("seat", "point"):
        return OF_A_POINT
    return SIZES.get(channel) or SIZES.get(f"{parts[0]}.{parts[-1]}")


def reads_gravity(known: Statistics, unit: str) -> bool:
    """Whether numbers in a unit of acceleration are those of an upright accelerometer, either way
    up.
    """
    return UPRIGHT.least <= known.level * _scale(unit, "m/s^2") <= UPRIGHT.most


def _untested(
    info: ChannelInfo, stated: str, header: str, said: str, fits: bool, by: str
) -> TakenUnit:
    """The unit of a column whose numbers say nothing of it."""
    if header:
        return TakenUnit(header, 1.0 if fits else 0.97, said)
    if stated and measured_by(stated):
        said = f"{by}, but its unit {stated} measures {MEASURES[measured_by(stated)]}"
        return TakenUnit(info.unit, 0.35, said, doubted=True)
    return TakenUnit(info.unit, 0.7, f"{said}; no unit is stated", doubted=True)


def _likely_units(info: ChannelInfo, size: Size, number: float) -> list[str]:
    """Units that bring a column's size into the channel's range: the nearest to the typical first,
    and those that are hardly further from it.
    """
    away = {
        unit: abs(math.log(number * _scale(unit, info.unit) / size.typical)) + RARE * (place > 1)
        for place, unit in enumerate(UNITS.get(info.unit, (info.unit,)))
        if size.least <= number * _scale(unit, info.unit) <= size.most
    }
    nearest = min(away.values(), default=0.0)
    close = [unit for unit, far in away.items() if far <= nearest + ALTERNATIVE]
    return sorted(close, key=away.__getitem__)


def _shown(known: Statistics, measure: Measure) -> str:
    """The numbers that speak, for a sentence."""
    if measure == "step":
        return f"steps of {known.step:.3g}"
    if measure == "level":
        return f"values about {known.median:.4g}"
    return f"values to {max(abs(known.minimum), abs(known.maximum)):.4g}"


def _scale(unit: str, si: str) -> float:
    factor = _factor(unit, si)
    assert factor is not None
    return abs(factor)


@lru_cache(maxsize=4096)
def _factor(unit: str, si: str) -> float | None:
    """SI over a unit, None where it measures something else or is not known."""
    try:
        return to_si(unit, si)[0]
    except UnitError:
        return None
