"""What the commands' arguments name: a vehicle, a manoeuvre, a file of noise."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from ...engine.errors import (
    ManoeuvreError,
    MeasurementError,
    RideError,
    UnmappedError,
    VehicleError,
)
from ...engine.identification.kept_fit import fit_from_json, is_fit
from ...engine.json_text import read_json
from ...engine.manoeuvre import Manoeuvre, read_manoeuvre, reference_manoeuvres
from ...engine.mapping.mapping import ChannelMapping, read_mapping
from ...engine.mapping.reading import read_recording
from ...engine.run import Run
from ...engine.run_notes import notes_beside, read_notes
from ...engine.vehicle import Vehicle
from ...engine.vehicle_file import read_vehicle, reference_vehicles
from .arguments import braking, mappings, run_and_file

Known = TypeVar("Known")

ALIKE = 0.75
"""Likeness from which a name is taken for a slip in writing another: one letter in four."""

ELSEWHERE = {
    ".csv": "CSV recordings go with --rims or to identify, posts with --posts, roads with --road",
    ".toml": "notes in TOML lie beside their recording, sensors go with --sensors of campaign",
}
"""By the end of its name, where a file belongs that is taken for a vehicle or a manoeuvre."""


def find_vehicle(name: str) -> Vehicle:
    """The vehicle in a vehicle or fit file, or a reference vehicle by its key."""
    if _is_file(name):
        _require_json(name, VehicleError, "vehicle")
        return read_vehicle(name)
    return _known(name, reference_vehicles(), VehicleError, "vehicle")


def fit_data(name: str) -> Any:
    """The JSON of the fit that a vehicle's file is; None of another, and of a pipe, which can be
    read but once.
    """
    data = read_json(Path(name), VehicleError) if Path(name).is_file() else None
    return data if is_fit(data) else None


def held_bounds(name: str) -> dict[str, tuple[float, float]]:
    """(lower, upper) of the parameters that ended at a bound of the fit which a vehicle is; nothing
    where it is none. Default bounds would follow such a start eightfold beyond, fit after fit.
    """
    data = fit_data(name)
    if data is None:
        return {}
    fit = fit_from_json(data, Path(name).name)
    at_bound = {one["name"] for one in fit.ended["parameters"] if one.get("at_bound")}
    return {one.name: (one.lower, one.upper) for one in fit.free if one.name in at_bound}


def find_manoeuvre(name: str) -> Manoeuvre:
    """The manoeuvre in a file, or a reference manoeuvre by its key."""
    if _is_file(name):
        _require_json(name, ManoeuvreError, "manoeuvre")
        return read_manoeuvre(name)
    return _known(name, reference_manoeuvres(), ManoeuvreError, "manoeuvre")


def _require_json(name: str, kind: type[RideError], noun: str) -> None:
    """Say where a file belongs that, by the end of its name, is none of ours in JSON."""
    if place := ELSEWHERE.get(Path(name).suffix.lower()):
        raise kind(f"{name}: a {noun} is a JSON file; {place}.")


def _is_file(name: str) -> bool:
    """Whether there is anything to read by that name, a pipe included."""
    return Path(name).exists() and not Path(name).is_dir()


def _known(name: str, known: Mapping[str, Known], kind: type[RideError], noun: str) -> Known:
    if name in known:
        return known[name]
    near = get_close_matches(name, known, n=1, cutoff=ALIKE)
    hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}."
    raise kind(f"{name}: there is no such file, nor a {noun} of that name; {hint}")


def find_mapping(path: str | None) -> ChannelMapping | None:
    """The mapping in a file, if there is a file."""
    return None if path is None else read_mapping(path)


def find_mappings(given: Iterable[str], paths: Sequence[str]) -> list[ChannelMapping | None]:
    """The mapping of each run in `paths`, as FILE and RUN=FILE tell."""
    files = mappings(given, paths)
    known = {file: read_mapping(file) for file in dict.fromkeys(files) if file is not None}
    return [None if file is None else known[file] for file in files]


def mapping_files(given: Iterable[str]) -> list[str]:
    """All that `find_mappings` reads."""
    return [run_and_file(text)[1] for text in given]


def read_one(
    path: str, mapping: ChannelMapping | None, *, noise: Mapping[str, float] | None = None
) -> Run:
    """A recording under a mapping, or by our own names; one of other names is told the way."""
    try:
        return read_recording(path, mapping, noise=noise)
    except UnmappedError as error:
        raise UnmappedError(
            f"{str(error).rstrip('.')}, or run `ridetune channels {path} -o mapping.json`, look at"
            " what it takes for what, and add --mapping mapping.json."
        ) from error


def read_runs(
    paths: Sequence[str],
    marks: Iterable[str],
    under: Sequence[ChannelMapping | None],
    *,
    noise: Mapping[str, float] | None = None,
) -> list[Run]:
    """The recordings, each under its mapping, with their braking where a mark tells it; `noise` as
    of `read_recording`.
    """
    marked = braking(marks, paths)
    runs = [
        read_one(path, mapping, noise=noise) for path, mapping in zip(paths, under, strict=True)
    ]
    return [
        replace(run, braking=marked[place]) if place in marked else run
        for place, run in enumerate(runs)
    ]


def recording_files(paths: Iterable[str]) -> list[Path]:
    """All that `read_runs` reads: each recording, and where its notes are if it has any."""
    return [one for path in map(Path, paths) for one in (path, notes_beside(path))]


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
