"""What the commands' arguments name: a vehicle, a manoeuvre, noise, values of parameters."""

from argparse import Namespace
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from ...engine.channels import Run
from ...engine.errors import (
    ManoeuvreError,
    MeasurementError,
    ParameterError,
    RideError,
    SimulationError,
    VehicleError,
)
from ...engine.manoeuvre import Manoeuvre, read_manoeuvre, reference_manoeuvres
from ...engine.rims_settings import RimsSettings
from ...engine.run_notes import read_notes
from ...engine.vehicle import Vehicle
from ...engine.vehicle_file import read_vehicle, reference_vehicles

Known = TypeVar("Known")


def find_vehicle(name: str) -> Vehicle:
    """The vehicle in a vehicle or fit file, or a reference vehicle by its key."""
    if _is_file(name):
        return read_vehicle(name)
    return _known(name, reference_vehicles(), VehicleError, "vehicle")


def find_manoeuvre(name: str) -> Manoeuvre:
    """The manoeuvre in a file, or a reference manoeuvre by its key."""
    if _is_file(name):
        return read_manoeuvre(name)
    return _known(name, reference_manoeuvres(), ManoeuvreError, "manoeuvre")


def _is_file(name: str) -> bool:
    """Whether there is anything to read by that name, a pipe included."""
    return Path(name).exists() and not Path(name).is_dir()


def _known(name: str, known: Mapping[str, Known], kind: type[RideError], noun: str) -> Known:
    if name in known:
        return known[name]
    near = get_close_matches(name, known, n=1)
    hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}."
    raise kind(f"{name}: there is no such file, nor a {noun} of that name; {hint}")


def read_noise(path: str | None) -> Mapping[str, float]:
    """Standard deviations in SI by channel from a TOML file's [noise] table, if there is a file."""
    if path is None:
        return {}
    noise = read_notes(Path(path)).noise
    if not noise:
        raise MeasurementError(
            f'{path}: no noise is stated; add [noise] and lines such as "chassis.z" = 0.0005.'
        )
    return noise


def starts(assignments: Iterable[str]) -> dict[str, float]:
    """Values by name out of NAME=VALUE."""
    return {name: _number(text, name) for name, text in _pairs(assignments, "NAME=VALUE")}


def bounds(assignments: Iterable[str]) -> dict[str, tuple[float, float]]:
    """(lower, upper) by name out of NAME=LOW:HIGH."""
    limits = {}
    for name, text in _pairs(assignments, "NAME=LOW:HIGH"):
        lower, colon, upper = text.partition(":")
        if not colon:
            raise ParameterError(f"The bounds {name}={text} lack a colon; write {name}=LOW:HIGH.")
        limits[name] = (_number(lower, name), _number(upper, name))
    return limits


def rims_settings(options: Namespace) -> RimsSettings:
    """How the recordings are prepared, as far as the options tell."""
    told: dict[str, Any] = {}
    for field in ("a_x_cutoff", "rim_cutoff", "output_cutoff"):
        text = getattr(options, field)
        if text is not None:
            told[f"{field}_hz"] = None if text == "none" else _frequency(text, field)
    for field in ("initial_state", "step"):
        if getattr(options, field) is not None:
            told[field] = getattr(options, field)
    return RimsSettings(**told)


def _frequency(text: str, field: str) -> float:
    try:
        return float(text)
    except ValueError:
        option = field.replace("_", "-")
        raise SimulationError(f"--{option} {text}: give a frequency in Hz, or none.") from None


def with_braking(runs: Sequence[Run], marks: Sequence[str] | None) -> list[Run]:
    """The runs with the braking that [RUN=]BEGIN:END or [RUN=]none marks."""
    marked: dict[str, list[tuple[float, float]]] = {}
    for mark in marks or ():
        name, _, text = mark.rpartition("=")
        if not name and len(runs) > 1:
            raise MeasurementError(f"--braking {mark} names no run of several; write RUN={mark}.")
        name = Path(name).name or runs[0].name
        if name not in (run.name for run in runs):
            known = ", ".join(run.name for run in runs)
            raise MeasurementError(f"--braking {mark}: there is no run {name}; there are {known}.")
        intervals = marked.setdefault(name, [])
        if text != "none":
            begin, _, end = text.partition(":")
            intervals.append((_second(begin, mark), _second(end, mark)))
    return [
        replace(run, braking=tuple(marked[run.name])) if run.name in marked else run for run in runs
    ]


def _second(text: str, mark: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise MeasurementError(
            f"--braking {mark} is no interval; write BEGIN:END in seconds, or none."
        ) from None


def _pairs(assignments: Iterable[str], form: str) -> list[tuple[str, str]]:
    pairs = []
    for assignment in assignments:
        name, _, text = assignment.partition("=")
        if not (name and text):
            raise ParameterError(f"{assignment!r} sets no parameter; write {form}.")
        pairs.append((name, text))
    return pairs


def _number(text: str, name: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"{text!r} for {name} is not a number; give one in SI.") from None
