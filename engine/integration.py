"""States of a batch of cars over time: the kernels with starts, threads and failures."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import SimulationDiverged, SimulationError
from .frames import COORDINATES, CORNERS
from .kernels.buffer import BODY_ROWS
from .kernels.integrate import integrate_free, integrate_rims
from .kernels.lanes import BATCH, ONE_CAR
from .kernels.observe import OUTPUTS, CarOutput, CornerOutput, observe_free, observe_rims
from .kernels.records import Corner
from .rims import RimsInputs
from .road import Road
from .stepping import FreeInputs

Array = NDArray[np.float64]

_NEWTON_STEPS = 25
_DIFFERENCE = 1e-6
_AT_REST = 1e-9
"""m/s2 and rad/s2: accelerations below it count as rest."""

FIRST_CORNER = len(CarOutput._fields)
CORNER_SIZE = len(CornerOutput._fields)


def _columns(field: str) -> list[int]:
    """Where one field of the four corners stands in the outputs."""
    first = FIRST_CORNER + CornerOutput._fields.index(field)
    return [first + corner * CORNER_SIZE for corner in range(4)]


ARM_ACCELERATIONS = _columns("acceleration")
_REACHES, _CLEARANCES = _columns("reach"), _columns("clearance")


@dataclass(frozen=True, eq=False)
class States:
    """Coordinates and rates of each car at the samples.

    values (C, S, 16) : NaN from a car's failure on
    failed (C,) : first sample at which a car had left the model's range, or -1
    reach (C,) : negative where it left the range of its arms or passed the mount of a spring-damper
    """

    values: Array
    failed: NDArray[np.int64]
    reach: Array


def free_states(cars: Array, inputs: FreeInputs) -> States:
    """States of cars (C, CAR_ROWS) driven by a road or posts, from equilibrium.

    The start is static equilibrium on the contact points' heights, at the initial speed.
    """
    states = np.zeros((len(cars), 16))
    for car, state in zip(cars, states, strict=True):
        state[:] = _free_rest(car, inputs)
    states[:, 8] = inputs.initial_speed
    road = inputs.road

    def integrate(lanes, some_cars, some_states, out, failed, reach):
        integrate_free(
            lanes,
            some_cars,
            some_states,
            inputs.stage_inputs,
            inputs.steps,
            inputs.samples,
            road.coefficients,
            road.start,
            road.spacing,
            out,
            failed,
            reach,
        )

    return _run(integrate, cars, states, inputs.time.size)


def rims_states(cars: Array, inputs: RimsInputs, exact: bool) -> States:
    """States of cars (C, CAR_ROWS) at the nodes of prescribed rims; their arms are not kept."""
    states = np.zeros((len(cars), 16))
    for car, state in zip(cars, states, strict=True):
        if inputs.start_state is None:
            state[:] = _rims_rest(car, inputs.stage_inputs[0, 0])
        else:
            state[1:4], state[9:12] = inputs.start_state[:3], inputs.start_state[3:]
    states[:, 8] = inputs.stage_inputs[0, 0, 13]
    steps = np.diff(inputs.node_time)
    samples = np.arange(inputs.node_time.size)

    def integrate(lanes, some_cars, some_states, out, failed, reach):
        integrate_rims(
            lanes,
            some_cars,
            some_states,
            inputs.stage_inputs,
            steps,
            samples,
            1.0 if exact else 0.0,
            out,
            failed,
            reach,
        )

    return _run(integrate, cars, states, samples.size)


def check_sound(states: States, car: int, time: Array, outputs: Callable[[int], Array]) -> None:
    """Raise SimulationDiverged where a car has failed, naming time and coordinate.

    SimulationError where it failed before the first step, for want of a static equilibrium.

    outputs : sample of the failure -> outputs (OUTPUTS,) of the car on its verge
    """
    sample = int(states.failed[car])
    if sample < 0:
        return
    if sample == 0:
        raise SimulationError(
            "No static equilibrium at the start: the first heights of road, posts or wheels are"
            " out of the suspension's reach; check their unit and that they count from rest."
        )
    if states.reach[car] < 0.0:
        verge = outputs(sample)
        reach, clearance = verge[_REACHES], verge[_CLEARANCES]
        if reach.min() < max(clearance.min(), 0.0):
            raise SimulationDiverged(
                float(time[sample]),
                COORDINATES[4 + int(np.argmin(reach))],
                "the wheel centre cannot reach its measured height; check the wheel channels' unit"
                " and sign, and the pivot distance.",
            )
        raise SimulationDiverged(
            float(time[sample]),
            f"suspension.{CORNERS[int(np.argmin(clearance))]}.travel",
            "the wheel centre passed the mount of its spring-damper; raise mount_height, stiffen"
            " the suspension, or check the units of what drives the car.",
        )
    size = np.abs(states.values[car, max(sample - 1, 0), 1:8])
    coordinate = COORDINATES[1 + int(np.argmax(np.where(np.isfinite(size), size, np.inf)))]
    raise SimulationDiverged(
        float(time[sample]),
        coordinate,
        "check stiffnesses, dampings and the units of what drives the car, or take a shorter step.",
    )


def _run(integrate: Callable, cars: Array, states: Array, samples: int) -> States:
    """Integrate in one go, or for a batch in as many threads as there are cores."""
    out = np.zeros((len(cars), samples, 16))
    failed = np.full(len(cars), -1, dtype=np.int64)
    reach = np.ones(len(cars))
    lanes = ONE_CAR if len(cars) == 1 else BATCH
    parts = _parts(len(cars), len(lanes))
    if len(parts) == 1:
        integrate(lanes, cars, states, out, failed, reach)
    else:
        with ThreadPoolExecutor(len(parts)) as pool:
            list(
                pool.map(
                    lambda part: integrate(
                        lanes, cars[part], states[part], out[part], failed[part], reach[part]
                    ),
                    parts,
                )
            )
    for car, sample in enumerate(failed):
        if sample >= 0:
            out[car, sample:] = np.nan
    return States(out, failed, reach)


def _parts(cars: int, lanes: int) -> Sequence[slice]:
    """Slices of whole groups of lanes, one for each core that has work."""
    groups = -(-cars // lanes)
    threads = min(len(os.sched_getaffinity(0)), groups)
    edges = np.linspace(0, groups, threads + 1).astype(int) * lanes
    return [slice(a, b) for a, b in zip(edges[:-1], np.minimum(edges[1:], cars), strict=True)]


def free_outputs(car: Array, states: Array, inputs: Array, road: Road) -> Array:
    """Outputs (n, OUTPUTS) of one car at states (n, 16) under inputs (n, 16)."""
    out = np.zeros((len(states), OUTPUTS))
    observe_free(car, states, inputs, road.coefficients, road.start, road.spacing, out)
    return out


def rims_outputs(car: Array, states: Array, inputs: Array, exact: bool) -> Array:
    """Outputs (n, OUTPUTS) of one car on its rims at states (n, 16) under inputs (n, 15)."""
    out = np.zeros((len(states), OUTPUTS))
    observe_rims(car, states, inputs, 1.0 if exact else 0.0, out)
    return out


def _free_rest(car: Array, inputs: FreeInputs) -> Array:
    """State of static equilibrium on the contact points' first heights, x held at 0."""
    acting = np.zeros(16)
    acting[:4] = inputs.stage_inputs[0, 0, :4]

    def accelerations(q: Array) -> Array:
        states = np.zeros((len(q), 16))
        states[:, 1:8] = q
        out = free_outputs(car, states, np.tile(acting, (len(q), 1)), inputs.road)
        return np.concatenate([out[:, 1:4], out[:, ARM_ACCELERATIONS]], axis=1)

    state = np.zeros(16)
    state[1:8] = _rest(accelerations, np.zeros(7))
    return state


def _rims_rest(car: Array, first: Array) -> Array:
    """State of static equilibrium on the wheels' first heights, standing still."""
    acting = np.zeros(15)
    acting[:4] = first[:4]

    def accelerations(q: Array) -> Array:
        states = np.zeros((len(q), 16))
        states[:, 1:4] = q
        out = rims_outputs(car, states, np.tile(acting, (len(q), 1)), True)
        reached = np.all(out[:, _REACHES] >= 0.0, axis=1)
        return np.where(reached[:, np.newaxis], out[:, 1:4], np.nan)

    state = np.zeros(16)
    state[1:4] = _rest(accelerations, _plane(car, acting[:4]))
    return state


def _plane(car: Array, heights: Array) -> Array:
    """z, pitch and roll of a rigid car whose wheel centres come nearest to four heights."""
    corners = car[BODY_ROWS:].reshape(4, -1)
    of = Corner._fields.index
    x = corners[:, of("pivot_x")] + corners[:, of("arm_x")]
    y = corners[:, of("pivot_y")]
    plane = np.column_stack([np.ones(4), -x, y])
    return np.asarray(np.linalg.lstsq(plane, heights, rcond=None)[0], dtype=np.float64)


def _rest(accelerations: Callable[[Array], Array], guess: Array) -> Array:
    """Coordinates without acceleration, by Newton's method from a guess (size,).

    accelerations : coordinates (n, size) -> accelerations (n, size)
    Not a number where there are none; the car has then failed before its first step.
    """
    q, size = guess, guess.size
    for _ in range(_NEWTON_STEPS):
        trials = np.vstack([q, q + _DIFFERENCE * np.eye(size), q - _DIFFERENCE * np.eye(size)])
        values = accelerations(trials)
        if np.max(np.abs(values[0])) < _AT_REST:
            return q
        jacobian = (values[1 : size + 1] - values[size + 1 :]).T / (2.0 * _DIFFERENCE)
        if not np.all(np.isfinite(jacobian)):
            break
        q = q - np.linalg.lstsq(jacobian, values[0], rcond=None)[0]
    return np.full(size, np.nan)
