"""How a rigid body lies on its four wheels."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def plane_on_wheels(x: Array, y: Array, heights: Array) -> Array:
    """z, pitch and roll (..., 3) of bodies whose wheel centres come nearest to four heights.

    x, y (..., 4) : of the wheel centres at rest from the CG, m;  heights (4,) : from rest, m
    """
    return np.linalg.pinv(np.stack([np.ones(x.shape), -x, y], axis=-1)) @ heights
