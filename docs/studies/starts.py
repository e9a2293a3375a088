"""From how far away a fit finds its way: random start values around the truth.

    .venv/bin/python docs/studies/starts.py

Both manoeuvres of Table 2 with the default noise, fitted from 80 starts: every stiffness, damping
and pivot distance is off by a factor e^(0.6 N), every angle by 9 degrees N, N standard normal.
Prints how many fits ended at the lowest cost of all, and how the others ended.
"""

from collections import Counter

import numpy as np
from ridetune.engine.campaign import drive_table_2
from ridetune.engine.errors import ProblemError
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.parameters import PARAMETERS, default_bounds
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.vehicle_file import reference_vehicles

STARTS = 80
SAME_COST = 1e-4
"""Relative."""


def main() -> None:
    """Fit from every start and print what became of them."""
    car = reference_vehicles()["paper"]
    runs = drive_table_2(car, noise=DEFAULT_NOISE)
    bounds = {row.name: default_bounds(row.name, car.value(row.name)) for row in PARAMETERS}
    rng = np.random.default_rng(0)
    costs, outcomes, moved = [], [], 0
    for _ in range(STARTS):
        start = {}
        for row in PARAMETERS:
            true, chance = car.value(row.name), rng.normal()
            angle = row.name.endswith("angle")
            value = true + np.radians(9.0) * chance if angle else true * np.exp(0.6 * chance)
            start[row.name] = float(np.clip(value, *bounds[row.name]))
        try:
            fit = identify(Problem.build(car, runs, start=start, bounds=bounds))
        except ProblemError as error:
            outcomes.append(str(error))
            continue
        costs.append(fit.cost)
        outcomes.append(fit.outcome.name)
        moved += any("the fit began from others" in warning for warning in fit.warnings)
    same = sum(cost < (1.0 + SAME_COST) * min(costs) for cost in costs)
    print(f"{same} of {STARTS} at the lowest cost; {moved} began from other start values")
    for outcome, count in Counter(outcomes).items():
        print(f"{count} {outcome}")


if __name__ == "__main__":
    main()
