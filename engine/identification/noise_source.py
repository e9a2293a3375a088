"""Where a compared channel's noise is from, and what a fit knows of it.

| source | what it is |
|---|---|
| default | DEFAULT_NOISE, where nobody says |
| stated | by the notes of the run |
| typed | by who asks for the fit, for all of its runs |
| fitted | found from the residuals |

What is typed or fitted is of the sensors, and holds of other runs that they record; what a run
states is its own. All are of what a sensor reads but the fitted one, which is of what is compared,
behind the output filter.
"""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..filters import noise_gain
from ..simulation.rims_settings import RimsSettings

Array = NDArray[np.float64]
NoiseSource = Literal["default", "stated", "typed", "fitted"]

OF_SENSORS: tuple[NoiseSource, ...] = ("typed", "fitted")


def noise_in(fit: Mapping[str, Any], run: str | None, time: Array) -> dict[str, float]:
    """Standard deviations by channel that a fit, as JSON, knows of a run's readings, SI.

    time : of the run, through whose sampling white noise leaves as much as was fitted
    run : what the fit calls it, whose noise is the one in force; None for another, whose noise is
        the root mean square of that of the fit's samples, where it is of the sensors
    """
    passed = noise_gain(time, RimsSettings(**fit["settings"]).output_band)
    known: dict[str, list[tuple[float, int]]] = {}
    for one in fit["runs"]:
        # Fits from before sensors were found do not say.
        sources = one.get("noise_source", {})
        for channel, noise in one["noise"].items():
            source = sources.get(channel)
            if run == one["name"] or (run is None and source in OF_SENSORS):
                read = noise / passed if source == "fitted" else noise
                known.setdefault(channel, []).append((read, one["samples"]))
    found = {}
    for channel, pairs in known.items():
        noise, samples = np.array(pairs).T
        found[channel] = float(np.sqrt(np.average(noise**2, weights=samples)))
    return found
