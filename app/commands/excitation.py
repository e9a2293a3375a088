"""What drives a car, as the options that `simulate` and `sweep` share name it."""

from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from ...engine.errors import SimulationError
from ...engine.roads.road_file import read_road
from ...engine.roads.road_specs import IsoRoad
from ...engine.simulation.excitation import Excitation, FreeExcitation, RimsExcitation
from ...engine.simulation.recorded_motion import recorded_motion
from ...engine.vehicle import Vehicle
from .arguments import rims_settings
from .inputs import find_manoeuvre, find_mapping, read_one, read_runs, recording_files

Mode = Literal["manoeuvre", "rims", "posts"]
MODES: tuple[Mode, ...] = ("manoeuvre", "rims", "posts")

BELONGS_TO = {
    **dict.fromkeys(("road", "road_seed", "duration"), "--manoeuvre"),
    **dict.fromkeys(
        (
            *("traction", "initial_state", "braking"),
            *("a_x_cutoff", "rim_cutoff", "output_cutoff", "output_highpass"),
        ),
        "--rims",
    ),
}
"""Options that mean something in one mode only."""


def mode_of(options: Namespace) -> Mode:
    """The mode that the options name; SimulationError for one that means nothing in it."""
    mode: Mode = next(name for name in MODES if getattr(options, name))
    for option, home in BELONGS_TO.items():
        if getattr(options, option) is not None and home != f"--{mode}":
            shown = {"road_seed": "seed"}.get(option, option).replace("_", "-")
            raise SimulationError(f"--{shown} belongs to {home}; it means nothing with --{mode}.")
    if options.mapping is not None and mode == "manoeuvre":
        raise SimulationError("--mapping belongs to a recording; leave it out of --manoeuvre.")
    if options.lift_off and mode == "rims":
        raise SimulationError("--lift-off means nothing with --rims, where tyres play no part.")
    return mode


def files_read(options: Namespace) -> tuple[str | Path | None, ...]:
    """All that is read, None for what is not told and a key for what comes along."""
    recordings = recording_files(filter(None, (options.rims, options.posts)))
    return (options.vehicle, options.manoeuvre, options.road, options.mapping, *recordings)


def excitation(options: Namespace, mode: Mode, vehicle: Vehicle) -> Excitation:
    """What the options let the car go through."""
    if mode == "rims":
        under = [find_mapping(options.mapping)]
        [run] = read_runs([options.rims], options.braking or (), under)
        motion = recorded_motion(run, rims_settings(options))
        return RimsExcitation(motion, options.traction or "exact")
    how: dict[str, Any] = {"lift_off": options.lift_off, "step": options.step}
    if mode == "posts":
        return FreeExcitation(read_one(options.posts, find_mapping(options.mapping)), **how)
    manoeuvre = find_manoeuvre(options.manoeuvre)
    if options.duration is not None:
        manoeuvre = manoeuvre.lasting(options.duration)
    if options.road_seed is not None:
        if options.road or not isinstance(manoeuvre.road, IsoRoad):
            which = options.road or manoeuvre.name
            raise SimulationError(f"{which} has no random road; leave out --seed.")
        manoeuvre = replace(manoeuvre, seed=options.road_seed)
    if manoeuvre.kind == "posts" and options.road:
        raise SimulationError(f"{manoeuvre.name} moves the posts of a rig; leave out --road.")
    track = 0.5 * (vehicle.front.track + vehicle.rear.track)
    road = read_road(options.road, track) if options.road else None
    return FreeExcitation(manoeuvre, road, **how)


def doubts(driven: Excitation) -> tuple[str, ...]:
    """What is doubtful in the road that is driven."""
    road = driven.road if isinstance(driven, FreeExcitation) else None
    return () if road is None else road.warnings
