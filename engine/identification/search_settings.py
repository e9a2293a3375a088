"""What a search can be asked for, free of numpy for those who only ask."""

from typing import Literal

LossName = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]

DEFAULT_SCALE = 3.0
"""Noises from which on a residual counts for less: Gaussian noise goes there in 0.3 % of samples,
so that an estimate from clean runs loses less than a thousandth of its precision, and where noise
was stated at half its size still less than a twentieth."""

SMALLEST_SCALE, LARGEST_SCALE = 0.01, 1e6
"""Between which the scale of a loss lies, in noises."""

MOST_STARTS = 1024
