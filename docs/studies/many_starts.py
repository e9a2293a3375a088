"""What many starts cost and find: the paper's campaign with noise, from 64 starts.

    .venv/bin/python docs/studies/many_starts.py [seeds]

Both manoeuvres of Table 2 with the default noise; each seed draws other starts. Prints, for each,
the distinct minima, evaluations, simulations and processor time, beside those of a single start.
"""

import sys
import time

from ridetune.engine.campaign import drive_table_2
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.vehicle_file import reference_vehicles

STARTS = 64


def main(seeds: int) -> None:
    """Fit from one start, then from many, and print what each took."""
    car = reference_vehicles()["paper"]
    problem = Problem.build(car, drive_table_2(car, noise=DEFAULT_NOISE))
    print(
        "| starts | seed | minima (searches, cut short) | evaluations | simulations | CPU s | s |"
    )
    print("|---|---|---|---|---|---|---|")
    for starts, seed in [(1, 0), *((STARTS, seed) for seed in range(seeds))]:
        began = time.process_time()
        fit = identify(problem, starts=starts, seed=seed)
        took = time.process_time() - began
        found = "; ".join(f"{one.cost:.6g} ({one.starts}, {one.cut_short})" for one in fit.minima)
        print(
            f"| {starts} | {seed} | {found} | {fit.evaluations} | {fit.simulations} | "
            f"{took:.1f} | {fit.seconds:.1f} |"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
