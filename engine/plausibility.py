"""What makes the numbers of any measurement doubtful or useless: too few, time that does not run,
magnitudes that no car has in the stated unit.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .channels import ChannelInfo
from .errors import MeasurementError
from .spikes import spikes
from .units import to_si

Array = NDArray[np.float64]

FEWEST_SAMPLES = 10
"""Fewest samples a measurement may have."""

SHORTEST_STEP = 1e-12
"""Time between samples, s, below which no clock counts; slopes over it would be no numbers."""

COARSEST_STEP = 0.06
"""Time between samples, s, beyond which the unit of time is doubtful: no wheel's motion is left at
it, and 0.1 is a step of 10,000 samples a second in ms.
"""


def require_samples(count: int, source: str) -> None:
    """Refuse too few samples."""
    if count < FEWEST_SAMPLES:
        raise MeasurementError(
            f"{source}: the file holds {count} samples, at least {FEWEST_SAMPLES} are"
            " needed; record longer or sample faster."
        )


def require_increasing(time: Array, place: Callable[[int], str], source: str) -> None:
    """Refuse a time (samples,), s, that does not increase strictly; `place` names a row."""
    backwards = np.flatnonzero(np.diff(time) < SHORTEST_STEP)
    if backwards.size:
        row = int(backwards[0]) + 1
        kind = place(row).partition(" ")[0]
        raise MeasurementError(
            f"{source}: {place(row)}: time {time[row]:.10g} s does not come after"
            f" {time[row - 1]:.10g} s of the {kind} before; sort the {kind}s by time and keep one"
            " for each time."
        )


def doubtful_time(time: Array) -> list[str]:
    """A warning where a time (samples,), s, has long steps."""
    step = float(np.median(np.diff(time)))
    if step <= COARSEST_STEP:
        return []
    return [f"time advances by {step:.3g} s a sample; is it in ms?"]


def doubtful_magnitude(
    info: ChannelInfo, unit: str, factor: float, time: Array, values: Array
) -> list[str]:
    """A warning when a channel's greatest value makes its stated unit, or itself, doubtful.

    unit, factor : what the file's numbers are in, and SI over it;  values : (samples,), SI
    """
    if found := spikes(info, time, values):
        return found
    peak = float(np.max(np.abs(values)))
    shown = f"{peak / factor:.4g} {unit}"
    if peak > info.largest:
        smaller = to_si(info.display_unit, info.unit)[0] < factor
        doubt = f"is it in {info.display_unit}?" if smaller else "check its unit and rest value."
        return [f"{info.name} reaches {shown}; {doubt}"]
    if 0.0 < peak < info.smallest:
        doubt = f"is it in {info.unit}?" if factor < 1.0 else "check its unit."
        return [f"{info.name} stays within {shown}; {doubt}"]
    return []
