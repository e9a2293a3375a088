"""A stand-in for the rims mode whose answers are known in closed form.

Each compared channel is a smooth time function plus, for each of the twelve parameters p, f(p)
times a smooth time function of its own, f the logarithm for stiffness, damping and distance, and
a tenfold difference for angles: linear in the optimiser's variables, so that linear least squares
is the oracle.
"""

import numpy as np
from ridetune.engine.channels import INPUT_CHANNELS, OUTPUT_CHANNELS
from ridetune.engine.kernels.buffer import BODY_ROWS
from ridetune.engine.kernels.records import Body, Corner
from ridetune.engine.parameters import PARAMETER_NAMES
from ridetune.engine.run import Run
from ridetune.engine.run_notes import DEFAULT_NOISE

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


def values_of(cars):
    """By name, a parameter (cars,) of cars (cars, CAR_ROWS), read back from their rows."""
    body, corners = cars[:, :BODY_ROWS], cars[:, BODY_ROWS:].reshape(len(cars), 4, -1)
    found = {}
    for axle, corner, inwards in (("front", corners[:, 0], -1.0), ("rear", corners[:, 2], 1.0)):
        at = dict(zip(Corner._fields, corner.T, strict=True))
        bar = dict(zip(Body._fields, body.T, strict=True))
        distance = -inwards * at["arm_x"]
        found |= {
            f"{axle}.suspension.stiffness": at["stiffness"],
            f"{axle}.suspension.damping": 0.5 * (at["jounce_damping"] + at["rebound_damping"]),
            f"{axle}.stabilizer_bar.stiffness": bar[f"{axle}_bar_stiffness"],
            f"{axle}.stabilizer_bar.damping": bar[f"{axle}_bar_damping"],
            f"{axle}.pivot.distance": distance,
            f"{axle}.pivot.angle": np.arctan((at["radius"] - at["arm_z"]) / distance),
        }
    return found


def weights(values):
    """(parameters + 1, cars) f of each parameter, and 1; values : by name, (cars,)."""
    found = []
    for name in PARAMETER_NAMES:
        value, reference = values[name], REFERENCE.value(name)
        angle = name.endswith("pivot.angle")
        found.append(10.0 * (value - reference) if angle else np.log(value / reference))
    return np.array([*found, np.ones_like(found[0])])


def weights_of(vehicle):
    """(parameters + 1,) of one car."""
    return weights({name: vehicle.value(name) for name in PARAMETER_NAMES})


def histories(values, inputs):
    """(cars, samples, 3) for parameters by name, (cars,)."""
    return np.moveaxis(basis(inputs.time) @ weights(values), 2, 0)


def simulate(cars, inputs, traction):
    """(cars, samples, 3), as `simulation.rims_batch`."""
    assert traction == "exact"
    return histories(values_of(cars), inputs)


def recording(vehicle, *, name="lap", seed=0, samples=1001, outputs=OUTPUT_CHANNELS, noise=1.0):
    """What the stand-in says of a car on still rims, with noise in units of the default."""
    time = 0.005 * np.arange(samples)
    channels = dict.fromkeys(INPUT_CHANNELS, np.zeros_like(time))
    channels["chassis.v_x"] = np.full_like(time, 10.0)
    rng = np.random.default_rng(seed)
    history = basis(time) @ weights_of(vehicle)
    for k, channel in enumerate(OUTPUT_CHANNELS):
        if channel in outputs:
            error = noise * DEFAULT_NOISE[channel] * rng.normal(size=samples)
            channels[channel] = history[:, k] + error
    return Run(name, time, channels)
