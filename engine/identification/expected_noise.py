"""What the residuals of a run that is not driven yet would look like: spectra by channel.

From runs that were fitted they are those of their residuals (`uncertainty.spectra`), the mean over
the samples: noise of the outputs, noise of the inputs and what the model misses count alike.
Without runs they follow from stated noise. That of z, pitch and roll is white. That of the wheels
and of a_x goes through the car: the reference drive is a level road at constant speed, once
as it is and once with white noise on the five inputs, both through the filters of the rims mode;
the spectra are those of the difference, smoothed as residuals are. The car answers so little noise
linearly, whatever else it does.

Spectra are two-sided and by sample, in units of the channels' noise; runs are averaged in SI.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..channels import INPUT_CHANNELS, OUTPUT_CHANNELS, WHEEL_CHANNELS
from ..filters import in_band
from ..run import Run
from ..simulation.car_rows import car_row
from ..simulation.rims import prepare
from ..simulation.rims_settings import RimsSettings
from ..simulation.simulate import rims_batch
from ..vehicle import Vehicle
from .condensed import triangle
from .problem import Problem
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

    channels : compared, in order;  noise : their assumed standard deviations as read, SI
    weights : mean weight of their samples in a robust loss
    step : time between samples, s
    width : lags, in samples, over which residuals are correlated
    frequency (f,) : Hz, from 0 to half the sampling rate
    density (channels, channels, f) : in units of the noise
    worth : independent samples of a channel;  freedom : degrees of freedom of M, both in one second
    """

    channels: tuple[str, ...]
    noise: Mapping[str, float]
    weights: Mapping[str, float]
    step: float
    width: float
    frequency: Array
    density: Complex
    worth: float
    freedom: float

    def information(self, jacobian: Array) -> Information:
        """What a run says by whose samples the model moves so.

        jacobian : (channels, samples, n) of the channels in units of their noise
        """
        weights = np.array([self.weights[name] for name in self.channels])
        weighted = np.sqrt(weights)[:, np.newaxis, np.newaxis] * jacobian
        channels, samples, n = jacobian.shape
        length = transform_length(samples, self.width)
        frequency = _frequencies(length, self.step)
        density = np.array(
            [
                [np.interp(frequency, self.frequency, of_pair) for of_pair in of_channel]
                for of_channel in self.density
            ]
        )
        return Information(
            triangle(weighted.reshape(-1, n)),
            (scatter(weighted, density, length),),
            self.worth * channels * samples * self.step,
            (self.freedom * samples * self.step,),
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
    samples = np.zeros((len(channels), len(channels)))
    squares, weights = np.zeros(len(channels)), np.zeros(len(channels))
    worth = freedom = seconds = of_channels = 0.0
    for seen, run in zip(problem.runs, runs, strict=True):
        count, lags = run.residuals.shape[1], bandwidth(run.residuals, run.step)
        known = _frequencies(transform_length(count, lags), run.step)
        density = spectra(run, lags, bread)
        places = [channels.index(name) for name in seen.measured]
        noise = [seen.noise[name] for name in seen.measured]
        for a, row, noise_a in zip(places, density, noise, strict=True):
            for b, of_pair, noise_b in zip(places, row, noise, strict=True):
                total[a, b] += count * noise_a * noise_b * np.interp(frequency, known, of_pair)
                samples[a, b] += count
        squares[places] += count * np.square(noise)
        weights[places] += count * run.weights
        worth += sum(effective_samples(channel, lags) for channel in run.residuals)
        freedom += 3.0 * count / lags
        seconds += count * run.step
        of_channels += count * run.step * len(places)
    counted = np.diag(samples)
    typical = np.sqrt(squares / counted)
    total /= np.maximum(samples, 1.0)[:, :, np.newaxis]
    return ExpectedNoise(
        channels,
        dict(zip(channels, typical.tolist(), strict=True)),
        dict(zip(channels, (weights / counted).tolist(), strict=True)),
        step,
        width,
        frequency,
        _possible(total / np.outer(typical, typical)[:, :, np.newaxis]),
        worth / of_channels,
        freedom / seconds,
    )


def _possible(density: Complex) -> Complex:
    """Spectra that noise can have: positive semidefinite at every frequency.

    Averages are, but for channels of which each pair is in runs of its own.
    """
    powers, axes = np.linalg.eigh(density.transpose(2, 0, 1))
    kept = axes * np.maximum(powers, 0.0)[:, np.newaxis, :]
    return (kept @ axes.conj().transpose(0, 2, 1)).transpose(1, 2, 0)


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
        dict.fromkeys(channels, 1.0),
        step,
        width,
        frequency,
        density,
        1.0 / step,
        3.0 / (width * step),
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
