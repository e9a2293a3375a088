"""The measurement campaign of Table 2, driven by the concept model in place of a real car.

Both manoeuvres are simulated, the channels that a test car records are kept, and noise is added.
Each channel of each manoeuvre draws from a stream of its own, so that a channel's noise does not
depend on which others are noisy.
"""

import json
from collections.abc import Mapping

import numpy as np

from .channels import Run
from .errors import MeasurementError
from .frames import CORNERS
from .manoeuvre import reference_manoeuvres
from .simulation import simulate_road
from .vehicle import Vehicle

CAMPAIGN = ("1", "2")
"""Keys of Table 2's manoeuvres."""

RECORDED = (
    "chassis.z",
    "chassis.pitch",
    "chassis.roll",
    "chassis.a_x",
    "chassis.v_x",
    *(f"wheel.{corner}.z" for corner in CORNERS),
)
"""What a test car records, besides the time."""


def drive_campaign(
    vehicle: Vehicle, *, noise: Mapping[str, float] | None = None, seed: int = 0
) -> list[Run]:
    """The recordings of both manoeuvres, named manoeuvre_1 and manoeuvre_2.

    noise : channel -> standard deviation of white noise, SI; channels not named are noise-free
    seed : of the noise; the roads have the seeds of their manoeuvres

    Raises MeasurementError for noise on a channel that is not recorded.
    """
    noise = dict(noise or {})
    for name, deviation in noise.items():
        if name not in RECORDED or not 0.0 < deviation < np.inf:
            raise MeasurementError(
                f"A noise of {deviation:g} is asked for on {name}; give a positive standard"
                f" deviation for one of {', '.join(RECORDED)}."
            )
    runs = []
    for number, key in enumerate(CAMPAIGN):
        manoeuvre = reference_manoeuvres()[key]
        driven = simulate_road(vehicle, manoeuvre).run
        channels = {}
        for position, name in enumerate(RECORDED):
            stream = np.random.default_rng([seed, number, position])
            error = noise.get(name, 0.0) * stream.standard_normal(driven.time.size)
            channels[name] = driven[name] + error
        name, description = f"manoeuvre_{key}", f"{manoeuvre.name}. Simulated: {vehicle.name}."
        runs.append(Run(name, driven.time, channels, noise, description=description))
    return runs


def notes(run: Run) -> str:
    """What `read_run` finds beside the recording: its description and noise, as TOML."""
    stated = "".join(f"{json.dumps(name)} = {value!r}\n" for name, value in run.noise.items())
    return f"description = {json.dumps(run.description)}\n\n[noise]\n{stated}"
