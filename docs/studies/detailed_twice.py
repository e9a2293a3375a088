"""Does MuJoCo's car drive as Exudyn's does? All of Manoeuvre 2, 200 s of CPU.

    .venv/bin/python -m docs.studies.detailed_twice

Prints the figures of docs/detailed-car.md: rms of what is apart, in per cent of the standard
deviation of each channel.
"""

from dataclasses import replace

import numpy as np
from ridetune.engine.detailed.builder import Model
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.driving import drive
from ridetune.engine.detailed.equilibrium import settle
from ridetune.engine.manoeuvre import reference_manoeuvres

from tests.oracles.detailed_drive import DetailedDrive
from tests.oracles.mujoco_detailed import resting


def main() -> None:
    """Drive both cars and print how far they are apart."""
    two = reference_manoeuvres()["2"]
    two = replace(two, road=replace(two.road, class_factor=0.5, band=(0.03, 2.83)))
    run = drive(reference_car(), two)
    model = Model(reference_car())
    car = resting(model, settle(model) + model.design)
    _, theirs = DetailedDrive(car, two).run()
    print("| channel | standard deviation | apart |")
    print("|---|---|---|")
    for name, values in theirs.items():
        spread = np.std(run[name])
        apart = np.sqrt(np.mean((values - run[name]) ** 2)) / spread
        print(f"| {name} | {spread:.3g} | {100.0 * apart:.3f} % |")


if __name__ == "__main__":
    main()
