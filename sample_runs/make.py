"""Drives the paper's car through both manoeuvres and writes its noisy recordings as samples.

    .venv/bin/python sample_runs/make.py

Noise is on the compared channels only. Values are rounded to RESOLUTION, far below the noise.
"""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from ridetune.engine.campaign import drive_table_2
from ridetune.engine.channels import OUTPUT_CHANNELS, WHEEL_CHANNELS
from ridetune.engine.measurement import write_run
from ridetune.engine.vehicle_file import reference_vehicles, write_vehicle

NOISE = {
    "chassis.z": 0.0005,
    "chassis.pitch": round(math.radians(0.02), 9),
    "chassis.roll": round(math.radians(0.02), 9),
}
SEED = 1
KEPT = (*OUTPUT_CHANNELS, "chassis.a_x", "chassis.v_x", *WHEEL_CHANNELS)
RESOLUTION = 7
"""Decimals kept, SI."""


def make(folder: Path) -> None:
    """Write the twin's two recordings with their notes, and the car that drove them."""
    vehicle = reference_vehicles()["paper"]
    write_vehicle(vehicle, folder / "paper_vehicle.json")
    for number, run in enumerate(drive_table_2(vehicle, noise=NOISE, seed=SEED), start=1):
        rounded = {name: np.round(run[name], RESOLUTION) + 0.0 for name in KEPT}
        recording = replace(run, time=np.round(run.time, RESOLUTION), channels=rounded)
        write_run(recording, folder / f"paper_twin_{number}.csv")
        stated = "".join(f"{json.dumps(name)} = {value!r}\n" for name, value in run.noise.items())
        notes = f"description = {json.dumps(run.description)}\n\n[noise]\n{stated}"
        (folder / f"paper_twin_{number}.toml").write_text(notes)


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
