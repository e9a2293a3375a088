"""From a recorded motion to what drives one car in rims mode.

`recorded_motion` makes what a recording prescribes to every car; what is left depends on the car
that follows it: the braking weight b(t) of `braking` (its brakes and rolling resistance), and
checks of the order of the wheels (its wheelbase) and of the rest of the body on them (its tracks).

Where the samples do not fall on nodes, the model's z, pitch and roll are carried to them by cubic
Hermite interpolation from their values and rates.
"""

from collections.abc import Set as AbstractSet
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..channels import OUTPUT_CHANNELS
from ..demand import rolling_resistance
from ..filters import Band, in_band
from ..run import Run
from ..step_record import StepRecord
from ..vehicle import Vehicle
from .braking import Interval, braking_of, braking_weight
from .recorded_motion import RecordedMotion, recorded_motion
from .recording_checks import check_on_car
from .rims_settings import RimsSettings

Array = NDArray[np.float64]


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
    conditioning : what made the recording's channels
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
    conditioning: tuple[StepRecord, ...] = ()
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

    @property
    def seen_nodes(self) -> NDArray[np.int64] | slice:
        """The nodes that are samples; every node where none is left out or samples lie between."""
        if self.on_nodes and len(self.time) < len(self.node_time):
            return self.sample_node
        return slice(None)

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


def prepare(
    run: Run,
    vehicle: Vehicle,
    settings: RimsSettings | None = None,
    *,
    unzeroed: AbstractSet[str] = frozenset(),
) -> RimsInputs:
    """Inputs of the rims mode for one run and one car; raises what its two parts do.

    unzeroed : channels whose rest values are to be found
    """
    return for_car(recorded_motion(run, settings or RimsSettings()), vehicle, unzeroed)


def for_car(
    motion: RecordedMotion, vehicle: Vehicle, unzeroed: AbstractSet[str] = frozenset()
) -> RimsInputs:
    """Inputs of the rims mode for a car that follows a recorded motion.

    unzeroed : channels whose rest values are to be found
    Raises MeasurementError when braking is marked outside the run, VehicleError when it is marked
    for a vehicle without brakes.
    """
    run, fraction = motion.run, motion.sample_fraction
    intervals, unbraked = braking_of(run, motion.slow_a_x, vehicle, rolling_resistance(vehicle))
    on_car = check_on_car(run, motion.stands, motion.wheel_rises, vehicle, unzeroed)
    findings = (*motion.findings, *on_car)
    told = (finding.sentence for finding in findings)
    return RimsInputs(
        name=run.name,
        time=run.time,
        node_time=motion.node_time,
        stage_inputs=_braked(motion, intervals),
        start_state=motion.start_state,
        sample_step=motion.sample_step,
        sample_fraction=fraction,
        on_nodes=bool(np.all(np.minimum(fraction, 1.0 - fraction) < 1e-6)),
        braking=tuple(intervals),
        stands=motion.stands,
        conditioning=run.conditioning,
        warnings=tuple(dict.fromkeys([*run.warnings, *told, *motion.doubts, *unbraked])),
        faults=(*(finding.sentence for finding in findings if finding.fault), *unbraked),
    )


def _braked(motion: RecordedMotion, intervals: list[Interval]) -> Array:
    """The motion's stage inputs with the braking weight of some intervals."""
    if not intervals:
        return motion.stage_inputs
    begin, end = motion.node_time[:-1], motion.node_time[1:]
    stages = np.stack([begin, 0.5 * (begin + end), end], axis=1)
    braked = motion.stage_inputs.copy()
    braked[:, :, 14] = braking_weight(stages, intervals)
    return braked


def filtered_outputs(run: Run, band: Band) -> dict[str, Array]:
    """The run's z, pitch and roll, those there are, between the frequencies of `band`."""
    return {name: in_band(run.time, run[name], band) for name in OUTPUT_CHANNELS if name in run}
