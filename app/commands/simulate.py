"""`ridetune simulate`: one car on a road, driven by recorded rims, or on a four-post rig."""

from argparse import Namespace

from ...engine.errors import SimulationError
from ...engine.measurement import run_to_csv
from .excitation import doubts, excitation, files_read, mode_of
from .inputs import find_vehicle
from .output import print_fit_percent, print_warnings, require_place, write_file


def simulate(options: Namespace) -> None:
    """Simulate in the mode that the options name, print the report, write the run."""
    mode = mode_of(options)
    if not options.output and mode != "rims":
        raise SimulationError("Nothing says where the run goes; add -o run.csv.")
    require_place(options.output, files_read(options))
    vehicle = find_vehicle(options.vehicle)
    driven = excitation(options, mode, vehicle)
    simulation = driven.simulate(vehicle, options.model)
    if simulation.fit_percent:
        print_fit_percent({simulation.run.name: simulation.fit_percent})
    if options.output:
        write_file(options.output, run_to_csv(simulation.run))
        print(f"Wrote {options.output}: {simulation.run.time.size} samples.")
    shares = simulation.negative_load_share.items()
    lost = [f"{corner} {100.0 * share:.1f} %" for corner, share in shares if share > 0.0]
    if lost:
        print(f"Share of the time with a tyre load at or below zero: {', '.join(lost)}.")
    print_warnings([*doubts(driven), *simulation.warnings])
