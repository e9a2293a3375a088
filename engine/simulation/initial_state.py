"""The body's state at the beginning of a recording: as measured, and how far from equilibrium.

The model starts from static equilibrium under the first wheel heights unless told otherwise. A
record that was cut out of a ride starts elsewhere, and the model would answer with a swing of its
own that no parameter can explain.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..channels import OUTPUT_CHANNELS
from ..errors import MeasurementError
from ..run import Run

Array = NDArray[np.float64]

WINDOW = 0.2
"""The start of a record from which its initial state is taken, s."""

FEWEST_SAMPLES = 10
"""Samples in the window without which no rate is taken from it."""

BODY = 8.0
"""A body's usual own frequency, rad/s, by which a rate makes a swing of so much."""

SWING = {"chassis.z": 1.5e-3, "chassis.pitch": math.radians(0.1), "chassis.roll": math.radians(0.1)}
"""Swing of the model about the record that is told of, SI."""

BEYOND_NOISE = 3.0
"""It must exceed so many of its standard errors ..."""

FIRST, LATER, FURTHER = 0.4, 1.5, 1.5
"""... and the record be further from the model until FIRST, s, than from LATER on, when the swing
has died away and other causes are left, by the factor FURTHER."""


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


def swings_in(
    name: str,
    time: Array,
    measured: Mapping[str, Array],
    model: Mapping[str, Array],
    *,
    remedy: str = 'begin the run at rest, or take the initial state "measured"',
) -> list[str]:
    """A sentence where the model, begun in equilibrium, swings into the record's motion.

    name : the run's
    time : (samples,) s
    measured, model : z, pitch and roll, those there are, SI
    """
    since = time - time[0]
    found = [
        channel
        for channel, values in measured.items()
        if _swings(since, values - model[channel], SWING[channel])
    ]
    if not found:
        return []
    return [
        f"Run {name} starts away from rest ({', '.join(found)}), but the model starts from "
        f"equilibrium; {remedy}."
    ]


def _swings(since: Array, off: Array, least: float) -> bool:
    """Whether a record's distance from the model (samples,) begins with a swing that dies away."""
    at_first, later = since <= FIRST, since >= LATER
    window = since <= WINDOW
    if not later.any() or np.count_nonzero(window) < FEWEST_SAMPLES:
        return False
    powers = np.vander(since[window], 3, increasing=True)
    inverse = np.linalg.pinv(powers)
    parabola = inverse @ off[window]
    left = off[window] - powers @ parabola
    errors = np.linalg.norm(inverse, axis=1) * math.sqrt(left @ left / (left.size - 3))
    swing, error = (math.hypot(one[0], one[1] / BODY) for one in (parabola, errors))
    first, rest = (math.sqrt(np.mean(np.square(off[part]))) for part in (at_first, later))
    return swing > max(least, BEYOND_NOISE * error) and first > FURTHER * rest


def _window(run: Run) -> tuple[Array, NDArray[np.int64]]:
    """Times since the first sample, and places, of the samples in the window."""
    first = np.flatnonzero(run.time - run.time[0] <= WINDOW)
    return run.time[first] - run.time[0], first
