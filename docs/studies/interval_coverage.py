"""How often a fit's 95 % intervals hold the truth: the paper's campaign with noise on everything.

    .venv/bin/python docs/studies/interval_coverage.py [seeds]

The reference car drives both manoeuvres of Table 2; each seed adds fresh noise, to what is compared
(0.5 mm on z, 0.02 deg on pitch and roll) and to what drives the model (0.2 mm on the wheels, 0.05
m/s2 on a_x), and starts the fit at values off by tens of per cent. Prints the table of
docs/identification.md. An error is |estimate - truth| / standard error.
"""

import math
import sys

import numpy as np
from ridetune.engine.campaign import drive_table_2
from ridetune.engine.channels import WHEEL_CHANNELS
from ridetune.engine.identification.fit import Fit
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.parameters import PARAMETERS
from ridetune.engine.vehicle_file import reference_vehicles

NOISE = {
    "chassis.z": 0.5e-3,
    "chassis.pitch": math.radians(0.02),
    "chassis.roll": math.radians(0.02),
    "chassis.a_x": 0.05,
    **dict.fromkeys(WHEEL_CHANNELS, 0.2e-3),
}
START_FACTORS = (1.25, 0.7, 0.8, 1.3, 0.7, 0.7, 1.5, 1.5, 0.75, 1.4, 1.35, 0.6)
"""Start over true value, in the order of PARAMETERS."""


def main(seeds: int) -> None:
    """Fit once per seed and print the table."""
    car = reference_vehicles()["paper"]
    truth = {row.name: car.value(row.name) for row in PARAMETERS}
    start = {name: truth[name] * f for name, f in zip(truth, START_FACTORS, strict=True)}
    fits: list[Fit] = []
    for seed in range(seeds):
        runs = drive_table_2(car, noise=NOISE, seed=seed)
        fits.append(identify(Problem.build(car, runs, start=start)))
        print(f"seed {seed}: {fits[-1].seconds:.1f} s, {fits[-1].outcome}", file=sys.stderr)
    print("| parameter | true | mean | scatter % | std error % | covered | yes/weakly/no |", end="")
    print(" worst error of a determined one |\n|---|---|---|---|---|---|---|---|")
    far = determined = 0
    for k, row in enumerate(PARAMETERS):
        true = truth[row.name]
        estimates = [fit.parameters[k] for fit in fits]
        values = np.array([one.value for one in estimates])
        errors = np.array([one.std_error for one in estimates])
        held = sum(
            one.confidence_interval[0] <= true <= one.confidence_interval[1] for one in estimates
        )
        verdicts = np.array([one.determined for one in estimates])
        counts = "/".join(str(np.sum(verdicts == word)) for word in ("yes", "weakly", "no"))
        apart = (np.abs(values - true) / errors)[verdicts == "yes"]
        far, determined = far + int(np.sum(apart > 3.0)), determined + len(apart)
        print(
            f"| {row.symbol} | {true:.5g} | {values.mean():.5g} | "
            f"{100 * values.std(ddof=1) / true:.2f} | {100 * errors.mean() / true:.2f} | "
            f"{100 * held / seeds:.1f} % | {counts} | "
            f"{f'{apart.max():.1f}' if len(apart) else '-'} |"
        )
    known = sum(
        any(one.name == "front.bar_rate" for one in fit.verdict.combinations) for fit in fits
    )
    print(
        f"\n{seeds} seeds; {far} of {determined} determined values beyond 3 standard errors; "
        f"Ktor_F/d_F^2 told in {known} fits. "
        f"Evaluations {np.mean([fit.evaluations for fit in fits]):.1f}, "
        f"simulations {np.mean([fit.simulations for fit in fits]):.0f}, "
        f"median {np.median([fit.seconds for fit in fits]):.2f} s a fit."
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
