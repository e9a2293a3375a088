"""Virtual sensors: what the instruments of a test car make of its true motion.

    y_k = gain x_f(t_k - delay) + bias + noise_k,        t_k = k / rate

x_f is the true channel behind the sensor's anti-alias filter, a causal Butterworth low-pass of
order ANTIALIAS_ORDER, or the channel itself without one; before the start it has the first value.
noise_k is white and Gaussian. What is read is the nearest multiple of the sensor's resolution,
where it has one. A sensor slower than the recording holds each value until its next one, as a
logger on a bus does.

Every channel of every run draws from a stream of its own, so that a channel's noise does not depend
on which others are noisy, nor on which runs are driven.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated
from zlib import crc32

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfilt, sosfilt_zi

from .channels import CHANNELS, SMALLEST_NOISE, channel
from .frames import CORNERS
from .run import Run
from .units import to_si
from .vehicle import Range

Array = NDArray[np.float64]

RATE = 200.0
"""Samples of a recording a second, unless told."""

ANTIALIAS_ORDER = 4

RECORDED = (
    "chassis.z",
    "chassis.pitch",
    "chassis.roll",
    "chassis.a_x",
    "chassis.v_x",
    *(f"wheel.{corner}.z" for corner in CORNERS),
    *(f"suspension.{corner}.travel" for corner in CORNERS),
    "seat.driver.a_z",
)
"""What a test car records, besides the time, unless told: gyros, speed and longitudinal
acceleration, rim centres, string potentiometers, an accelerometer at the driver's seat."""

_SAME_INSTANT = 1e-9


@dataclass(frozen=True, slots=True)
class Sensor:
    """How one channel is measured; ideal unless told.

    unit : of its numbers here and in the files, None for the channel's SI unit
    noise : standard deviation;  bias;  resolution : smallest step of a reading, 0 for none
    rate_hz : samples a second, None for as many as the recording
    cutoff_hz : of the anti-alias filter, None for none
    """

    unit: str | None = None
    noise: Annotated[float, Range("1", 0.0, 1e6)] = 0.0
    bias: Annotated[float, Range("1", -1e6, 1e6)] = 0.0
    resolution: Annotated[float, Range("1", 0.0, 1e6)] = 0.0
    gain: Annotated[float, Range("1", -1e3, 1e3, apart=1e-3)] = 1.0
    delay: Annotated[float, Range("s", 0.0, 10.0)] = 0.0
    rate_hz: Annotated[float, Range("Hz", 0.1, 1e5)] | None = None
    cutoff_hz: Annotated[float, Range("Hz", 0.1, 5e4)] | None = None

    def si_factor(self, name: str) -> float:
        """SI units in one of its own, as the sensor of a channel; UnitError for what is none."""
        return 1.0 if self.unit is None else to_si(self.unit, channel(name).unit)[0]


def _ideal() -> dict[str, Sensor]:
    return {name: Sensor() for name in RECORDED}


@dataclass(frozen=True, slots=True)
class SensorSet:
    """The instruments of a test car.

    rate_hz : samples of the recording a second
    sensors : by the channel that they measure
    points : chassis points with accelerometers besides the car's own, from the sprung mass's CG, m
    source : heads every message
    """

    rate_hz: float = RATE
    sensors: Mapping[str, Sensor] = field(default_factory=_ideal)
    points: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    source: str = "sensors"

    def samples(self, duration: float) -> int:
        """How many samples a recording of so many seconds has, the first at its beginning."""
        return int(np.floor(duration * self.rate_hz + _SAME_INSTANT)) + 1

    def noise(self) -> dict[str, float]:
        """Standard deviation by channel in SI, of those whose noise is any worth stating."""
        stated = {name: one.noise * one.si_factor(name) for name, one in self.sensors.items()}
        return {name: noise for name, noise in stated.items() if noise >= SMALLEST_NOISE}

    def units(self) -> dict[str, str]:
        """Unit by channel, of those with one of their own."""
        return {
            name: " ".join(one.unit.split())
            for name, one in self.sensors.items()
            if one.unit is not None
        }


def measured(true: Run, sensors: SensorSet, seed: int, stream: int) -> Run:
    """What the sensors record of a run.

    true : sampled at least as often as the fastest sensor, and long enough for two samples
    stream : which run it is among those of one seed
    """
    time = np.arange(sensors.samples(true.duration)) / sensors.rate_hz
    channels = {
        name: _readings(true, name, sensor, time, sensors.rate_hz, _random(seed, stream, name))
        for name, sensor in sensors.sensors.items()
    }
    return Run(true.name, time, channels, sensors.noise())


def _readings(
    true: Run,
    name: str,
    sensor: Sensor,
    time: Array,
    recording_rate: float,
    random: np.random.Generator,
) -> Array:
    """One channel of the recording, at its times."""
    rate = sensor.rate_hz or recording_rate
    tick = np.floor(time * rate + _SAME_INSTANT).astype(np.int64)
    instants = np.arange(tick[-1] + 1) / rate
    filtered = _antialiased(true.time, true[name], sensor.cutoff_hz)
    begin = true.time[0]
    seen = np.clip(begin + instants - sensor.delay, begin, true.time[-1])
    values = sensor.gain * CubicSpline(true.time, filtered)(seen)
    factor = sensor.si_factor(name)
    values += factor * (sensor.bias + sensor.noise * random.standard_normal(instants.size))
    if step := factor * sensor.resolution:
        values = step * np.round(values / step) + 0.0  # no -0
    return values[tick]


def _antialiased(time: Array, values: Array, cutoff: float | None) -> Array:
    """A true channel behind the sensor's filter, which has settled on the first value."""
    if cutoff is None:
        return values
    rate = (time.size - 1) / (time[-1] - time[0])
    sections = butter(ANTIALIAS_ORDER, cutoff, fs=rate, output="sos")
    return sosfilt(sections, values, zi=values[0] * sosfilt_zi(sections))[0]


def _random(seed: int, stream: int, name: str) -> np.random.Generator:
    number = _NUMBERS.get(name, crc32(name.encode()))
    return np.random.default_rng([seed, stream, number])


_NUMBERS = {name: number for number, name in enumerate(name for name in CHANNELS if name != "time")}
"""Of each channel's stream; those of chassis points, of which there is no list, follow the name."""
