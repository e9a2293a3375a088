"""Whether the advisor keeps its promises: predicted errors beside those of a fit.

    .venv/bin/python docs/studies/advice.py [seeds]

The reference car drives both manoeuvres of Table 2 with noise on the outputs (0.5 mm, 0.02 deg),
the wheels (0.2 mm) and a_x (0.05 m/s2). The runs are fitted, the advisor asked, its first choice
driven with fresh noise, and all three runs are fitted. Prints the table of docs/advice.md: medians
over the seeds of errors over values (of an angle over its true value) in per cent.
"""

import sys

import numpy as np
from ridetune.engine.campaign import Campaign, chosen
from ridetune.engine.identification.advisor import advise
from ridetune.engine.identification.expected_noise import INPUT_NOISE
from ridetune.engine.identification.fit import Fit
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.parameters import PARAMETERS
from ridetune.engine.plant import ConceptPlant
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.sensor_file import noisy
from ridetune.engine.vehicle_file import reference_vehicles

SENSORS = noisy({**DEFAULT_NOISE, **INPUT_NOISE}, "noise")


def main(seeds: int) -> None:
    """Ask once per seed and print the table."""
    car = reference_vehicles()["paper"]
    promises, kept, before, chosen_first, seconds = [], [], [], [], []
    for seed in range(seeds):
        runs = recorded(car, chosen(("1", "2")), seed)
        first = identify(Problem.build(car, runs))
        advisory = advise(Problem.build(first.vehicle, runs))
        best = advisory.ranked[0]
        runs += recorded(car, {best.key: best.manoeuvre}, seed)
        fit = identify(Problem.build(first.vehicle, runs))
        before.append(in_percent(first))
        promises.append([100.0 * one.std_error / scale(one, car) for one in best.after])
        kept.append(in_percent(fit))
        chosen_first.append(best.key)
        seconds.append((advisory.seconds, first.seconds))
        print(f"seed {seed}: {best.sentence}", file=sys.stderr)
    ratio = np.array(kept) / np.array(promises)
    print("| parameter | Table 2 | promised | fitted | fitted / promised, median (range) |")
    print("|---|---|---|---|---|")
    for k, row in enumerate(PARAMETERS):
        middle = [np.median(np.array(table)[:, k]) for table in (before, promises, kept)]
        numbers = " | ".join(f"{value:.2g}" for value in middle)
        found = ratio[:, k]
        print(
            f"| {row.symbol} | {numbers} | {np.median(found):.2f} "
            f"({found.min():.2f}-{found.max():.2f}) |"
        )
    within = np.mean((ratio > 1 / 1.3) & (ratio < 1.3))
    print(f"\n{100 * within:.0f} % within a factor 1.3; first: {sorted(chosen_first)};")
    print("median {:.2f} s an advice, {:.2f} s a fit.".format(*np.median(seconds, axis=0)))


def recorded(car, manoeuvres, seed):
    """Recordings of some manoeuvres."""
    plan = Campaign.plan(ConceptPlant(car), SENSORS, manoeuvres, seed)
    return [plan.record(name, lambda _: None, lambda: False).run for name in plan.manoeuvres]


def scale(one, car) -> float:
    """What an error is told by: the value, of an angle the true one."""
    return abs(car.value(one.name) if one.name.endswith("angle") else one.value)


def in_percent(fit: Fit) -> list[float]:
    """Errors of a fit."""
    car = reference_vehicles()["paper"]
    return [100.0 * one.std_error / scale(one, car) for one in fit.parameters]


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
