"""Small vibrations about rest: frequencies and what moves in them.

In the null space N of the constraints, with M of the linearised car and the residual r of all
forces, the joints' reactions among them,

    N^T (dr/dq) N y = (2 pi f)^2 N^T M N y,    shape = N y

without damping: x, y, yaw and the wheels' spin are free and come out at 0 Hz. Reactions turn with
the bodies: without their share in dr/dq yaw is not free and pitch is off by 3.5 %. Exudyn's own
stiffness matrix has no such share, so r is differenced.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from .builder import Model
from .equilibrium import static_settings

Array = NDArray[np.float64]

INCREMENT = 1e-6
"""Of a unit motion in central differences, m and rad: round-off and curvature are both below 1e-6
of a frequency."""


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
    mass, _, _, _, null = model.system.ComputeLinearizedSystem(
        static_settings(model), returnConstraintNullspace=True
    )
    stiffness = null @ _stiffness(model, null)
    # Symmetric but for the round-off of the differences and the residual of the rest.
    squares, motions = eigh((stiffness + stiffness.T) / 2.0, null @ mass @ null.T)
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


def _stiffness(model: Model, motions: Array) -> Array:
    """Change of the residual (6 groups, n) with each of some motions (n, 6 groups)."""
    solver, settings = model.exudyn.MainSolverStatic(), static_settings(model)
    solver.InitializeSolver(model.system, settings)
    data, current = model.system.systemData, model.exudyn.ConfigurationType.Current
    rest = data.GetODE2Coordinates()

    def residual(q: Array) -> Array:
        data.SetODE2Coordinates(q, current)
        solver.ComputeNewtonResidual(model.system, settings)
        return np.array(solver.GetSystemResidual())[: rest.size]

    moved = [INCREMENT * motion for motion in motions]
    changes = [residual(rest - step) - residual(rest + step) for step in moved]
    data.SetODE2Coordinates(rest, current)
    solver.FinalizeSolver(model.system, settings)
    return np.array(changes).T / (2.0 * INCREMENT)
