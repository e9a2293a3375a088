"""`ridetune campaign`: Table 2's manoeuvres as measurement files of a car that is known."""

import json
from argparse import Namespace

from ...engine.campaign import drive_campaign, notes
from ...engine.errors import SimulationError
from ...engine.measurement import run_to_csv
from ...engine.vehicle_file import reference_vehicles, vehicle_to_json
from .inputs import read_noise
from .output import make_folder, refuse_input, refuse_to_overwrite, write_file


def campaign(options: Namespace) -> None:
    """Drive the paper's car through both manoeuvres and write what a test car would record."""
    if options.plant == "detailed":
        raise SimulationError("The detailed car cannot be driven yet; use --plant concept.")
    noise = read_noise(options.noise)
    vehicle = reference_vehicles()["paper"]
    runs = drive_campaign(vehicle, noise=noise, seed=options.seed)
    folder = make_folder(options.output)
    files = {"vehicle.json": json.dumps(vehicle_to_json(vehicle), indent=2) + "\n"}
    for run in runs:
        files[f"{run.name}.csv"] = run_to_csv(run)
        files[f"{run.name}.toml"] = notes(run)
    for name in files:
        refuse_input(folder / name, [options.noise])
    if not options.force:
        refuse_to_overwrite(folder / name for name in files)
    for name, text in files.items():
        write_file(folder / name, text)
        print(f"Wrote {folder / name}.")
