"""The body's state at the beginning of a recording: as measured, and how far from equilibrium.

The model starts from static equilibrium under the first wheel heights unless told otherwise. A
record that was cut out of a ride starts elsewhere, and the model would answer with a swing of its
own that no parameter can explain.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .channels import OUTPUT_CHANNELS, Run
from .errors import MeasurementError

Array = NDArray[np.float64]

WINDOW = 0.2
"""The start of a record from which its initial state is taken, s."""

FEWEST_SAMPLES = 10
"""Samples in the window without which no rate is taken from it."""

FIRST, LATER = 0.4, 1.5
"""A car's own swing fills the time until FIRST, s, and has died away LATER."""

SWING = {"chassis.z": 2e-3, "chassis.pitch": math.radians(0.15), "chassis.roll": math.radians(0.15)}
"""Rms distance of the record from the model in the FIRST seconds that is told of, SI."""

MUCH_FURTHER = 1.5
"""It must exceed the distance LATER, which comes from other causes, by this factor."""


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
    name: str, time: Array, measured: Mapping[str, Array], model: Mapping[str, Array]
) -> list[str]:
    """A sentence where the model, begun in equilibrium, swings into the record's motion.

    name : the run's
    time : (samples,) s
    measured, model : z, pitch and roll, those there are, SI
    """
    since = time - time[0]
    at_first, later = since <= FIRST, since >= LATER
    found = []
    for channel, values in measured.items():
        off = np.square(values - model[channel])
        first, rest = (
            math.sqrt(np.mean(off[part])) if part.any() else 0.0 for part in (at_first, later)
        )
        if first > max(SWING[channel], MUCH_FURTHER * rest):
            found.append(channel)
    if not found:
        return []
    return [
        f"Run {name} starts away from rest ({', '.join(found)}), but the model starts from "
        'equilibrium; begin the run at rest, or take the initial state "measured".'
    ]


def _window(run: Run) -> tuple[Array, NDArray[np.int64]]:
    """Times since the first sample, and places, of the samples in the window."""
    first = np.flatnonzero(run.time - run.time[0] <= WINDOW)
    return run.time[first] - run.time[0], first
