"""Small vibrations about rest: frequencies and what moves in them.

In the null space N of the constraints, with M, K of the linearised car,

    N^T K N y = (2 pi f)^2 N^T M N y,    shape = N y

without damping: x, y, yaw and the wheels' spin are free and come out at 0 Hz.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from .builder import Model
from .equilibrium import static_settings

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """One mode: undamped frequency, Hz, and its shape (groups, 6).

    shares : share of the kinetic energy by the first name of the rigid group, greatest first
    """

    frequency: float
    shape: Array
    shares: dict[str, float]


def modes(model: Model) -> list[Mode]:
    """Every mode of a settled model, slowest first, as many as it has degrees of freedom."""
    mass, stiffness, _, _, null = model.system.ComputeLinearizedSystem(
        static_settings(model), returnConstraintNullspace=True
    )
    # Symmetric but for the round-off of its differences and the moments of forces that turn.
    squares, motions = eigh(null @ (stiffness + stiffness.T) @ null.T / 2.0, null @ mass @ null.T)
    names = [group.names[0] for group in model.groups]
    found = []
    for square, motion in zip(squares, motions.T, strict=True):
        shape = null.T @ motion
        energy = (shape * (mass @ shape)).reshape(-1, 6).sum(axis=1)
        order = np.argsort(-energy)
        found.append(
            Mode(
                float(np.sqrt(max(square, 0.0)) / (2.0 * np.pi)),
                shape.reshape(-1, 6),
                {names[k]: float(energy[k]) for k in order},
            )
        )
    return found
