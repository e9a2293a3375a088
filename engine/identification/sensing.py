"""What a sensor reads of a true motion, and the motion behind what it read.

    reading(t) = gain true(t - delay) + bias

as `sensors` has it, the sign in the gain. A history is moved in time along its C2 cubic spline.
Beyond its ends a model goes on along its tangent, which is level where it begins in equilibrium; a
recording, whose slope is noise, keeps its last value.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ..channels import INPUT_CHANNELS, WHEEL_CHANNELS
from ..errors import MeasurementError
from ..run import Run
from ..simulation.rims import RimsInputs

Array = NDArray[np.float64]

A_X = 12
"""Place of a_x among the stage inputs; before it u, u' and u'' of the wheels."""


@dataclass(frozen=True, slots=True)
class Reading:
    """A sensor's gain with its sign, bias (SI) and delay (s); an ideal one unless told."""

    gain: float = 1.0
    bias: float = 0.0
    delay: float = 0.0

    def beyond(self, other: "Reading") -> "Reading":
        """What is left of this one in a record that was corrected by another."""
        return Reading(
            self.gain / other.gain,
            (self.bias - other.bias) / other.gain,
            self.delay - other.delay,
        )


IDEAL = Reading()


def delayed(time: Array, histories: Array, delay: float) -> tuple[Array, Array]:
    """A model's histories (..., samples) at t - delay, and their rates there."""
    spline = CubicSpline(time, histories, axis=-1)
    at = time - delay
    inside = np.clip(at, time[0], time[-1])
    rates = spline(inside, 1)
    return spline(inside) + rates * (at - inside), rates


def sensed(time: Array, histories: Array, readings: Sequence[Reading]) -> Array:
    """What the sensors of many cars read of their histories (cars, samples), one reading each."""
    gains, biases, delays = (
        np.array([getattr(one, name) for one in readings]) for name in ("gain", "bias", "delay")
    )
    late = histories.copy()
    for delay in np.unique(delays[delays != 0.0]):
        late[delays == delay] = delayed(time, histories[delays == delay], float(delay))[0]
    return gains[:, np.newaxis] * late + biases[:, np.newaxis]


def reading_slope(time: Array, history: Array, reading: Reading, quantity: str) -> Array:
    """d reading / d quantity (samples,) of a model's history: of its "gain", "bias" or "delay"."""
    if quantity == "bias":
        return np.ones_like(history)
    late, rates = delayed(time, history, reading.delay)
    if quantity == "delay":
        return -reading.gain * rates
    return late * np.copysign(1.0, reading.gain)


def where_driven(run: Run, readings: Mapping[str, Reading]) -> Run:
    """The part of a record at whose every sample each of the delayed inputs was read.

    Raises MeasurementError where hardly anything is left.
    """
    delays = [readings[name].delay for name in INPUT_CHANNELS if name in readings]
    begin = run.time[0] - min([0.0, *delays])
    end = run.time[-1] - max([0.0, *delays])
    # Times come out of text files and are rounded there.
    kept = (run.time >= begin - 1e-9) & (run.time <= end + 1e-9)
    if kept.all():
        return run
    if np.count_nonzero(kept) < 2:
        raise MeasurementError(
            f"Run {run.name} lasts {run.duration:.3g} s, less than the delays of its sensors take "
            "off its ends; give a longer run or correct the delays."
        )
    channels = {name: run[name][kept] for name in run.columns}
    return replace(run, time=run.time[kept], channels=channels)


def corrected(run: Run, readings: Mapping[str, Reading]) -> Run:
    """The motion behind what was read, at those times at which the inputs are known.

    readings : by channel; those that the run lacks do not count
    """
    told = {name: one for name, one in readings.items() if name in run and one != IDEAL}
    if not told:
        return run
    part = where_driven(run, told)
    channels = {name: part[name] for name in part.columns}
    noise = dict(part.noise)
    for name, one in told.items():
        values = part[name]
        if one.delay:
            at = np.clip(part.time + one.delay, run.time[0], run.time[-1])
            values = CubicSpline(run.time, run[name])(at)
        channels[name] = (values - one.bias) / one.gain
        if name in noise:
            noise[name] /= abs(one.gain)
    return replace(part, channels=channels, noise=noise)


def driven(inputs: RimsInputs, readings: Mapping[str, Reading]) -> RimsInputs:
    """Prepared inputs as they would be had the readings of wheels and a_x been corrected before.

    That is exact for gain and bias, since all that makes inputs is linear and leaves a constant as
    it is. Braking, the speed and the initial state stay as they were found.
    """
    stages = inputs.stage_inputs.copy()
    for corner, name in enumerate(WHEEL_CHANNELS):
        one = readings.get(name, IDEAL)
        stages[:, :, corner] -= one.bias
        stages[:, :, corner : 3 * 4 : 4] /= one.gain
    one = readings.get("chassis.a_x", IDEAL)
    if one.delay:
        begin, end = inputs.node_time[:-1], inputs.node_time[1:]
        times = np.stack([begin, 0.5 * (begin + end), end], axis=1)
        known = np.append(stages[:, :2, A_X].ravel(), stages[-1, 2, A_X])
        spline = CubicSpline(np.append(times[:, :2].ravel(), times[-1, 2]), known)
        stages[:, :, A_X] = spline(np.clip(times + one.delay, times[0, 0], times[-1, 2]))
    stages[:, :, A_X] = (stages[:, :, A_X] - one.bias) / one.gain
    return replace(inputs, stage_inputs=stages)
