"""What is watched of the cars while they drive, and how."""

from typing import NamedTuple

import numpy as np


class Watch(NamedTuple):
    """Arrays that the tallies read; all are empty where nothing is tallied.

    point (3,) : of the chassis, from its CG in B, m
    weights (S, 3) : of each sample in a mean over time, over the time in which the car accelerates
        and over that in which it brakes; each column sums to 1, or is 0 where it never does
    window : samples in a second
    kinds (n,) : which of the filters' steps below belongs to each integration step
    vertical (K, 8, 5), horizontal (K, 6, 5) : `WeightingFilter.step` of Wk and of Wd for the
        different lengths of step
    vertical_output (8,), horizontal_output (6,) : C of both
    shares (P,) : of the samples below a percentile
    """

    point: np.ndarray
    weights: np.ndarray
    window: int
    kinds: np.ndarray
    vertical: np.ndarray
    horizontal: np.ndarray
    vertical_output: np.ndarray
    horizontal_output: np.ndarray
    shares: np.ndarray


NOTHING = Watch(
    np.zeros(3),
    np.zeros((0, 3)),
    0,
    np.zeros(0, dtype=np.int64),
    np.zeros((0, 8, 5)),
    np.zeros((0, 6, 5)),
    np.zeros(8),
    np.zeros(6),
    np.zeros(0),
)
"""Tallies nothing."""
