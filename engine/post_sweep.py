"""A four-post rig's sweep: all posts in one pattern, the frequency rising over time."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from .curves import SweptSine
from .demand import PostMotion
from .errors import ManoeuvreError
from .vehicle import Range

Pattern = Literal["heave", "pitch", "roll", "warp"]

PATTERNS: dict[Pattern, tuple[float, float, float, float]] = {
    "heave": (1.0, 1.0, 1.0, 1.0),
    "pitch": (-1.0, -1.0, 1.0, 1.0),
    "roll": (1.0, -1.0, 1.0, -1.0),
    "warp": (1.0, -1.0, -1.0, 1.0),
}
"""Sign of each post (fl, fr, rl, rr): pitch nose down and roll left side up are positive."""

Frequency = Annotated[float, Range("Hz", 0.01, 100.0)]
Amplitude = Annotated[float, Range("m", 1e-6, 0.5)]

POINTS_PER_WAVE = 40
"""Samples to the shortest wave: a cubic spline through them is within 1e-5 of the amplitude."""

LONGEST_STEP = 0.005
"""s."""

MOST_POINTS = 500_000
"""Most samples of a sweep."""


@dataclass(frozen=True, slots=True)
class PostSweep:
    """Frequencies from the first to the last over the whole manoeuvre, amplitudes likewise."""

    pattern: Pattern
    first_frequency: Frequency
    last_frequency: Frequency
    amplitude: Amplitude
    last_amplitude: Amplitude

    def motion(self, duration: float) -> PostMotion:
        """Heights of the posts over time."""
        fastest = max(self.first_frequency, self.last_frequency)
        step = min(LONGEST_STEP, 1.0 / (POINTS_PER_WAVE * fastest))
        if duration > MOST_POINTS * step:
            raise ManoeuvreError(
                f"A sweep up to {fastest:g} Hz may last {MOST_POINTS * step:g} s at most, not"
                f" {duration:g} s; shorten it."
            )
        time = np.linspace(0.0, duration, int(np.ceil(duration / step)) + 1)
        sweep = SweptSine(
            span=duration,
            first=self.first_frequency,
            last=self.last_frequency,
            amplitude=self.amplitude,
            last_amplitude=self.last_amplitude,
        )
        return PostMotion(time, np.outer(sweep(time), PATTERNS[self.pattern]))
