"""A stand-in for the rims mode whose answers are known in closed form.

Each compared channel is a smooth time function plus, for each of the twelve parameters p, f(p)
times a smooth time function of its own, f the logarithm for stiffness, damping and distance, and
a tenfold difference for angles: linear in the optimiser's variables, so that linear least squares
is the oracle.
"""

import numpy as np
from ridetune.engine.channels import INPUT_CHANNELS, OUTPUT_CHANNELS, Run
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.problem import DEFAULT_NOISE

from .factories import paper_vehicle

REFERENCE = paper_vehicle()
AMPLITUDE = 0.02
"""Of every time function: 40 times the default noise of z."""


def basis(time):
    """(samples, channels, parameters + 1) smooth functions, the last that of the reference."""
    rng = np.random.default_rng(42)
    shape = (len(OUTPUT_CHANNELS), len(PARAMETER_NAMES) + 1)
    frequency, phase = rng.uniform(0.3, 8.0, shape), rng.uniform(0.0, 6.0, shape)
    return AMPLITUDE * np.sin(time[:, np.newaxis, np.newaxis] * frequency + phase)


def weights(vehicle):
    """(parameters + 1,) f of each parameter, and 1."""
    found = []
    for name in PARAMETER_NAMES:
        value, reference = vehicle.value(name), REFERENCE.value(name)
        angle = name.endswith("pivot.angle")
        found.append(10.0 * (value - reference) if angle else np.log(value / reference))
    return np.array([*found, 1.0])


def simulate(vehicles, inputs, traction):
    """(cars, samples, 3), as `simulation.rims_batch`."""
    assert traction == "exact"
    return np.stack([basis(inputs.time) @ weights(vehicle) for vehicle in vehicles])


def recording(vehicle, *, name="lap", seed=0, samples=1001, outputs=OUTPUT_CHANNELS, noise=1.0):
    """What the stand-in says of a car on still rims, with noise in units of the default."""
    time = 0.005 * np.arange(samples)
    channels = dict.fromkeys(INPUT_CHANNELS, np.zeros_like(time))
    channels["chassis.v_x"] = np.full_like(time, 10.0)
    rng = np.random.default_rng(seed)
    history = basis(time) @ weights(vehicle)
    for k, channel in enumerate(OUTPUT_CHANNELS):
        if channel in outputs:
            error = noise * DEFAULT_NOISE[channel] * rng.normal(size=samples)
            channels[channel] = history[:, k] + error
    return Run(name, time, channels)
