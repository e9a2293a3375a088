"""Manoeuvres that could be driven next, and the recordings they would give.

Those that come with the package and some like them: other levels of acceleration and braking,
other road classes, an obstacle under one side. Each is driven by the car as it is known now, and
recorded without noise, as the instruments of a test car would have it.
"""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

from ..channels import INPUT_CHANNELS, OUTPUT_CHANNELS
from ..errors import RideError
from ..manoeuvre import Manoeuvre, manoeuvre_from_json, manoeuvre_to_json, reference_manoeuvres
from ..run import Run
from ..simulation.excitation import FreeExcitation
from ..simulation.integration import cores
from ..simulation.simulate import SAMPLE_STEP
from ..units import in_percent
from ..vehicle import Brakes, Vehicle

ASSUMED_FRONT_SHARE = 0.65
"""Of the braking force, where the vehicle has no brakes."""

RIG_DURATION = 20.0
"""Of a sweep on the rig, s: about that of a drive, so that neither gains by its length alone."""

LIFTED = 0.005
"""Share of the time without tyre load beyond which what a run would tell is in doubt."""

_DRIVEN = ("1", "2", "brake-54", "bump", "pothole", "constant-speed-c")
_RIG = ("heave", "pitch", "roll", "warp")


@dataclass(frozen=True, slots=True)
class Drive:
    """What a car would record of a manoeuvre.

    run : without noise, named by the manoeuvre's key; None where the car does not come through
    lifts : whether a tyre leaves the road, where the model pulls on it and a car would fly
    remark : a sentence on what was assumed, or why there is no run; else empty
    """

    key: str
    manoeuvre: Manoeuvre
    run: Run | None
    lifts: bool = False
    remark: str = ""


def catalogue() -> dict[str, Manoeuvre]:
    """The manoeuvres that are looked at unless told, by key."""
    known = reference_manoeuvres()
    found = {key: known[key] for key in _DRIVEN}
    found["accelerate-15-3"] = _varied(
        known["2"],
        "To 15 m/s in 3 s, class A then C",
        duration=18,
        drive={"time": 3},
    )
    found["accelerate-25-10"] = _varied(
        known["2"],
        "To 25 m/s in 10 s, class A then C",
        drive={"speed": 25, "time": 10},
    )
    for level, duration in ((0.2, 12.0), (0.6, 8.0)):
        found[f"brake-54-{level:g}g"] = _varied(
            known["brake-54"],
            f"Braking at {level:g} g from 15 m/s (54 km/h), class A",
            duration=duration,
            brake={"level": round(9.81 * level, 3)},
        )
    found["bump-left"] = _varied(
        known["bump"], "Single bump under the left wheels at 10 m/s", road={"tracks": "left"}
    )
    for name in "abd":
        found[f"constant-speed-{name}"] = _varied(
            known["constant-speed-c"],
            f"Constant 20 m/s, class {name.upper()}",
            road={"sections": [{"class": name.upper()}]},
        )
    for key in _RIG:
        whole = known[key]
        found[f"{key}-{RIG_DURATION:g}s"] = _varied(
            whole, f"{whole.name}, in {RIG_DURATION:g} s", duration=RIG_DURATION
        )
    return found


def _varied(
    manoeuvre: Manoeuvre, name: str, duration: float | None = None, **parts: Mapping[str, Any]
) -> Manoeuvre:
    """A manoeuvre under another name with some keys of its parts changed."""
    data: dict[str, Any] = manoeuvre_to_json(manoeuvre) | {"name": name, "description": ""}
    if duration is not None:
        data["duration"] = duration
    for part, changed in parts.items():
        data[part] = {**data[part], **changed}
    return manoeuvre_from_json(data, name)


def braked(vehicle: Vehicle) -> Vehicle:
    """The vehicle with brakes, assumed where it has none; they act only where it brakes."""
    if vehicle.brakes is not None:
        return vehicle
    return replace(vehicle, brakes=Brakes(ASSUMED_FRONT_SHARE))


def drives(
    vehicle: Vehicle, manoeuvres: Mapping[str, Manoeuvre], *, sample_step: float = SAMPLE_STEP
) -> list[Drive]:
    """The recordings that a car would bring home from some manoeuvres, by key."""
    with ThreadPoolExecutor(cores()) as pool:
        return list(
            pool.map(
                lambda item: _drive(vehicle, *item, sample_step=sample_step), manoeuvres.items()
            )
        )


def _drive(vehicle: Vehicle, key: str, manoeuvre: Manoeuvre, *, sample_step: float) -> Drive:
    try:
        found = FreeExcitation(manoeuvre, sample_step=sample_step).simulate(braked(vehicle))
    except RideError as error:
        return Drive(key, manoeuvre, None, remark=f"The car does not come through: {error}")
    remarks = []
    if vehicle.brakes is None and manoeuvre.brake is not None:
        remarks.append(
            f"The vehicle has no brakes, so a front share of {ASSUMED_FRONT_SHARE:g} with the "
            'torque held outboard is assumed; add "brakes": {"front_share": ...} to the vehicle '
            "before such a run is fitted."
        )
    lifted = max(found.negative_load_share.values())
    lifts = lifted > LIFTED
    if lifts:
        remarks.append(
            f"A tyre would carry nothing for {in_percent(lifted)} of the time, where the model "
            "pulls on the road, so it ranks behind those that keep to it."
        )
    names = (*INPUT_CHANNELS, *OUTPUT_CHANNELS, "chassis.v_x")
    channels = {name: found.run[name] for name in names if name in found.run}
    run = Run(key, found.run.time, channels)
    return Drive(key, manoeuvre, run, lifts, " ".join(remarks))
