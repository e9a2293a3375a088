"""What the paper's traction (Eq. 3/4) costs against the exact one, and what the a_x filter costs.

    .venv/bin/python docs/studies/traction.py

Noise-free twin: wheel centres and a_x of the reference car driven directly through both manoeuvres
of Table 2, sampled every 5 ms. Prints the table of docs/identification.md.
"""

from ridetune.engine.campaign import drive_table_2
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.parameters import PARAMETERS
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.vehicle_file import reference_vehicles


def main() -> None:
    """Fit the twin in four ways and print how far every parameter is off."""
    car = reference_vehicles()["paper"]
    runs = drive_table_2(car)
    ways = {
        "exact": ("exact", RimsSettings()),
        "exact, a_x unfiltered": ("exact", RimsSettings(a_x_cutoff_hz=None)),
        "exact, a_x at 10 Hz": ("exact", RimsSettings(a_x_cutoff_hz=10.0)),
        "paper": ("paper", RimsSettings()),
    }
    fits = {
        way: identify(Problem.build(car, runs, traction=traction, settings=settings))
        for way, (traction, settings) in ways.items()
    }
    print("| off by % | " + " | ".join(ways) + " |")
    print("|---|" + "---|" * len(ways))
    for k, row in enumerate(PARAMETERS):
        true = car.value(row.name)
        off = [100.0 * (fit.parameters[k].value / true - 1.0) for fit in fits.values()]
        print(f"| {row.symbol} | " + " | ".join(f"{value:.3f}" for value in off) + " |")


if __name__ == "__main__":
    main()
