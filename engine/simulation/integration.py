"""States of a batch of cars over time: the kernels with starts, threads and failures."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import SimulationDiverged, SimulationError
from ..frames import COORDINATES, CORNERS
from ..kernels.buffer import BODY_ROWS
from ..kernels.integrate import Batch, Course, integrate_free, integrate_rims
from ..kernels.lanes import BATCH, ONE_CAR
from ..kernels.observe import OUTPUTS, CarOutput, CornerOutput, observe_free, observe_rims
from ..kernels.records import Corner
from ..kernels.watch import NOTHING, Watch
from ..roads.road import Road
from ..wheel_plane import plane_on_wheels
from .reductions import Reduction
from .rims import RimsInputs
from .stepping import FreeInputs

Array = NDArray[np.float64]
Kernel = Callable[[tuple[int, ...], Batch], None]

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
_FREE_ACCELERATIONS = [1, 2, 3, *ARM_ACCELERATIONS]
"""Of all coordinates but x."""
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


@dataclass(frozen=True, eq=False)
class Tallies:
    """Sums and extremes of each car, which `reductions.figures` reads.

    values (C, columns) : of no meaning where a car has failed
    failed (C,), reach (C,) : as of `States`
    """

    values: Array
    failed: NDArray[np.int64]
    reach: Array


def free_states(cars: Array, inputs: FreeInputs, threads: int | None = None) -> States:
    """States of cars (C, CAR_ROWS) driven by a road or posts, from equilibrium.

    The start is static equilibrium on the contact points' heights, at the initial speed.
    threads : at most; as many as there are cores unless told
    """
    out = np.zeros((len(cars), inputs.time.size, 16))
    return _states(out, *_run(_free(inputs), cars, _free_start(cars, inputs), out, threads))


def free_tallies(
    cars: Array, inputs: FreeInputs, reduced: Reduction, threads: int | None = None
) -> Tallies:
    """The same without keeping states."""
    start, values = _free_start(cars, inputs), np.zeros((len(cars), reduced.columns))
    return Tallies(values, *_tally(_free(inputs), cars, start, reduced, values, threads))


def rims_states(cars: Array, inputs: RimsInputs, exact: bool, threads: int | None = None) -> States:
    """States of cars (C, CAR_ROWS) at the nodes of prescribed rims; their arms are not kept."""
    out = np.zeros((len(cars), inputs.node_time.size, 16))
    start = _rims_start(cars, inputs)
    return _states(out, *_run(_on_rims(inputs, exact), cars, start, out, threads))


def rims_tallies(
    cars: Array,
    inputs: RimsInputs,
    exact: bool,
    reduced: Reduction,
    threads: int | None = None,
) -> Tallies:
    """The same without keeping states; samples are the nodes."""
    start, values = _rims_start(cars, inputs), np.zeros((len(cars), reduced.columns))
    driven = _on_rims(inputs, exact)
    return Tallies(values, *_tally(driven, cars, start, reduced, values, threads))


def _free(inputs: FreeInputs) -> Kernel:
    """The kernel bound to what drives the free car."""
    course, road = Course(inputs.stage_inputs, inputs.steps, inputs.samples), inputs.road
    return lambda lanes, batch: integrate_free(
        lanes, course, batch, road.coefficients, road.start, road.spacing
    )


def _on_rims(inputs: RimsInputs, exact: bool) -> Kernel:
    """The kernel bound to prescribed rims."""
    nodes = inputs.node_time
    course = Course(inputs.stage_inputs, np.diff(nodes), np.arange(nodes.size))
    return lambda lanes, batch: integrate_rims(lanes, course, batch, 1.0 if exact else 0.0)


def _free_start(cars: Array, inputs: FreeInputs) -> Array:
    """States (C, 16) of equilibrium on the first heights; on level ground that is the design
    position of every car.
    """
    states = np.zeros((len(cars), 16))
    x = _wheel_places(cars)[0]
    heights = np.stack([inputs.road.height(k % 2, x[:, k]) for k in range(4)], axis=1)
    uneven = np.any(heights + inputs.stage_inputs[0, 0, :4] != 0.0, axis=1)
    states[uneven, 1:8] = _free_rest(cars[uneven], inputs)
    states[:, 8] = inputs.initial_speed
    return states


def _rims_start(cars: Array, inputs: RimsInputs) -> Array:
    """States (C, 16) of equilibrium on the wheels' first heights, or those given."""
    states, first = np.zeros((len(cars), 16)), inputs.stage_inputs[0, 0]
    if inputs.start_state is not None:
        states[:, 1:4], states[:, 9:12] = inputs.start_state[:3], inputs.start_state[3:]
    elif np.any(first[:4] != 0.0):
        states[:, 1:4] = _rims_rest(cars, first[:4])
    states[:, 8] = first[13]
    return states


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


def _states(out: Array, failed: NDArray[np.int64], reach: Array) -> States:
    """Nothing is known of a car from its failure on."""
    for car in np.flatnonzero(failed >= 0):
        out[car, failed[car] :] = np.nan
    return States(out, failed, reach)


def _run(
    integrate: Kernel, cars: Array, start: Array, out: Array, threads: int | None
) -> tuple[NDArray[np.int64], Array]:
    """Integrate and keep states; returns first failures and reaches."""
    lanes = ONE_CAR if len(cars) == 1 else BATCH
    nothing = np.zeros((len(cars), 0))
    return _in_threads(integrate, lanes, cars, start, NOTHING, out, nothing, threads)


def _tally(
    integrate: Kernel,
    cars: Array,
    start: Array,
    reduced: Reduction,
    values: Array,
    threads: int | None,
) -> tuple[NDArray[np.int64], Array]:
    """Integrate and tally; returns first failures and reaches."""
    nothing = np.zeros((len(cars), 0, 16))
    return _in_threads(integrate, BATCH, cars, start, reduced.watch, nothing, values, threads)


def _in_threads(
    integrate: Kernel,
    lanes: tuple[int, ...],
    cars: Array,
    start: Array,
    watch: Watch,
    out: Array,
    tallies: Array,
    threads: int | None,
) -> tuple[NDArray[np.int64], Array]:
    """One call, or for more cars than lanes one in each of some threads."""
    failed, reach = np.full(len(cars), -1, dtype=np.int64), np.ones(len(cars))

    def run(part: slice) -> None:
        rows = cars[part], start[part]
        told = out[part], failed[part], reach[part], tallies[part]
        integrate(lanes, Batch(*rows, watch, *told))

    parts = _parts(len(cars), len(lanes), threads)
    if len(parts) == 1:
        run(parts[0])
    else:
        with ThreadPoolExecutor(len(parts)) as pool:
            list(pool.map(run, parts))
    return failed, reach


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0))


def _parts(cars: int, lanes: int, threads: int | None) -> Sequence[slice]:
    """Slices of whole groups of lanes, one for each thread that has work."""
    groups = -(-cars // lanes)
    threads = min(threads or cores(), groups)
    edges = np.linspace(0, groups, threads + 1).astype(int) * lanes
    return [slice(a, b) for a, b in zip(edges[:-1], np.minimum(edges[1:], cars), strict=True)]


def free_outputs(car: Array, states: Array, inputs: Array, road: Road) -> Array:
    """Outputs (n, OUTPUTS) of one car at states (n, 16) under inputs (n, 16); a column lies in one
    piece, as the channel that it becomes.
    """
    out = np.empty((OUTPUTS, len(states)))
    observe_free(car, states, inputs, road.coefficients, road.start, road.spacing, out)
    return out.T


def rims_outputs(car: Array, states: Array, inputs: Array, exact: bool) -> Array:
    """Outputs of one car on its rims at states (n, 16) under inputs (n, 15); as `free_outputs`."""
    out = np.empty((OUTPUTS, len(states)))
    observe_rims(car, states, inputs, 1.0 if exact else 0.0, out)
    return out.T


def _free_rest(cars: Array, inputs: FreeInputs) -> Array:
    """z, pitch, roll and arms (C, 7) of static equilibrium on the contact points' first heights, x
    held at 0.
    """
    acting = np.zeros((2 * 7 + 1, 16))
    acting[:, :4] = inputs.stage_inputs[0, 0, :4]

    def accelerations(car: Array, q: Array) -> Array:
        states = np.zeros((len(q), 16))
        states[:, 1:8] = q
        out = free_outputs(car, states, acting, inputs.road)
        return out[:, _FREE_ACCELERATIONS]

    return _rest(accelerations, cars, np.zeros((len(cars), 7)))


def _rims_rest(cars: Array, heights: Array) -> Array:
    """z, pitch and roll (C, 3) of static equilibrium on the wheels' first heights (4,)."""
    acting = np.zeros((2 * 3 + 1, 15))
    acting[:, :4] = heights

    def accelerations(car: Array, q: Array) -> Array:
        states = np.zeros((len(q), 16))
        states[:, 1:4] = q
        out = rims_outputs(car, states, acting, True)
        reached = np.all(out[:, _REACHES] >= 0.0, axis=1)
        return np.where(reached[:, np.newaxis], out[:, 1:4], np.nan)

    return _rest(accelerations, cars, plane_on_wheels(*_wheel_places(cars), heights))


def _wheel_places(cars: Array) -> tuple[Array, Array]:
    """x and y (..., 4) of the wheel centres at rest from the CG, m, of cars (..., CAR_ROWS)."""
    corners = cars[..., BODY_ROWS:].reshape(*cars.shape[:-1], 4, -1)
    of = Corner._fields.index
    x = corners[..., of("pivot_x")] + corners[..., of("arm_x")]
    return x, corners[..., of("pivot_y")]


def _rest(accelerations: Callable[[Array, Array], Array], cars: Array, guess: Array) -> Array:
    """Coordinates (C, size) of cars (C, CAR_ROWS) without acceleration, by Newton's method.

    accelerations : car (CAR_ROWS,), coordinates (2 size + 1, size) -> accelerations of that shape
    Not a number where there are none; the car has then failed before its first step.
    """
    q, size = guess.copy(), guess.shape[1]
    differences = _DIFFERENCE * np.vstack([np.zeros(size), np.eye(size), -np.eye(size)])
    moving = np.arange(len(cars))
    for _ in range(_NEWTON_STEPS):
        if not moving.size:
            break
        trials = q[moving, np.newaxis] + differences
        values = np.stack(
            [accelerations(cars[k], at) for k, at in zip(moving, trials, strict=True)]
        )
        resting = np.max(np.abs(values[:, 0]), axis=1) < _AT_REST
        lost = ~resting & ~np.isfinite(values).all(axis=(1, 2))
        q[moving[lost]] = np.nan
        moving, values = moving[~resting & ~lost], values[~resting & ~lost]
        jacobians = (values[:, 1 : size + 1] - values[:, size + 1 :]) / (2.0 * _DIFFERENCE)
        inverses = np.linalg.pinv(jacobians.transpose(0, 2, 1))
        q[moving] -= np.einsum("cij,cj->ci", inverses, values[:, 0])
    q[moving] = np.nan
    return q
