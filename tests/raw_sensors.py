"""What the instruments of a test car would record of a simulated drive, by textbook formulas.

Rotations are matrices, accelerations second derivatives of positions: nothing here is shared with
what is tested.
"""

import numpy as np
from ridetune.engine.frames import CORNERS
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.run import Run
from ridetune.engine.simulation.simulate import simulate_road
from scipy.interpolate import CubicSpline

G = 9.81
BOOT = (-1.2, 0.4, 0.3)
POINTS = {"point.cg": (0.0, 0.0, 0.0), "point.boot": BOOT}


def drive(car, key="2", sample_step=0.002):
    """A simulated drive with the accelerations of the CG and of the boot."""
    manoeuvre = reference_manoeuvres()[key]
    return simulate_road(car, manoeuvre, sample_step=sample_step, points=POINTS).run


def attitude(pitch, roll):
    """R = Ry(pitch) Rx(roll), (samples, 3, 3): columns are the body's axes in the earth's."""
    one, zero = np.ones_like(pitch), np.zeros_like(pitch)
    cp, sp, cr, sr = np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    about_y = np.array([[cp, zero, sp], [zero, one, zero], [-sp, zero, cp]])
    about_x = np.array([[one, zero, zero], [zero, cr, -sr], [zero, sr, cr]])
    return np.einsum("ijn,jkn->nik", about_y, about_x)


def specific_force(run, point="point.cg"):
    """(samples, 3) what an accelerometer at a point reads along the body's axes."""
    inertial = np.column_stack([run[f"{point}.a_{axis}"] for axis in "xyz"])
    rotation = attitude(run["chassis.pitch"], run["chassis.roll"])
    return np.einsum("nji,nj->ni", rotation, inertial + [0.0, 0.0, G])


def wheel_centre(car, run, corner):
    """(samples, 3) of a wheel centre in the body's axes from the CG, by the angle of its arm."""
    axle = car.front if corner[0] == "f" else car.rear
    sign = 1.0 if corner[0] == "f" else -1.0
    side = 1.0 if corner[1] == "l" else -1.0
    pivot = np.array(
        [
            sign * (axle.cg_distance - axle.pivot.distance),
            side * axle.track / 2,
            axle.pivot.distance * np.tan(axle.pivot.angle) - car.chassis.cg_height,
        ]
    )
    rest = np.array(
        [
            sign * axle.cg_distance,
            side * axle.track / 2,
            axle.wheel.radius - car.chassis.cg_height,
        ]
    )
    angle = run[f"arm.{corner}.angle"]
    return pivot + attitude(angle, np.zeros_like(angle)) @ (rest - pivot)


def hub_force(car, run, corner):
    """(samples,) what an accelerometer on a hub reads along the arm's own upward axis."""
    rotation = attitude(run["chassis.pitch"], run["chassis.roll"])
    place = np.einsum("nij,nj->ni", rotation, wheel_centre(car, run, corner))
    place += np.column_stack([run["chassis.x"], np.zeros(len(run.time)), run["chassis.z"]])
    inertial = CubicSpline(run.time, place)(run.time, 2)
    arm = attitude(run[f"arm.{corner}.angle"], np.zeros(len(run.time)))
    upwards = np.einsum("nij,njk->nik", rotation, arm)[:, :, 2]
    return np.einsum("ni,ni->n", upwards, inertial + [0.0, 0.0, G])


def recorded(car, run, *, seed=None, delay=0.0):
    """What the car's instruments record, without z, pitch, roll, a_x and wheel heights.

    seed : of bias and noise; ideal sensors without
    delay : by which the speed is late, s
    """
    force = specific_force(run)
    channels = {f"chassis.body_a_{axis}": force[:, k] for k, axis in enumerate("xyz")}
    # The gyros' axes are the body's: w = (r', p' cos r, -p' sin r).
    channels["chassis.pitch_rate"] = run["chassis.pitch_rate"] * np.cos(run["chassis.roll"])
    channels["chassis.roll_rate"] = run["chassis.roll_rate"]
    late = np.clip(run.time - delay, run.time[0], None)
    channels["chassis.v_x"] = CubicSpline(run.time, run["chassis.v_x"])(late)
    for corner in CORNERS:
        channels[f"suspension.{corner}.travel"] = run[f"suspension.{corner}.travel"]
        channels[f"wheel.{corner}.a_z"] = hub_force(car, run, corner)
    if seed is None:
        return Run("raw", run.time, channels)
    random = np.random.default_rng(seed)
    noise = {
        "body_a": (0.03, 0.05),
        "_rate": (np.radians(0.05), np.radians(0.2)),
        "v_x": (0.02, 0.0),
        "travel": (0.2e-3, 3e-3),
        "wheel": (0.1, 0.1),
    }
    stated = {}
    for name, values in channels.items():
        scatter, bias = next(pair for part, pair in noise.items() if part in name)
        stated[name] = scatter
        channels[name] = (
            values + scatter * random.standard_normal(values.size) + random.uniform(-bias, bias)
        )
    return Run("raw", run.time, channels, stated)
