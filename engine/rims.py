"""From a recording to what drives the model in rims mode.

The four wheel centres' vertical displacement u_i(t) and the chassis's acceleration a_x(t) are
prescribed. The integrator needs u, u', u'', a_x, the speed v_x and the braking weight b at the
begin, middle and end of each of its steps; this module makes them, in this order:

1. Wheel channels, zero-phase low-pass at `rim_cutoff_hz` (off by default), then one C2 cubic
   spline per channel through the samples; u' and u'' are its derivatives.
2. a_x, zero-phase low-pass at `a_x_cutoff_hz` (20 Hz by default), then a C2 cubic spline.
3. v_x from the file's `chassis.v_x`, else the integral of a_x from zero.
4. b(t): 1 where a_x, low-passed zero-phase at 1 Hz, stays below -(fr g + 0.5 m/s2) for at least
   0.5 s, or where `braking_intervals` says so; 0 elsewhere, with linear ramps of 0.1 s outside each
   interval. 0 throughout when the vehicle has no brakes.

The filter is `filters.low_pass`. Nodes are uniform over the record, their step the longest that
divides it and does not exceed `step`. Where the samples do not fall on nodes, the model's output
is carried to them by cubic Hermite interpolation from its states and rates.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from .channels import Run
from .equilibrium import static_loads
from .errors import MeasurementError, SimulationError, VehicleError
from .filters import is_uniform, low_pass, smoothed, too_coarse
from .frames import CORNERS, GRAVITY
from .recording_checks import check_recording
from .vehicle import Vehicle

Array = NDArray[np.float64]

WHEEL_CHANNELS = tuple(f"wheel.{corner}.z" for corner in CORNERS)
INPUT_CHANNELS = (*WHEEL_CHANNELS, "chassis.a_x")
OUTPUT_CHANNELS = ("chassis.z", "chassis.pitch", "chassis.roll")
"""What the rims mode returns, in the order of its last axis."""

SHORTEST = 0.2
"""A record must last this long, s: the reflected ends of the 20 Hz filter need it."""

FEWEST_SAMPLES = 10

COARSEST = 0.1
"""Mean time between samples up to which body motion of 1 to 3 Hz is seen at all, s."""

LONGEST_GAP = 1.0
"""A pause in a record beyond which nothing is known of the wheels, s."""

BRAKING_CUTOFF = 1.0
BRAKING_MARGIN = 0.5
BRAKING_LASTS = 0.5
BRAKING_RAMP = 0.1
START_WINDOW = 0.2


@dataclass(frozen=True, slots=True)
class RimsSettings:
    """How a recording is prepared; carried into every result.

    a_x_cutoff_hz, rim_cutoff_hz : zero-phase low-pass of a_x and of the wheels; None for none
    output_cutoff_hz : low-pass of z, pitch and roll, applied to the model and to the measurement
    start : "equilibrium" (static under the first wheel displacements, at rest) or "measured"
    braking_intervals : (begin, end) in s where the car brakes; None to find them in a_x
    step : longest integration step, s
    """

    a_x_cutoff_hz: float | None = 20.0
    rim_cutoff_hz: float | None = None
    output_cutoff_hz: float | None = None
    start: str = "equilibrium"
    braking_intervals: tuple[tuple[float, float], ...] | None = None
    step: float = 0.005

    def __post_init__(self) -> None:
        """Refuse settings that mean nothing."""
        for name in ("a_x_cutoff_hz", "rim_cutoff_hz", "output_cutoff_hz"):
            cutoff = getattr(self, name)
            if cutoff is not None and not 0.0 < cutoff < math.inf:
                raise SimulationError(f"{name} is {cutoff}; give a positive frequency or none.")
        if self.start not in ("equilibrium", "measured"):
            raise SimulationError(
                f'start is "{self.start}"; it can be "equilibrium" or "measured".'
            )
        if not 0.0 < self.step <= 0.02:
            raise SimulationError(f"step is {self.step} s; give a step of at most 0.02 s.")
        for begin, end in self.braking_intervals or ():
            if not begin < end:
                raise SimulationError(
                    f"Braking from {begin} s to {end} s: the end must come after the begin."
                )


@dataclass(frozen=True, slots=True)
class RimsInputs:
    """What the rims kernel consumes.

    name : the run's, for messages
    time : (samples,) the run's own times, s
    node_time : (steps + 1,) ends of the integration steps, s
    stage_inputs : (steps, 3, 15) at begin, middle and end of each step:
        u (4), u' (4), u'' (4), a_x, v_x, b
    start_state : (6,) z, pitch, roll and their rates, or None for static equilibrium
    sample_step : (samples,) the step in which each sample lies
    sample_fraction : (samples,) where in that step, 0 to 1
    on_nodes : whether every sample coincides with a node
    warnings : sentences about the recording
    """

    name: str
    time: Array
    node_time: Array
    stage_inputs: Array
    start_state: Array | None
    sample_step: NDArray[np.int64]
    sample_fraction: Array
    on_nodes: bool
    warnings: tuple[str, ...] = ()

    @property
    def sample_node(self) -> NDArray[np.int64]:
        """(samples,) the node nearest to each sample."""
        return self.sample_step + np.rint(self.sample_fraction).astype(np.int64)

    def at_samples(self, values: Array, rates: Array) -> Array:
        """Nodal values (..., steps + 1, k) carried to the samples: (..., samples, k).

        On step [t0, t1] of length h with s = (t - t0) / h, cubic Hermite:
            y = (1 - s)^2 (1 + 2 s) y0 + s^2 (3 - 2 s) y1 + h s (1 - s) ((1 - s) y0' - s y1')
        """
        if self.on_nodes:
            return values[..., self.sample_node, :]
        begin, end = self.sample_step, self.sample_step + 1
        h = (self.node_time[1] - self.node_time[0]) * np.ones((len(begin), 1))
        s = self.sample_fraction[:, np.newaxis]
        return (
            (1 - s) ** 2 * (1 + 2 * s) * values[..., begin, :]
            + s**2 * (3 - 2 * s) * values[..., end, :]
            + h * s * (1 - s) * ((1 - s) * rates[..., begin, :] - s * rates[..., end, :])
        )


def prepare(run: Run, vehicle: Vehicle, settings: RimsSettings | None = None) -> RimsInputs:
    """Inputs of the rims mode for one run.

    The vehicle matters only for the braking weight (its brakes and rolling resistance).
    Raises MeasurementError when a channel is missing or the run is too short, VehicleError when
    braking is marked for a vehicle without brakes.
    """
    settings = settings or RimsSettings()
    _require(run)
    time = run.time
    nodes = _node_times(time, settings.step)
    stages = np.linspace(nodes[0], nodes[-1], 2 * len(nodes) - 1)

    wheel_z = np.column_stack([run[name] for name in WHEEL_CHANNELS])
    wheels = CubicSpline(time, smoothed(time, wheel_z, settings.rim_cutoff_hz))
    a_x = smoothed(time, run["chassis.a_x"], settings.a_x_cutoff_hz)
    acceleration = CubicSpline(time, a_x)
    speed = (
        CubicSpline(time, run["chassis.v_x"])
        if "chassis.v_x" in run
        else acceleration.antiderivative()
    )
    intervals = find_braking(time, a_x, _rolling_share(vehicle))
    warnings = [*run.warnings, *_sampling_warnings(run, settings), *check_recording(run)]
    if vehicle.brakes is None:
        if settings.braking_intervals:
            raise VehicleError(
                f"Braking is marked in run {run.name}, but the vehicle has no brakes; add "
                '"brakes": {"front_share": 0.65} with its own share to the vehicle.'
            )
        if intervals:
            begin, end = intervals[0]
            warnings.append(
                f"Run {run.name} brakes from {begin:.1f} to {end:.1f} s, but the vehicle has no "
                "brakes, so the force is taken to act on the driven wheels; add "
                '"brakes": {"front_share": ...} to the vehicle.'
            )
        intervals = []
    elif settings.braking_intervals is not None:
        intervals = list(settings.braking_intervals)

    columns = np.column_stack(
        [
            wheels(stages),
            wheels(stages, 1),
            wheels(stages, 2),
            acceleration(stages),
            speed(stages),
            braking_weight(stages, intervals),
        ]
    )
    step, fraction = _locate(time, nodes)
    return RimsInputs(
        name=run.name,
        time=time,
        node_time=nodes,
        stage_inputs=np.stack([columns[:-2:2], columns[1::2], columns[2::2]], axis=1),
        start_state=_measured_start(run) if settings.start == "measured" else None,
        sample_step=step,
        sample_fraction=fraction,
        on_nodes=bool(np.all(np.minimum(fraction, 1.0 - fraction) < 1e-6)),
        warnings=tuple(warnings),
    )


def find_braking(time: Array, a_x: Array, rolling_share: float) -> list[tuple[float, float]]:
    """Intervals (begin, end), s, where the car brakes; step 4 of the module's list.

    rolling_share : rolling resistance coefficient fr of the whole car
    """
    level = -(rolling_share * GRAVITY + BRAKING_MARGIN)
    below = low_pass(time, a_x, BRAKING_CUTOFF) < level
    edges = np.flatnonzero(np.diff(np.concatenate([[False], below, [False]]).astype(int)))
    spans = [(time[first], time[last - 1]) for first, last in edges.reshape(-1, 2)]
    return [(float(begin), float(end)) for begin, end in spans if end - begin >= BRAKING_LASTS]


def braking_weight(time: Array, intervals: Sequence[tuple[float, float]]) -> Array:
    """b(t): 1 inside each (begin, end), 0 outside, linear over 0.1 s just outside its ends."""
    weight = np.zeros_like(time)
    for begin, end in intervals:
        inside = 1.0 + np.minimum(time - begin, end - time) / BRAKING_RAMP
        weight = np.maximum(weight, np.clip(inside, 0.0, 1.0))
    return weight


def filtered_outputs(run: Run, cutoff: float | None) -> dict[str, Array]:
    """The run's z, pitch and roll, those there are, through the output filter."""
    return {name: smoothed(run.time, run[name], cutoff) for name in OUTPUT_CHANNELS if name in run}


def _require(run: Run) -> None:
    missing = [name for name in INPUT_CHANNELS if name not in run]
    if missing:
        raise MeasurementError(
            f"Run {run.name} lacks {', '.join(missing)}; the rims mode needs "
            "time, the four wheel.*.z and chassis.a_x."
        )
    for name in INPUT_CHANNELS:
        if not np.all(np.isfinite(run[name])):
            raise MeasurementError(
                f"Run {run.name} has gaps (not a number) in {name}; cut the record there."
            )
    lasts = run.time[-1] - run.time[0] if len(run.time) else 0.0
    if len(run.time) < FEWEST_SAMPLES or lasts < SHORTEST:
        raise MeasurementError(
            f"Run {run.name} has {len(run.time)} samples over {lasts:.3g} s; at least "
            f"{FEWEST_SAMPLES} samples over {SHORTEST} s are needed."
        )
    steps = np.diff(run.time)
    if np.median(steps) > COARSEST:
        raise MeasurementError(
            f"Run {run.name} has a sample every {np.median(steps):.3g} s; at least one every "
            f"{COARSEST} s is needed. Is its time in ms under a header that says s?"
        )
    widest = int(np.argmax(steps))
    if steps[widest] > LONGEST_GAP:
        raise MeasurementError(
            f"Run {run.name} pauses between {run.time[widest]:.2f} and "
            f"{run.time[widest + 1]:.2f} s; cut it there and give the parts as runs of their own."
        )


def _node_times(time: Array, longest: float) -> Array:
    """Uniform nodes over the record, on the samples wherever the sampling allows it."""
    lasts = time[-1] - time[0]
    intervals = len(time) - 1
    steps = math.ceil(lasts / longest - 1e-6)
    if is_uniform(time) and lasts / intervals > longest:
        steps = intervals * math.ceil(lasts / intervals / longest - 1e-6)
    return np.linspace(time[0], time[-1], steps + 1)


def _locate(time: Array, nodes: Array) -> tuple[NDArray[np.int64], Array]:
    """The step in which each time lies, and the fraction of the step before it."""
    position = (time - nodes[0]) / (nodes[1] - nodes[0])
    step = np.clip(np.floor(position).astype(np.int64), 0, len(nodes) - 2)
    return step, np.clip(position - step, 0.0, 1.0)


def _sampling_warnings(run: Run, settings: RimsSettings) -> list[str]:
    step = float(run.time[-1] - run.time[0]) / (len(run.time) - 1)
    filters = {
        "chassis.a_x": settings.a_x_cutoff_hz,
        "wheel.*.z": settings.rim_cutoff_hz,
        "chassis.z, .pitch and .roll": settings.output_cutoff_hz,
    }
    return [
        f"Run {run.name} is sampled every {1000 * step:.3g} ms, too coarse for the {cutoff:g} Hz "
        f"low-pass of {channel}, which is left out."
        for channel, cutoff in filters.items()
        if cutoff is not None and too_coarse(step, cutoff)
    ]


def _rolling_share(vehicle: Vehicle) -> float:
    """Rolling resistance of the whole car over its weight: fr, wheels weighted by their load."""
    load = static_loads(vehicle).tyre_load
    resistance = sum(
        load[corner] * vehicle.axle_at(corner).tyre.rolling_resistance for corner in CORNERS
    )
    return resistance / sum(load.values())


def _measured_start(run: Run) -> Array:
    """z, pitch, roll and their rates at the first sample, from a cubic through the first 0.2 s."""
    missing = [name for name in OUTPUT_CHANNELS if name not in run]
    if missing:
        raise MeasurementError(
            f"Run {run.name} lacks {', '.join(missing)}; a measured start needs all three of "
            "chassis.z, .pitch and .roll, so start from equilibrium instead."
        )
    first = np.flatnonzero(run.time - run.time[0] <= START_WINDOW)
    first = first if len(first) >= FEWEST_SAMPLES else np.arange(FEWEST_SAMPLES)
    since = run.time[first] - run.time[0]
    states = np.column_stack([run[name][first] for name in OUTPUT_CHANNELS])
    cubic = np.polynomial.polynomial.polyfit(since, states, 3)
    return np.concatenate([cubic[0], cubic[1]])
