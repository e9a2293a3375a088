"""What noise on the wheel centres does to a fit, with and without the wheels' low-pass.

    .venv/bin/python docs/studies/rim_noise.py

The reference car through both manoeuvres of Table 2, 0.5 mm of white noise on the four wheel
channels alone, sampled every 5 ms and every 1 ms. Prints the table of docs/identification.md.
"""

from dataclasses import replace

import numpy as np
from ridetune.engine.channels import WHEEL_CHANNELS
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.parameters import PARAMETERS
from ridetune.engine.run import Run
from ridetune.engine.sensors import RECORDED
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import simulate_road
from ridetune.engine.vehicle import Vehicle
from ridetune.engine.vehicle_file import reference_vehicles

NOISE = 0.5e-3
SAMPLE_STEPS = (0.005, 0.001)
CUTOFFS = (None, 50.0)


def recorded(car: Vehicle, key: str, sample_step: float) -> Run:
    """One manoeuvre with noise on the wheels."""
    run = simulate_road(car, reference_manoeuvres()[key], sample_step=sample_step).run
    rng = np.random.default_rng(int(key))
    channels = {
        name: run[name] + (name in WHEEL_CHANNELS) * NOISE * rng.normal(size=run.time.size)
        for name in RECORDED
    }
    return replace(run, name=f"manoeuvre_{key}", channels=channels)


def main() -> None:
    """Fit every combination of sampling and cutoff and print error and standard error."""
    car = reference_vehicles()["paper"]
    columns = {}
    for sample_step in SAMPLE_STEPS:
        runs = [recorded(car, key, sample_step) for key in "12"]
        for cutoff in CUTOFFS:
            fit = identify(Problem.build(car, runs, settings=RimsSettings(rim_cutoff_hz=cutoff)))
            filtered = "unfiltered" if cutoff is None else f"{cutoff:g} Hz"
            columns[f"{1000 * sample_step:g} ms, {filtered}"] = fit.parameters
    print("| | " + " | ".join(columns) + " |")
    print("|---|" + "---|" * len(columns))
    for k, row in enumerate(PARAMETERS):
        true = car.value(row.name)
        cells = [
            f"{100.0 * (found[k].value / true - 1.0):.2f} ± "
            f"{100.0 * found[k].std_error / abs(true):.2f}"
            for found in columns.values()
        ]
        print(f"| {row.symbol} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
