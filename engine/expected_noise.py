"""What the residuals of a run that is not driven yet would look like: spectra by channel.

From runs that were fitted they are those of their residuals (`uncertainty.spectra`), the mean over
the samples: noise of the outputs, noise of the inputs and what the model misses count alike.
Without runs they follow from stated noise. That of z, pitch and roll is white. That of the wheels
and of a_x goes through the car: the reference drive is a level road at constant speed, once
as it is and once with white noise on the five inputs, both through the filters of the rims mode;
the spectra are those of the difference, smoothed as residuals are. The car answers so little noise
linearly, whatever else it does.

Spectra are two-sided and by sample, in units of the channels' noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .car_rows import car_row
from .channels import INPUT_CHANNELS, OUTPUT_CHANNELS, WHEEL_CHANNELS, Run
from .filters import in_band
from .problem import Problem
from .rims import prepare
from .rims_settings import RimsSettings
from .simulation import rims_batch
from .uncertainty import (
    BODY_MEMORY,
    Information,
    RunResiduals,
    bandwidth,
    bread_of,
    effective_samples,
    scatter,
    spectra,
    transform_length,
)
from .vehicle import Vehicle

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

INPUT_NOISE: Mapping[str, float] = {
    **dict.fromkeys(WHEEL_CHANNELS, 0.2e-3),
    "chassis.a_x": 0.05,
}
"""Standard deviation of the noise of what drives the model where nothing else is stated, SI."""

REFERENCE_SECONDS = 120.0
"""Length of the reference drive: 360 degrees of freedom, a variance to 7 %."""

REFERENCE_SPEED = 15.0
"""Of the reference drive, m/s."""


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedNoise:
    """Spectra of the residuals of a run that is not driven yet.

    channels : compared, in order;  noise : their assumed standard deviations, SI
    step : time between samples, s
    width : lags, in samples, over which residuals are correlated
    frequency (f,) : Hz, from 0 to half the sampling rate
    density (channels, channels, f) : in units of the noise
    worth : independent samples in one sample;  freedom : degrees of freedom of M in one sample
    """

    channels: tuple[str, ...]
    noise: Mapping[str, float]
    step: float
    width: float
    frequency: Array
    density: Complex
    worth: float
    freedom: float

    def information(self, root: Array, jacobian: Array) -> Information:
        """What a run says by whose samples the model moves so.

        root : (n, n) triangle of the Jacobian;  jacobian : (channels, samples, n)
        """
        channels, samples, _ = jacobian.shape
        length = transform_length(samples, self.width)
        frequency = _frequencies(length, self.step)
        density = np.array(
            [
                [np.interp(frequency, self.frequency, of_pair) for of_pair in of_channel]
                for of_channel in self.density
            ]
        )
        return Information(
            root,
            scatter(jacobian, density, length),
            self.worth * channels * samples,
            self.freedom * samples,
        )


def noise_of_runs(problem: Problem, runs: Sequence[RunResiduals], root: Array) -> ExpectedNoise:
    """The noise that some fitted runs show.

    runs : residuals of the problem's runs;  root : triangle of all their Jacobians

    A run counts by its samples. The step is that of the slowest; one sampled faster counts as it
    is, which errs on the safe side where its residuals are slow.
    """
    channels = tuple(
        name for name in OUTPUT_CHANNELS if any(name in seen.measured for seen in problem.runs)
    )
    step = max(run.step for run in runs)
    width = max(bandwidth(run.residuals, run.step) * run.step for run in runs) / step
    frequency = _frequencies(max(run.residuals.shape[1] for run in runs), step)
    bread = bread_of(root)[0]
    total = np.zeros((len(channels), len(channels), len(frequency)), dtype=np.complex128)
    samples = np.zeros((len(channels), len(channels), 1))
    noise: dict[str, float] = {}
    worth = freedom = 0.0
    for seen, run in zip(problem.runs, runs, strict=True):
        count, lags = run.residuals.shape[1], bandwidth(run.residuals, run.step)
        known = _frequencies(transform_length(count, lags), run.step)
        density = spectra(run, lags, bread)
        places = [channels.index(name) for name in seen.measured]
        for a, row in zip(places, density, strict=True):
            for b, of_pair in zip(places, row, strict=True):
                total[a, b] += count * np.interp(frequency, known, of_pair)
                samples[a, b] += count
        noise = {**seen.noise, **noise}
        worth += sum(effective_samples(channel, lags) for channel in run.residuals)
        freedom += 3.0 * count / lags
    return ExpectedNoise(
        channels,
        noise,
        step,
        width,
        frequency,
        total / np.maximum(samples, 1.0),
        worth / sum(run.residuals.size for run in runs),
        freedom / sum(run.residuals.shape[1] for run in runs),
    )


def stated_noise(
    vehicle: Vehicle,
    settings: RimsSettings,
    noise: Mapping[str, float],
    *,
    step: float,
    seed: int = 0,
) -> ExpectedNoise:
    """The noise that follows from what is stated of the sensors.

    noise : standard deviation by channel, SI; z, pitch and roll are compared if they have one,
        wheels and a_x are free of noise without
    step : time between samples, s
    """
    channels = tuple(name for name in OUTPUT_CHANNELS if name in noise)
    width = max(BODY_MEMORY / step, 1.0)
    answer = _answer(vehicle, settings, noise, step, seed)
    scaled = np.stack([answer[:, OUTPUT_CHANNELS.index(name)] / noise[name] for name in channels])
    run = RunResiduals(scaled, np.zeros((*scaled.shape, 1)), step)
    density = spectra(run, width, np.zeros((1, 1)))
    density += np.eye(len(channels))[:, :, np.newaxis]
    frequency = _frequencies(transform_length(scaled.shape[1], width), step)
    return ExpectedNoise(
        channels,
        {name: float(noise[name]) for name in channels},
        step,
        width,
        frequency,
        density,
        1.0,
        3.0 / width,
    )


def _answer(
    vehicle: Vehicle,
    settings: RimsSettings,
    noise: Mapping[str, float],
    step: float,
    seed: int,
) -> Array:
    """z, pitch and roll (samples, 3) that noise of the inputs makes on the reference drive."""
    time = step * np.arange(round(REFERENCE_SECONDS / step) + 1, dtype=np.float64)
    if not any(noise.get(name, 0.0) for name in INPUT_CHANNELS):
        return np.zeros((time.size, 3))
    random = np.random.default_rng(seed)
    channels = {
        name: noise.get(name, 0.0) * random.standard_normal(time.size) for name in INPUT_CHANNELS
    }
    channels["chassis.v_x"] = np.full(time.size, REFERENCE_SPEED)
    noisy = Run("reference drive", time, channels, braking=())
    still = dict.fromkeys(INPUT_CHANNELS, np.zeros(time.size))
    quiet = replace(noisy, channels={**channels, **still})
    car, at_rest = car_row(vehicle)[np.newaxis], replace(settings, initial_state="equilibrium")
    found = [rims_batch(car, prepare(run, vehicle, at_rest), "exact")[0] for run in (noisy, quiet)]
    return in_band(time, found[0] - found[1], settings.output_band)


def _frequencies(length: int, step: float) -> Array:
    """Of a real transform of so many samples, Hz."""
    return np.asarray(np.fft.rfftfreq(length, step), dtype=np.float64)
