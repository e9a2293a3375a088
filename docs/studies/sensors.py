"""What wrong sensors do to a fit, and what it is worth to find them with the parameters.

    .venv/bin/python docs/studies/sensors.py

Both manoeuvres of Table 2 with the default noise, by sensors of which z reads 5 % too much, 4 mm
off and 12 ms late, pitch comes 20 ms late and a_x reads 5 % too little. Six parameters are fitted.
Prints error and standard error of each in per cent: by ideal sensors, by these taken for ideal, and
with their gains, biases and delays fitted; then what was found of them.
"""

from dataclasses import replace

from ridetune.engine.campaign import drive_table_2
from ridetune.engine.channels import INPUT_CHANNELS
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.parameters import parameter
from ridetune.engine.run_notes import DEFAULT_NOISE
from ridetune.engine.sensors import Sensor, SensorSet, measured
from ridetune.engine.vehicle_file import reference_vehicles

FREE = ("K_F", "C_F", "K_R", "C_R", "d_R", "phi_R")
WRONG = {
    "chassis.z": Sensor(gain=1.05, bias=0.004, delay=0.012),
    "chassis.pitch": Sensor(delay=0.02),
    "chassis.a_x": Sensor(gain=0.95),
}
FITTED = {
    "chassis.z": {"gain": "fit", "bias": "fit", "delay": "fit"},
    "chassis.pitch": {"delay": "fit"},
    "chassis.a_x": {"gain": "fit"},
}


def main() -> None:
    """Fit three times and print."""
    car = reference_vehicles()["paper"]
    true = drive_table_2(car)
    ideal = dict.fromkeys((*INPUT_CHANNELS, "chassis.v_x", *DEFAULT_NOISE), Sensor())
    found = []
    for sensors, asked in ((ideal, {}), (ideal | WRONG, {}), (ideal | WRONG, FITTED)):
        noisy = {
            name: replace(one, noise=DEFAULT_NOISE.get(name, 0.0)) for name, one in sensors.items()
        }
        runs = [measured(run, SensorSet(200.0, noisy), 0, k) for k, run in enumerate(true)]
        start = {name: 1.2 * car.value(parameter(name).name) for name in FREE}
        found.append(identify(Problem.build(car, runs, FREE, start=start, sensors=asked)))
    for rows in zip(*(fit.parameters for fit in found), strict=True):
        right = car.value(rows[0].name)
        cells = (
            f"{100 * (one.value / right - 1):.2f} ± {100 * one.std_error / right:.2f}"
            for one in rows
        )
        print(f"| {parameter(rows[0].name).symbol} | {' | '.join(cells)} |")
    for one in found[-1].sensors:
        print(f"{one.title}: {one.value:.4g} ± {one.std_error:.2g} {one.unit}, {one.determined}")
    for fit in found:
        print(fit.evaluations, fit.simulations, round(fit.seconds, 1), fit.outcome)


if __name__ == "__main__":
    main()
