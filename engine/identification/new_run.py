"""What a run that is not driven yet would say, fitted by the same means as the runs so far.

Its instruments are theirs: what is known of the sensors holds, gains and delays that are found are
found from all runs together, and its biases are its own.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..channels import INPUT_CHANNELS
from ..simulation.rims import RimsInputs, prepare
from ..simulation.simulate import rims_batch
from .candidates import Drive, braked
from .compared_runs import ComparedRun
from .expected_noise import ExpectedNoise
from .problem import Problem
from .residuals import FAILED_TRIAL, Residuals
from .sensing import IDEAL, driven
from .sensor_model import SensorVariable
from .uncertainty import Information
from .variables import Variable

Array = NDArray[np.float64]


def of_all_runs(variables: Sequence[Variable]) -> list[int]:
    """Places of what several runs have in common: all but the sensors' biases."""
    return [
        place
        for place, one in enumerate(variables)
        if not isinstance(one, SensorVariable) or one.run is None
    ]


def said_by(problem: Problem, drive: Drive, noise: ExpectedNoise) -> Information | str:
    """What a drive would add of the variables `of_all_runs`, or why its run would say nothing.

    problem : of the runs so far, with the values where their fit ended as start
    """
    if drive.run is None:
        return drive.remark
    known = {(one.name, one.run): one.start for one in problem.fitted}
    sensors = problem.sensors.variables([(drive.key, noise.channels)])
    problem = replace(
        problem,
        vehicle=braked(problem.vehicle),
        fitted=tuple(
            replace(one, start=known.get((one.name, one.run), one.start)) for one in sensors
        ),
    )
    x = np.array([one.variable(one.start) for one in problem.variables])
    inputs = prepare(drive.run, problem.vehicle, problem.settings)
    compared = ComparedRun(
        drive.key,
        _as_read(problem, x, drive.key, inputs),
        dict.fromkeys(noise.channels, np.zeros_like(inputs.time)),
        noise.noise,
        dict.fromkeys(noise.channels, "stated"),
    )
    r, slopes = Residuals(replace(problem, runs=(compared,)), rims_batch).quick(x)
    if np.any(r == FAILED_TRIAL):
        return "The car does not come through it on its recorded rims."
    jacobian = slopes.reshape(len(noise.channels), len(inputs.time), len(x))
    return noise.information(jacobian).marginal(of_all_runs(problem.variables))


def _as_read(problem: Problem, x: Array, run: str, inputs: RimsInputs) -> RimsInputs:
    """Inputs as a record of these would give them, corrected for what is fixed of the sensors."""
    fixed = problem.sensors.readings()
    readings = {
        name: IDEAL.beyond(problem.reading(x, name, run).beyond(fixed.get(name, IDEAL)))
        for name in INPUT_CHANNELS
    }
    return inputs if all(one == IDEAL for one in readings.values()) else driven(inputs, readings)
