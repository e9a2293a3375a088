"""Are the error bars honest when the model is wrong? The detailed car, each manoeuvre by itself.

    .venv/bin/python docs/studies/detailed.py

Two runs of one car should give the same parameters within their errors. Prints the table of
docs/identification.md: both estimates, their standard errors, the textbook's, and how many of
either's standard deviations the two estimates are apart.
"""

from pathlib import Path

import numpy as np
from ridetune.engine.fit import Fit
from ridetune.engine.identification import Problem, identify
from ridetune.engine.measurement import read_run
from ridetune.engine.parameters import parameter
from ridetune.engine.residuals import Residuals
from ridetune.engine.simulation import rims_batch, simulate_rims
from ridetune.engine.vehicle_file import read_vehicle

SAMPLES = Path(__file__).parents[2] / "sample_runs"


def textbook_errors(problem: Problem, fit: Fit) -> np.ndarray:
    """Roots of the diagonal of s^2 (J^T J)^-1 at the fit."""
    residuals = Residuals(problem, rims_batch)
    pairs = list(zip(problem.free, fit.parameters, strict=True))
    x = np.array([one.variable(found.value) for one, found in pairs])
    slopes = np.array([one.slope(v) for (one, _), v in zip(pairs, x, strict=True)])
    jacobian, r = residuals.jacobian(x) / slopes, residuals.vector(x)
    variance = r @ r / (len(r) - len(x))
    return np.sqrt(np.diag(variance * np.linalg.inv(jacobian.T @ jacobian)))


def main() -> None:
    """Fit each run, print the table and the prediction of the second run from the first."""
    vehicle = read_vehicle(SAMPLES / "detailed_vehicle.json")
    runs = [read_run(SAMPLES / f"detailed_manoeuvre_{k}.csv") for k in (1, 2)]
    problems = [Problem.build(vehicle, [run]) for run in runs]
    fits = [identify(problem) for problem in problems]
    textbook = [textbook_errors(*pair) for pair in zip(problems, fits, strict=True)]
    print("| parameter | run 1 | run 2 | apart / our errors | apart / textbook | determined |")
    print("|---|---|---|---|---|---|")
    for k, (one, two) in enumerate(zip(fits[0].parameters, fits[1].parameters, strict=True)):
        apart = abs(one.value - two.value)
        ours = apart / np.hypot(one.std_error, two.std_error)
        theirs = apart / np.hypot(textbook[0][k], textbook[1][k])
        bound = ", at bound" if one.at_bound else ""
        print(
            f"| {parameter(one.name).symbol} | {one.value:.4g} ± {one.std_error:.2g} | "
            f"{two.value:.4g} ± {two.std_error:.2g} | {ours:.1f} | {theirs:.1f} | "
            f"{one.determined}{bound} |"
        )
    print("fit percent, run 1 seen:", fits[0].fit_percent)
    print("fit percent, run 2 unseen:", simulate_rims(fits[0].vehicle, runs[1]).fit_percent)


if __name__ == "__main__":
    main()
