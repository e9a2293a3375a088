"""How near conditioning comes to the true channels, and a fit from there to the true car.

    .venv/bin/python docs/studies/conditioning.py [seeds]

The paper's car drives Manoeuvre 2; its instruments are made up by textbook formulas (those of
`tests/raw_sensors.py`), 500 samples a second, ideal and with bias, noise and a late speed. Prints
the tables of docs/conditioning.md.
"""

import math
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
from ridetune.engine.conditioning.chain import condition
from ridetune.engine.conditioning.suggestion import suggest
from ridetune.engine.filters import in_band
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.run import Run
from ridetune.engine.simulation.rims_settings import RimsSettings
from ridetune.engine.vehicle import Vehicle
from ridetune.engine.vehicle_file import reference_vehicles
from scipy.interpolate import CubicSpline

sys.path.insert(0, str(Path(__file__).parents[2]))
instruments = import_module("tests.raw_sensors")

LATE = 0.12
"""s"""

COMPARED = {
    "chassis.pitch": (180.0 / math.pi, "pitch, deg"),
    "chassis.roll": (180.0 / math.pi, "roll, deg"),
    "chassis.a_x": (1.0, "a_x, m/s²"),
    "chassis.z": (1e3, "z, mm"),
    "wheel.fl.z": (1e3, "wheel fl, mm"),
    "wheel.rl.z": (1e3, "wheel rl, mm"),
}
START = {"K_F": 1.3, "C_F": 0.7, "K_R": 0.8, "C_R": 1.3}


def errors(true: Run, made: Run, low: float | None) -> list[float]:
    """Rms error of each compared channel; of heights above `low`, Hz."""
    found = []
    for name, (factor, _) in COMPARED.items():
        off = made[name] - CubicSpline(true.time, true[name])(made.time)
        if name.endswith(".z"):
            off = in_band(made.time, off, (low, None))
        found.append(factor * float(np.sqrt(np.mean(off**2))))
    return found


def fitted(car: Vehicle, made: Run, low: float | None) -> list[tuple[float, float]]:
    """Error and standard error of K and C, per cent."""
    names = list(START)
    start = {name: factor * true(car, name) for name, factor in START.items()}
    settings = RimsSettings(output_highpass_hz=low)
    fit = identify(Problem.build(car, [made], names, start=start, settings=settings))
    truth = [true(car, name) for name in names]
    return [
        (100.0 * (one.value / value - 1.0), 100.0 * one.std_error / value)
        for one, value in zip(fit.parameters, truth, strict=True)
    ]


def true(car: Vehicle, symbol: str) -> float:
    """A parameter of the car that drives."""
    axle = car.front if symbol[-1] == "F" else car.rear
    return axle.suspension.stiffness if symbol[0] == "K" else axle.suspension.damping


def main(seeds: int) -> None:
    """Condition and fit every case, print both tables."""
    car = reference_vehicles()["paper"]
    drive = instruments.drive(car)
    cases = {
        "ideal sensors, potentiometers": (car, [None], 0.0, ()),
        "ideal sensors, hub accelerometers": (None, [None], 0.0, ()),
        "noisy, potentiometers": (car, range(seeds), 0.0, ()),
        "noisy, hub accelerometers": (None, range(seeds), 0.0, ()),
        "noisy, potentiometers, v_x 120 ms late": (car, range(seeds), LATE, ()),
        "the same without the delay step": (car, range(seeds), LATE, ("delay",)),
    }
    rows, fits = [], []
    for label, (vehicle, which, late, without) in cases.items():
        off, found = [], []
        for seed in which:
            raw = instruments.recorded(car, drive, seed=seed, delay=late)
            suggestion = suggest(raw, vehicle)
            steps = [step for step in suggestion.steps if step.kind not in without]
            made = condition(raw, steps, vehicle)
            for record in made.conditioning:
                if record.step["kind"] == "delay" or record.warnings:
                    print(label, *record.sentences, *record.warnings, file=sys.stderr)
            low = suggestion.output_highpass_hz
            off.append(errors(drive, made, low))
            found.append(fitted(car, made, low))
        rows.append((label, np.sqrt(np.mean(np.square(off), axis=0))))
        fits.append((label, np.array(found)))
    print(f"| rms error | {' | '.join(what for _, what in COMPARED.values())} |")
    print("|---" * (1 + len(COMPARED)) + "|")
    for label, row in rows:
        print(f"| {label} | {' | '.join(f'{value:.2g}' for value in row)} |")
    print(f"\n| error of a fit, rms ± mean standard error, % | {' | '.join(START)} |")
    print("|---" * (1 + len(START)) + "|")
    for label, found in fits:
        off, error = np.sqrt(np.mean(found[:, :, 0] ** 2, axis=0)), found[:, :, 1].mean(axis=0)
        cells = [f"{a:.2f} ± {b:.2f}" for a, b in zip(off, error, strict=True)]
        print(f"| {label} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
