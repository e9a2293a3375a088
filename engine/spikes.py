"""Spikes of a recorded channel: samples that tower over their neighbours as no car moves."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from .channels import ChannelInfo

Array = NDArray[np.float64]

NEIGHBOURS = 7
"""Samples of the running median; up to three spikes in a row lie outside it."""

SHARE = 0.1
"""Share of a real recording's greatest value by which a spike leaves the median ..."""

TIMES_USUAL = 10.0
"""... and multiple of what 99 % of the samples do."""


def despiked(values: Array) -> Array:
    """The running median of a channel (samples,)."""
    return median_filter(values, NEIGHBOURS, mode="nearest")


def spike_samples(info: ChannelInfo, values: Array) -> NDArray[np.int64]:
    """Which samples of a channel (samples,) are spikes."""
    off = np.abs(values - despiked(values))
    return np.flatnonzero(off > max(SHARE * info.largest, TIMES_USUAL * np.percentile(off, 99)))


def spikes(info: ChannelInfo, time: Array, values: Array) -> list[str]:
    """A sentence where a channel (samples,) has spikes."""
    found = spike_samples(info, values)
    if not found.size:
        return []
    furthest = float(values[found[np.argmax(np.abs(values - despiked(values))[found])]])
    return [
        f"{info.name} jumps to {info.display_factor * furthest:.4g} {info.display_unit}, as no car "
        f"does, in {found.size} of {values.size} samples from {time[found[0]]:.4g} s on; repair or "
        "cut these spikes."
    ]
