"""From a recording to what drives the model in rims mode.

The four wheel centres' vertical displacement u_i(t) and the chassis's acceleration a_x(t) are
prescribed. The integrator needs u, u', u'', a_x, the speed v_x and the braking weight b at the
begin, middle and end of each of its steps; this module makes them, in this order:

1. Wheel channels, zero-phase low-pass at `rim_cutoff_hz` (50 Hz by default), then one C2 cubic
   spline per channel through the samples; u' and u'' are its derivatives. Without the filter the
   noise of a record at 1 kHz (0.5 mm) would be accelerations of 1000 m/s2.
2. a_x, zero-phase low-pass at `a_x_cutoff_hz` (20 Hz by default), then a C2 cubic spline.
3. v_x from the file's `chassis.v_x`, else the integral of a_x, raised by as much as it takes to
   stay above zero: only the sense of rolling resistance depends on it.
4. The braking weight b(t) of `braking`.

The filter is `filters.low_pass`. Nodes are uniform over the record, their step the longest that
divides it and does not exceed `step`. Where the samples do not fall on nodes, the model's z, pitch
and roll are carried to them by cubic Hermite interpolation from their values and rates.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly

from .braking import Interval, braking_of, braking_weight
from .channels import INPUT_CHANNELS, OUTPUT_CHANNELS, WHEEL_CHANNELS, Run
from .demand import rolling_resistance
from .errors import MeasurementError
from .filters import is_uniform, smoothed, too_coarse
from .initial_state import measured_state
from .recording_checks import check_recording, stands
from .rims_settings import RimsSettings
from .vehicle import Vehicle

Array = NDArray[np.float64]

SHORTEST = 0.2
"""A record must last this long, s: the reflected ends of the 20 Hz filter need it."""

FEWEST_SAMPLES = 10

COARSEST = 0.1
"""Mean time between samples up to which body motion of 1 to 3 Hz is seen at all, s."""

LONGEST_GAP = 1.0
"""A pause in a record beyond which nothing is known of the wheels, s."""

FAST = 1.0
"""Speed that a_x must have taken away for a start in motion to be told of, m/s."""


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
    braking : (begin, end) where the car is taken to brake, s
    stands : whether it stands at the start
    warnings : sentences about the recording
    faults : those of them that say that what drives the model is wrong
    """

    name: str
    time: Array
    node_time: Array
    stage_inputs: Array
    start_state: Array | None
    sample_step: NDArray[np.int64]
    sample_fraction: Array
    on_nodes: bool
    braking: tuple[Interval, ...] = ()
    stands: bool = False
    warnings: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()

    @property
    def step(self) -> float:
        """Longest integration step, s."""
        return float(np.diff(self.node_time).max())

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

    The vehicle matters for the braking weight (its brakes and rolling resistance) and for the order
    of the wheels (its wheelbase) and the rest of the body on them (its tracks).
    Raises MeasurementError when a channel is missing, the run is too short or braking is marked
    outside it, VehicleError when braking is marked for a vehicle without brakes.
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
    speed, unknown_start = _speed(run, acceleration)
    intervals, unbraked = braking_of(run, a_x, vehicle, rolling_resistance(vehicle))
    measured = settings.initial_state == "measured"
    findings = check_recording(run, vehicle)
    warnings = [
        *run.warnings,
        *_sampling_warnings(run, settings),
        *(finding.sentence for finding in findings),
        *unknown_start,
        *unbraked,
    ]

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
        start_state=measured_state(run) if measured else None,
        sample_step=step,
        sample_fraction=fraction,
        on_nodes=bool(np.all(np.minimum(fraction, 1.0 - fraction) < 1e-6)),
        braking=tuple(intervals),
        stands=stands(run),
        warnings=tuple(dict.fromkeys(warnings)),
        faults=(*(finding.sentence for finding in findings if finding.fault), *unbraked),
    )


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
    for name in (*INPUT_CHANNELS, "chassis.v_x"):
        if name in run and not np.all(np.isfinite(run[name])):
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


def _speed(run: Run, acceleration: CubicSpline) -> tuple[PPoly, list[str]]:
    """v_x as a function of time, m/s, and a warning where it is a guess."""
    if "chassis.v_x" in run:
        return CubicSpline(run.time, run["chassis.v_x"]), []
    gained = acceleration.antiderivative()
    lost = max(0.0, -float(gained(run.time).min()))
    gained.c[-1] += lost
    if lost < FAST:
        return gained, []
    return gained, [
        f"Run {run.name} has no chassis.v_x, and by its chassis.a_x it slows down by "
        f"{lost:.1f} m/s from its start; it is taken to start with that speed, which only the "
        "sense of rolling resistance depends on. Add chassis.v_x if you have it."
    ]


def _sampling_warnings(run: Run, settings: RimsSettings) -> list[str]:
    """Filters that are left out. Wheels so coarsely sampled have nothing above the cutoff."""
    step = float(run.time[-1] - run.time[0]) / (len(run.time) - 1)
    filters = {
        "chassis.a_x": settings.a_x_cutoff_hz,
        "chassis.z, .pitch and .roll": settings.output_cutoff_hz,
    }
    return [
        f"Run {run.name} is sampled every {1000 * step:.3g} ms, too coarse for the {cutoff:g} Hz "
        f"low-pass of {channel}, which is left out."
        for channel, cutoff in filters.items()
        if cutoff is not None and too_coarse(step, cutoff)
    ]
