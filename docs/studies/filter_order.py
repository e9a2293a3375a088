"""Which order of the low-pass costs a fit least.

    .venv/bin/python docs/studies/filter_order.py

Noise-free twin: wheel centres and a_x of the reference car driven directly through both manoeuvres
of Table 2, sampled every 5 ms. Prints the worst error of the twelve parameters for Butterworth
filters of several orders in place of `filters.ORDER`, and without any filter at three samplings.
"""

from dataclasses import replace

from ridetune.engine import filters
from ridetune.engine.campaign import TABLE_2
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.run import Run
from ridetune.engine.sensors import RECORDED
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.simulation.simulate import simulate_road
from ridetune.engine.vehicle_file import reference_vehicles

ORDERS = (2, 3, 4, 6, 8, 16)
SAMPLE_STEPS = (0.005, 0.002, 0.001)
CAR = reference_vehicles()["paper"]


def runs(sample_step: float) -> list[Run]:
    """Both manoeuvres as a test car would record them."""
    found = []
    for key in TABLE_2:
        run = simulate_road(CAR, reference_manoeuvres()[key], sample_step=sample_step).run
        found.append(replace(run, channels={name: run[name] for name in RECORDED}))
    return found


def worst_error(recorded: list[Run], settings: RimsSettings) -> float:
    """Worst error of the twelve, per cent."""
    fit = identify(Problem.build(CAR, recorded, settings=settings))
    return max(100.0 * abs(one.value / CAR.value(one.name) - 1.0) for one in fit.parameters)


def main() -> None:
    """Print both tables."""
    recorded = runs(0.005)
    print("| order in each pass | " + " | ".join(map(str, ORDERS)) + " |")
    print("|---|" + "---|" * len(ORDERS))
    errors = []
    for filters.ORDER in ORDERS:
        errors.append(worst_error(recorded, RimsSettings()))
    print("| worst error, % | " + " | ".join(f"{error:.3f}" for error in errors) + " |")
    unfiltered = RimsSettings(a_x_cutoff_hz=None, rim_cutoff_hz=None)
    for sample_step in SAMPLE_STEPS:
        error = worst_error(runs(sample_step), unfiltered)
        print(f"no filter, a sample every {1000 * sample_step:g} ms: {error:.3f} %")


if __name__ == "__main__":
    main()
