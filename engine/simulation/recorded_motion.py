"""From a recording to the motion that it prescribes in rims mode, whichever car follows it.

The four wheel centres' vertical displacement u_i(t) and the chassis's acceleration a_x(t) are
prescribed. The integrator needs u, u', u'', a_x and the speed v_x at the begin, middle and end of
each of its steps; this module makes them, in this order:

1. Wheel channels, zero-phase low-pass at `rim_cutoff_hz` (50 Hz by default), then one C2 cubic
   spline per channel through the samples; u' and u'' are its derivatives. Without the filter the
   noise of a record at 1 kHz (0.5 mm) would be accelerations of 1000 m/s2.
2. a_x, zero-phase low-pass at `a_x_cutoff_hz` (20 Hz by default), then a C2 cubic spline.
3. v_x from the file's `chassis.v_x`, else the integral of a_x, raised by as much as it takes to
   stay above zero: only the sense of rolling resistance depends on it.

The filter is `filters.low_pass`. Nodes are uniform over the record, their step the longest that
divides it and does not exceed `step`.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly

from ..channels import INPUT_CHANNELS, WHEEL_CHANNELS, conditioned_first
from ..errors import MeasurementError
from ..filters import PAD_PERIODS, is_uniform, resolved, smoothed, too_coarse
from ..known_band import lowest_known, output_highpass
from ..run import Run
from .braking import slow_acceleration
from .initial_state import measured_state
from .recording_checks import Finding, check_recording, stands
from .rims_settings import RimsSettings
from .wheel_order import wheel_rises

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


@dataclass(frozen=True, slots=True, eq=False)
class RecordedMotion:
    """What a run prescribes, made once for all the cars that follow it.

    settings : how it was made
    node_time : (steps + 1,) ends of the integration steps, s
    stage_inputs : (steps, 3, 15) at begin, middle and end of each step:
        u (4), u' (4), u'' (4), a_x, v_x, and the braking weight b of a car that does not brake, 0
    start_state : (6,) z, pitch, roll and their rates, or None for static equilibrium
    sample_step : (samples,) the step in which each sample lies
    sample_fraction : (samples,) where in that step, 0 to 1
    slow_a_x : (samples,) what shows braking
    wheel_rises : what shows wheels in each other's columns
    stands : whether the car stands at the start
    findings, doubts : what is seen wrong with the recording, and what was left out or guessed
    """

    run: Run
    settings: RimsSettings
    node_time: Array
    stage_inputs: Array
    start_state: Array | None
    sample_step: NDArray[np.int64]
    sample_fraction: Array
    slow_a_x: Array
    wheel_rises: Array | None
    stands: bool
    findings: tuple[Finding, ...]
    doubts: tuple[str, ...]


def recorded_motion(run: Run, settings: RimsSettings) -> RecordedMotion:
    """The motion that one run prescribes.

    Raises MeasurementError when a channel is missing or the run is too short.
    """
    _require(run, settings)
    time = run.time
    nodes = _node_times(time, settings.step)
    stages = np.linspace(nodes[0], nodes[-1], 2 * len(nodes) - 1)

    wheel_z = np.column_stack([run[name] for name in WHEEL_CHANNELS])
    wheels = CubicSpline(time, smoothed(time, wheel_z, settings.rim_cutoff_hz))
    a_x = smoothed(time, run["chassis.a_x"], settings.a_x_cutoff_hz)
    acceleration = CubicSpline(time, a_x)
    speed, unknown_start = _speed(run, acceleration)
    columns = np.column_stack(
        [
            wheels(stages),
            wheels(stages, 1),
            wheels(stages, 2),
            acceleration(stages),
            speed(stages),
            np.zeros_like(stages),
        ]
    )
    step, fraction = _locate(time, nodes)
    return RecordedMotion(
        run=run,
        settings=settings,
        node_time=nodes,
        stage_inputs=np.stack([columns[:-2:2], columns[1::2], columns[2::2]], axis=1),
        start_state=measured_state(run) if settings.initial_state == "measured" else None,
        sample_step=step,
        sample_fraction=fraction,
        slow_a_x=slow_acceleration(time, a_x),
        wheel_rises=wheel_rises(run),
        stands=stands(run),
        findings=tuple(check_recording(run)),
        doubts=(
            *_sampling_warnings(run, settings),
            *_compared_below_band(run, settings),
            *_doubtful_conditioning(run),
            *unknown_start,
        ),
    )


def _require(run: Run, settings: RimsSettings) -> None:
    missing = [name for name in INPUT_CHANNELS if name not in run]
    if missing:
        raise MeasurementError(
            f"Run {run.name} lacks {', '.join(missing)}; the rims mode needs "
            f"time, the four wheel.*.z and chassis.a_x{conditioned_first(run.columns)}."
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
    low = settings.output_highpass_hz
    if low is not None and not resolved(run.time, low):
        raise MeasurementError(
            f"Run {run.name} lasts {lasts:.3g} s, too short for an output_highpass_hz of {low:g}: "
            f"that takes {PAD_PERIODS / low:.3g} s; raise it, or leave it out."
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


def _doubtful_conditioning(run: Run) -> list[str]:
    """What the steps that made the channels say of them."""
    return [
        f"Run {run.name}, conditioning, {record.step['kind']}: {warning}"
        for record in run.conditioning
        for warning in record.warnings
    ]


def _compared_below_band(run: Run, settings: RimsSettings) -> list[str]:
    """A warning where conditioning left nothing of a channel at frequencies that are compared."""
    banded = lowest_known(run)
    if not banded or (settings.output_highpass_hz or 0.0) >= max(banded.values()):
        return []
    low = max(banded.values())
    return [
        f"Run {run.name} has {', '.join(banded)} from {low:g} Hz up alone, and z, pitch and roll "
        "are compared below as well; set output_highpass_hz to "
        f"{output_highpass(run):g}, at least to {low:g}."
    ]
