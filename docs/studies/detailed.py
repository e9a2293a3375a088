"""What the concept model finds in the detailed car, whose laws it does not have.

    .venv/bin/python docs/studies/detailed.py

Prints the tables of docs/identification.md. Honesty: two runs of one car should give the same
parameters within their errors; both estimates, their standard errors, the textbook's, and how many
of either's standard deviations the two estimates are apart. Prediction: the run that a fit has not
seen, by damper and bounds. Pivots: by the runs that are fitted, beside those of the geometry.
"""

from pathlib import Path

import numpy as np
from ridetune.engine.channels import OUTPUT_CHANNELS
from ridetune.engine.identification.fit import Fit
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.identification.residuals import Residuals
from ridetune.engine.measurement import read_run
from ridetune.engine.parameters import ALL_NAMES, PARAMETER_NAMES, parameter
from ridetune.engine.run import Run
from ridetune.engine.simulation.simulate import rims_batch, simulate_rims
from ridetune.engine.vehicle import Vehicle
from ridetune.engine.vehicle_file import read_vehicle

FOLDER = Path(__file__).parents[2] / "sample_runs" / "detailed"
WIDE = {
    "front.stabilizer_bar.stiffness": (0.0, 2e6),
    "rear.stabilizer_bar.stiffness": (0.0, 2e5),
    "front.stabilizer_bar.damping": (0.0, 1e5),
    "rear.stabilizer_bar.damping": (0.0, 1e4),
}
PIVOTS = [f"{axle}.pivot.{what}" for axle in ("front", "rear") for what in ("distance", "angle")]


def textbook_errors(problem: Problem, fit: Fit) -> np.ndarray:
    """Roots of the diagonal of s^2 (J^T J)^-1 at the fit."""
    residuals = Residuals(problem, rims_batch)
    pairs = list(zip(problem.free, fit.parameters, strict=True))
    x = np.array([one.variable(found.value) for one, found in pairs])
    slopes = np.array([one.slope(v) for (one, _), v in zip(pairs, x, strict=True)])
    jacobian, r = residuals.jacobian(x) / slopes, residuals.vector(x)
    variance = r @ r / (len(r) - len(x))
    return np.sqrt(np.diag(variance * np.linalg.inv(jacobian.T @ jacobian)))


def honesty(problems: list[Problem], fits: list[Fit]) -> None:
    """Each run by itself."""
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


def percents(fit: Fit, run: Run) -> str:
    """Fit percent of z, pitch and roll."""
    found = simulate_rims(fit.vehicle, run).fit_percent
    return ", ".join(f"{found[name]:.1f}" for name in OUTPUT_CHANNELS)


def prediction(vehicle: Vehicle, seen: Run, unseen: Run) -> None:
    """Fitted to one run, holding out the other."""
    print("| dampers | bars' bounds | run 1: z, pitch, roll | run 2 unseen: z, pitch, roll |")
    print("|---|---|---|---|")
    for bounds, width in (({}, "default"), (WIDE, "wide")):
        for names, law in ((PARAMETER_NAMES, "linear"), (ALL_NAMES, "two-slope")):
            fit = identify(Problem.build(vehicle, [seen], names, bounds=bounds))
            print(f"| {law} | {width} | {percents(fit, seen)} | {percents(fit, unseen)} |")


def pivots(vehicle: Vehicle, *fitted: list[Run], unseen: Run) -> None:
    """The pivots, with two-slope dampers, by the runs that are fitted."""
    print(f"| fitted | {' | '.join(PIVOTS)} | {unseen.name} unseen |")
    for runs in fitted:
        fit = identify(Problem.build(vehicle, runs, ALL_NAMES))
        found = {one.name: one for one in fit.parameters}
        told = (
            f"{one.value:.3f} ± {one.std_error:.2g} {one.determined}"
            for one in map(found.get, PIVOTS)
        )
        names = " and ".join(run.name for run in runs)
        print(f"| {names} | {' | '.join(told)} | {percents(fit, unseen)} |")


def main() -> None:
    """Print all three."""
    vehicle = read_vehicle(FOLDER / "vehicle.json")
    one, two, brake = (read_run(FOLDER / f"manoeuvre_{key}.csv") for key in ("1", "2", "brake-54"))
    problems = [Problem.build(vehicle, [run]) for run in (one, two)]
    honesty(problems, [identify(problem) for problem in problems])
    prediction(vehicle, one, two)
    pivots(vehicle, [one], [one, brake], unseen=two)


if __name__ == "__main__":
    main()
