"""The car at rest on level ground, by Exudyn's static solver.

Preloads and weight come on in one step: taken in parts, weight without preload would throw the
suspension onto its stops. What has no stiffness of its own is held meanwhile (`Model.hold`).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SimulationError
from .builder import Model

Array = NDArray[np.float64]

FARTHEST = 0.2
"""m: a body farther from its design position at rest means that the car has collapsed."""


def settle(model: Model) -> Array:
    """Displacements (groups, 6) from the design position at rest; the model stays there.

    Raises SimulationError naming the body that ends up out of place.
    """
    settings = static_settings(model)
    model.hold(True)
    try:
        model.system.SolveStatic(settings, updateInitialValues=True)
    except model.exudyn.ExudynError as error:
        raise SimulationError(
            f"The car finds no position of rest: the static solution fails, farthest off"
            f" '{_farthest(model)[0]}'; check the points and stiffnesses of what holds it."
        ) from error
    body, distance = _farthest(model)
    if not distance < FARTHEST:
        raise SimulationError(
            f"At rest '{body}' lies {distance:.2f} m from its design position; check the points"
            " and stiffnesses of what holds it, and the preloads."
        )
    model.hold(False)
    return coordinates(model)


def static_settings(model: Model) -> Any:
    """Settings of the static solver."""
    settings = model.exudyn.SimulationSettings()
    settings.solution.file.write = False
    settings.linearSolver.solverType = model.exudyn.LinearSolverType.EigenSparse
    static = settings.staticSolver
    static.verboseMode = 0
    static.adaptiveStep = False
    static.newton.relativeTolerance = 1e-10
    static.newton.absoluteTolerance = 1e-6
    return settings


def coordinates(model: Model) -> Array:
    """Displacements (groups, 6) from the design position, as the model stands."""
    return model.system.systemData.GetODE2Coordinates().reshape(-1, 6)


def _farthest(model: Model) -> tuple[str, float]:
    """The body that is farthest from its design position, and how far, m."""
    distance = np.linalg.norm(coordinates(model)[:, :3], axis=1)
    distance = np.where(np.isfinite(distance), distance, np.inf)
    worst = int(np.argmax(distance))
    return model.groups[worst].names[0], float(distance[worst])
