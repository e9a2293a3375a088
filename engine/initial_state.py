"""The body's state at the beginning of a recording: as measured, and how far from equilibrium.

The model starts from static equilibrium under the first wheel heights unless told otherwise. A
record that was cut out of a ride starts elsewhere, and the model would answer with a swing of its
own that no parameter can explain.
"""

import math

import numpy as np
from numpy.typing import NDArray

from .channels import OUTPUT_CHANNELS, WHEEL_CHANNELS, Run
from .errors import MeasurementError
from .frames import CORNERS, axle_of
from .vehicle import Vehicle

Array = NDArray[np.float64]

WINDOW = 0.2
"""The start of a record from which its initial state is taken, s."""

FEWEST_SAMPLES = 10
"""Samples in the window without which no rate is taken from it."""

ANGLE_OFF, ANGLE_RATE = math.radians(0.2), math.radians(1.0)
AT_REST = {
    "chassis.z": (0.005, 0.02),
    "chassis.pitch": (ANGLE_OFF, ANGLE_RATE),
    "chassis.roll": (ANGLE_OFF, ANGLE_RATE),
}
"""Distance from the plane of the wheels and rate with which a car may start for equilibrium to be
a good initial state, SI; a body that bounces at 1.2 Hz through 3 mm exceeds the first rate."""

BEYOND_NOISE = 3.0
"""Both must also exceed this many of their own standard errors."""


def measured_state(run: Run) -> Array:
    """z, pitch, roll and their rates (6,) at the first sample, from a cubic through 0.2 s.

    Raises MeasurementError for a run without the three channels or sampled too coarsely.
    """
    missing = [name for name in OUTPUT_CHANNELS if name not in run]
    if missing:
        raise MeasurementError(
            f"Run {run.name} lacks {', '.join(missing)}; a measured start needs all three of "
            "chassis.z, .pitch and .roll, so start from equilibrium instead."
        )
    since, first = _window(run)
    if len(since) < FEWEST_SAMPLES:
        raise MeasurementError(
            f"Run {run.name} has {len(since)} samples in its first {WINDOW} s; a measured start "
            f"needs {FEWEST_SAMPLES}, so sample faster or start from equilibrium instead."
        )
    states = np.column_stack([run[name][first] for name in OUTPUT_CHANNELS])
    cubic = np.polynomial.polynomial.polyfit(since, states, 3)
    return np.concatenate([cubic[0], cubic[1]])


def away_from_equilibrium(run: Run, vehicle: Vehicle) -> list[str]:
    """A sentence where the body starts elsewhere than in equilibrium on its wheels."""
    since, first = _window(run)
    expected = _on_its_wheels(run, vehicle)
    found = []
    for name, (most_off, fastest) in AT_REST.items():
        if name not in run:
            continue
        (value, rate), (value_error, rate_error) = _value_and_rate(since, run[name][first])
        off = abs(value - expected[OUTPUT_CHANNELS.index(name)]) > max(
            most_off, BEYOND_NOISE * value_error
        )
        if off or abs(rate) > max(fastest, BEYOND_NOISE * rate_error):
            found.append(name)
    if not found:
        return []
    return [
        f"Run {run.name} starts away from rest ({', '.join(found)}), but the model starts from "
        'equilibrium; begin the run at rest, or take the initial state "measured".'
    ]


def _window(run: Run) -> tuple[Array, NDArray[np.int64]]:
    """Times since the first sample, and places, of the samples in the window."""
    first = np.flatnonzero(run.time - run.time[0] <= WINDOW)
    return run.time[first] - run.time[0], first


def _value_and_rate(since: Array, values: Array) -> tuple[Array, Array]:
    """Value and rate at the first sample by a parabola, and their standard errors.

    Of few samples the first value alone is taken, and no rate.
    """
    if len(since) < FEWEST_SAMPLES:
        return np.array([values[0], 0.0]), np.zeros(2)
    powers = np.vander(since, 3, increasing=True)
    inverse = np.linalg.pinv(powers)
    found = inverse @ values
    residual = values - powers @ found
    variance = float(residual @ residual) / (len(since) - 3)
    return found[:2], np.sqrt(variance * np.sum(inverse[:2] ** 2, axis=1))


def _on_its_wheels(run: Run, vehicle: Vehicle) -> Array:
    """z, pitch and roll (3,) of the plane nearest to the four wheel centres' first heights."""
    rows = []
    for corner in CORNERS:
        axle = vehicle.axle_at(corner)
        ahead = axle.cg_distance if axle_of(corner) == "front" else -axle.cg_distance
        left = 0.5 * axle.track if corner.endswith("l") else -0.5 * axle.track
        rows.append([1.0, -ahead, left])
    heights = np.array([run[name][0] for name in WHEEL_CHANNELS])
    return np.linalg.lstsq(np.array(rows), heights, rcond=None)[0]
