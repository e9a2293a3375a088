"""Roads of one shape on level ground: a bump, a pothole, a sine of falling wavelength."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..curves import SweptSine, smooth_step
from .road import Road

Tracks = Literal["both", "left", "right"]
Pairing = Literal["in-phase", "opposed"]

FINEST_SPACING = 0.002
"""Least distance between grid points, m."""

POINTS_PER_SHAPE = 40
"""Grid points to the shortest feature: the spline is then within 1e-5 of the shape's height."""


def bump(begin: float, length: float, height: float, tracks: Tracks = "both") -> Road:
    """One wave of a raised cosine from X = begin: h/2 (1 - cos(2 pi s)); a dip if height < 0."""
    x = _grid(begin, begin + length, length)
    profile = 0.5 * height * (1.0 - np.cos(2.0 * np.pi * (x - begin) / length))
    return _on_tracks(x, profile, tracks, "bump")


def pothole(begin: float, length: float, depth: float, edge: float, tracks: Tracks) -> Road:
    """A level bottom `depth` below the ground between two smooth edges, `length` over all."""
    x = _grid(begin, begin + length, edge)
    falling = smooth_step((x - begin) / edge)
    rising = smooth_step((begin + length - x) / edge)
    return _on_tracks(x, -depth * falling * rising, tracks, "pothole")


def sine_sweep(begin: float, sweep: SweptSine, pairing: Pairing = "in-phase") -> Road:
    """A sine over distance whose spatial frequency rises; `opposed` tracks excite roll alone."""
    x = _grid(begin, begin + sweep.span, 1.0 / max(sweep.first, sweep.last))
    profile = sweep(x - begin)
    right = profile if pairing == "in-phase" else -profile
    return Road(x[0], x[1] - x[0], profile, right, name="sine sweep")


def _grid(begin: float, end: float, feature: float) -> NDArray[np.float64]:
    """Uniform points from begin to end that resolve a feature of a given length."""
    spacing = max(feature / POINTS_PER_SHAPE, FINEST_SPACING)
    return np.linspace(begin, end, max(int(np.ceil((end - begin) / spacing)), 2) + 1)


def _on_tracks(x: NDArray, profile: NDArray, tracks: Tracks, name: str) -> Road:
    """The profile under the named tracks, level ground under the other."""
    level = np.zeros_like(profile)
    left = level if tracks == "right" else profile
    right = level if tracks == "left" else profile
    return Road(x[0], x[1] - x[0], left, right, name=name)
