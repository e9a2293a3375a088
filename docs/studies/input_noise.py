"""What noise of the wheels and of a_x does to the values of a fit, beside its error bars.

    .venv/bin/python docs/studies/input_noise.py [seeds]

The reference car drives Manoeuvre 1 of Table 2; each seed adds fresh noise, to what is compared as
usual (0.5 mm, 0.02 deg) and to what drives the model as in CASES. Six parameters are fitted from
their true values. Prints the table of docs/identification.md: the mean error, the mean standard
error of one fit, and how many of the fits' 95 % intervals hold the truth.
"""

import sys

import numpy as np
from ridetune.engine.campaign import drive_table_2
from ridetune.engine.channels import WHEEL_CHANNELS
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.vehicle_file import reference_vehicles

FREE = ("K_F", "C_F", "K_R", "C_R", "d_R", "phi_R")
CASES = ((0.2e-3, 0.05), (0.2e-3, 0.2), (0.2e-3, 0.5), (1e-3, 0.05))
"""Noise of the wheels, m, and of a_x, m/s2."""


def main(seeds: int) -> None:
    """Fit once per case and seed and print the table."""
    car = reference_vehicles()["paper"]
    columns = []
    for wheels, a_x in CASES:
        noise = {**DEFAULT_NOISE, **dict.fromkeys(WHEEL_CHANNELS, wheels), "chassis.a_x": a_x}
        rows = []
        for seed in range(seeds):
            runs = drive_table_2(car, noise=noise, seed=seed)[:1]
            fit = identify(Problem.build(car, runs, FREE))
            rows.append(
                [
                    (one.value / true - 1.0, one.std_error / true, float(low <= true <= high))
                    for one in fit.parameters
                    for true in [car.value(one.name)]
                    for low, high in [one.confidence_interval]
                ]
            )
        columns.append(np.mean(rows, axis=0))
        print(f"{1e3 * wheels:g} mm, {a_x:g} m/s2 done", file=sys.stderr)
    heads = [f"{1e3 * wheels:g} mm, {a_x:g} m/s²" for wheels, a_x in CASES]
    print(f"| | {' | '.join(heads)} |\n|---|{'---|' * len(heads)}")
    for k, symbol in enumerate(FREE):
        cells = [
            f"{100 * mean:+.1f} ± {100 * error:.1f}, {100 * held:.0f} %"
            for mean, error, held in (column[k] for column in columns)
        ]
        print(f"| {symbol} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 16)
