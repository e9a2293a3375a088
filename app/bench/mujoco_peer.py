"""The same car stepped by MuJoCo: its tree, its force elements, its integrators in its C loop.

Spring-dampers are spatial tendons between wheel centre and mount, bars are fixed tendons over two
arms. A tyre is an actuator on the wheel centre along Z with a spring's and a damper's bias; the
longitudinal force is one along X with the moment of its place r below; the torque's reaction is one
on the arm's joint. What they take over time is that of `histories`.
"""

from typing import Any, Literal

import numpy as np
from mujoco.rollout import rollout
from numpy.typing import NDArray

from ...engine.vehicle import Vehicle
from .car_points import CORNERS, Corner, corners_of
from .histories import Histories
from .mujoco_tree import mujoco, tree_of

Array = NDArray[np.float64]
Integrator = Literal["RK4", "Euler"]


class MujocoCar:
    """A car that follows histories in MuJoCo's own loop."""

    def __init__(self, vehicle: Vehicle, given: Histories, step: float, integrator: Integrator):
        corners = corners_of(vehicle)
        spec = tree_of(vehicle, corners)
        spec.option.timestep = step
        spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
        _add_suspension(spec, corners)
        turned = [k for k in range(4) if np.any(given.arm_torque[:, k])]
        _add_actuators(spec, corners, turned)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._start = self._state(given.states[0])
        self._controls = _controls(corners, given, turned)[np.newaxis]

    def states(self) -> Array:
        """States (n + 1, 16) at the ends of the steps."""
        found, _ = rollout(self.model, self.data, self._start, self._controls)
        return np.concatenate([self._start, np.asarray(found)[0]])[:, 1:]

    def _state(self, values: Array) -> Array:
        """Time, coordinates and rates (1, 17) as MuJoCo keeps them."""
        self.data.qpos[:], self.data.qvel[:] = values[:8], values[8:]
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.zeros((1, mujoco.mj_stateSize(self.model, kind)))
        mujoco.mj_getState(self.model, self.data, state[0], kind)
        return state


def _add_suspension(spec: Any, corners: list[Corner]) -> None:
    """Springs, dampers and bars as tendons."""
    for name, corner in zip(CORNERS, corners, strict=True):
        data = corner.axle.suspension
        spec.body(name).add_site(name=f"wheel_{name}", pos=corner.p_C - corner.p_P)
        spec.body("chassis").add_site(name=f"mount_{name}", pos=corner.p_A)
        free_length = data.mount_height + corner.preload / data.stiffness
        tendon = spec.add_tendon(
            stiffness=data.stiffness, damping=data.damping, springlength=[free_length] * 2
        )
        tendon.wrap_site(f"wheel_{name}")
        tendon.wrap_site(f"mount_{name}")
    for left, right in (("fl", "fr"), ("rl", "rr")):
        bar = corners[CORNERS.index(left)].axle.stabilizer_bar
        tendon = spec.add_tendon(stiffness=bar.stiffness, damping=bar.damping)
        tendon.springlength = [0, 0]
        tendon.wrap_joint(f"arm_{left}", 1)
        tendon.wrap_joint(f"arm_{right}", -1)


def _add_actuators(spec: Any, corners: list[Corner], turned: list[int]) -> None:
    """Vertical and longitudinal forces at the four wheels, then torques on some arms."""
    spec.worldbody.add_site(name="origin")
    for name, corner in zip(CORNERS, corners, strict=True):
        tyre = corner.axle.tyre
        bias = [0, -tyre.stiffness, -tyre.damping]
        _add_force(spec, f"wheel_{name}", [0, 0, 1, 0, 0, 0], bias)
    for name, corner in zip(CORNERS, corners, strict=True):
        _add_force(spec, f"wheel_{name}", [1, 0, 0, 0, -corner.axle.wheel.radius, 0])
    for k in turned:
        spec.add_actuator(
            trntype=mujoco.mjtTrn.mjTRN_JOINT, target=f"arm_{CORNERS[k]}", gainprm=[1] + [0] * 9
        )


def _add_force(spec: Any, site: str, gear: list[float], bias: list[float] | None = None) -> None:
    """An actuator at a site along inertial axes: control plus bias . (1, length, its rate)."""
    kinds = mujoco.mjtBias
    spec.add_actuator(
        trntype=mujoco.mjtTrn.mjTRN_SITE,
        target=site,
        refsite="origin",
        gear=gear,
        gainprm=[1] + [0] * 9,
        biastype=kinds.mjBIAS_AFFINE if bias else kinds.mjBIAS_NONE,
        biasprm=(bias or [0, 0, 0]) + [0] * 7,
    )


def _controls(corners: list[Corner], given: Histories, turned: list[int]) -> Array:
    """(n, actuators) in the order of `_add_actuators`."""
    columns = []
    for k, corner in enumerate(corners):
        columns.append(given.upward(corner, k))
    columns += [given.longitudinal[:, k] for k in range(4)]
    columns += [given.arm_torque[:, k] for k in turned]
    return np.column_stack(columns)
