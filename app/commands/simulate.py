"""`ridetune simulate`: one car on a road, driven by recorded rims, or on a four-post rig."""

from argparse import Namespace
from dataclasses import replace
from typing import Any

from ...engine.errors import SimulationError
from ...engine.measurement import read_run, run_to_csv
from ...engine.road_file import read_road
from ...engine.road_specs import IsoRoad
from ...engine.simulation import (
    FREE_STEP,
    Simulation,
    simulate_posts,
    simulate_rims,
    simulate_road,
)
from .arguments import rims_settings
from .inputs import find_manoeuvre, find_vehicle, read_runs, recording_files
from .output import print_fit_percent, print_warnings, require_place, write_file

BELONGS_TO = {
    **dict.fromkeys(("road", "seed"), "--manoeuvre"),
    **dict.fromkeys(
        (
            *("traction", "initial_state", "braking"),
            *("a_x_cutoff", "rim_cutoff", "output_cutoff"),
        ),
        "--rims",
    ),
}
"""Options that mean something in one mode only."""


def simulate(options: Namespace) -> None:
    """Simulate in the mode that the options name, print the report, write the run."""
    mode = next(name for name in ("manoeuvre", "rims", "posts") if getattr(options, name))
    for option, home in BELONGS_TO.items():
        if getattr(options, option) is not None and home != f"--{mode}":
            shown = option.replace("_", "-")
            raise SimulationError(f"--{shown} belongs to {home}; it means nothing with --{mode}.")
    if options.lift_off and mode == "rims":
        raise SimulationError("--lift-off means nothing with --rims, where tyres play no part.")
    if not options.output and mode != "rims":
        raise SimulationError("Nothing says where the run goes; add -o run.csv.")
    recordings = recording_files(filter(None, (options.rims, options.posts)))
    inputs = (options.vehicle, options.manoeuvre, options.road, *recordings)
    require_place(options.output, inputs)
    simulation = {"manoeuvre": _road, "rims": _rims, "posts": _posts}[mode](options)
    if simulation.fit_percent:
        print_fit_percent({simulation.run.name: simulation.fit_percent})
    if options.output:
        write_file(options.output, run_to_csv(simulation.run))
        print(f"Wrote {options.output}: {simulation.run.time.size} samples.")
    shares = simulation.negative_load_share.items()
    lost = [f"{corner} {100.0 * share:.1f} %" for corner, share in shares if share > 0.0]
    if lost:
        print(f"Share of the time with a tyre load at or below zero: {', '.join(lost)}.")
    print_warnings(simulation.warnings)


def _road(options: Namespace) -> Simulation:
    vehicle, manoeuvre = find_vehicle(options.vehicle), find_manoeuvre(options.manoeuvre)
    if options.seed is not None:
        if options.road or not isinstance(manoeuvre.road, IsoRoad):
            which = options.road or manoeuvre.name
            raise SimulationError(f"{which} has no random road; leave out --seed.")
        manoeuvre = replace(manoeuvre, seed=options.seed)
    if manoeuvre.kind == "posts":
        if options.road:
            raise SimulationError(f"{manoeuvre.name} moves the posts of a rig; leave out --road.")
        return simulate_posts(vehicle, manoeuvre, **_how(options))
    road = read_road(options.road) if options.road else None
    return simulate_road(vehicle, manoeuvre, road=road, **_how(options))


def _rims(options: Namespace) -> Simulation:
    [run] = read_runs([options.rims], options.braking or ())
    return simulate_rims(
        find_vehicle(options.vehicle),
        run,
        traction=options.traction or "exact",
        settings=rims_settings(options),
        model=options.model,
    )


def _posts(options: Namespace) -> Simulation:
    vehicle = find_vehicle(options.vehicle)
    return simulate_posts(vehicle, read_run(options.posts), **_how(options))


def _how(options: Namespace) -> dict[str, Any]:
    """What road and posts modes have in common."""
    step = FREE_STEP if options.step is None else options.step
    return {"model": options.model, "lift_off": options.lift_off, "step": step}
