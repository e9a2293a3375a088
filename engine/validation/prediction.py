"""One model's prediction of one run, and how well it does."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ..channels import OUTPUT_CHANNELS, Run
from ..errors import RideError
from ..rating import Rating, rate
from ..simulation.rims import filtered_outputs
from ..simulation.rims_settings import RimsSettings
from ..simulation.simulate import (
    Model,
    Simulation,
    Traction,
    fit_percent,
    simulate_rims,
    simulate_road,
)
from ..vehicle import Vehicle
from .cases import Case
from .squat import SquatWindow

Array = NDArray[np.float64]
Mode = Literal["rims", "road"]

MODELS: tuple[Model, ...] = ("8dof", "7dof")


@dataclass(frozen=True, slots=True)
class Score:
    """How well one channel is predicted; `rms_error` in SI, `rating` of ISO/TS 18571 or none."""

    fit_percent: float
    rms_error: float
    rating: Rating | None


@dataclass(frozen=True, eq=False)
class Prediction:
    """One model's prediction of one run.

    run : at the recording's times, outputs through the output filter; None where the model failed
    squat : step of the pitch, rad, where the run has one
    faults : those of the warnings by which the recording is probably wrong
    failure : why there is no run
    """

    mode: Mode
    model: Model
    run: Run | None
    scores: Mapping[str, Score] = field(default_factory=dict)
    squat: float | None = None
    warnings: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    failure: str = ""


def kinds(case: Case) -> list[tuple[Mode, Model]]:
    """The predictions that a run allows."""
    modes: tuple[Mode, ...] = ("rims",) if case.manoeuvre is None else ("rims", "road")
    return [(mode, model) for mode in modes for model in MODELS]


def predict(
    vehicle: Vehicle,
    case: Case,
    measured: Run,
    window: SquatWindow | None,
    mode: Mode,
    model: Model,
    traction: Traction,
    settings: RimsSettings,
) -> Prediction:
    """What one model predicts of one run; a failure is told in it.

    measured : the run as compared, with the window of its squat
    """
    try:
        found = _simulation(vehicle, case, mode, model, traction, settings)
    except RideError as error:
        return Prediction(mode, model, None, failure=str(error))
    run = as_compared(_at(found.run, case.run.time), settings)
    scores = {
        name: Score(
            fit_percent(measured[name], run[name]),
            float(np.sqrt(np.mean((run[name] - measured[name]) ** 2))),
            rate(run.time, measured[name], run[name]),
        )
        for name in OUTPUT_CHANNELS
        if name in measured and name in run
    }
    squat = None if window is None else window.step(run)
    return Prediction(mode, model, run, scores, squat, found.warnings, found.faults)


def _simulation(
    vehicle: Vehicle,
    case: Case,
    mode: Mode,
    model: Model,
    traction: Traction,
    settings: RimsSettings,
) -> Simulation:
    if mode == "rims" or case.manoeuvre is None:
        how: Any = {"traction": traction} if model == "8dof" else {}
        return simulate_rims(vehicle, case.run, settings=settings, model=model, **how)
    return simulate_road(vehicle, case.manoeuvre, model=model)


def as_compared(run: Run, settings: RimsSettings) -> Run:
    """The run with its outputs through the output filter."""
    outputs = filtered_outputs(run, settings.output_band)
    return replace(run, channels={**run.channels, **outputs})


def _at(run: Run, time: Array) -> Run:
    """A simulated run at a recording's times, which it covers but for rounding."""
    if np.array_equal(run.time, time):
        return run
    when = np.clip(time, run.time[0], run.time[-1])
    channels = {
        # Torques have corners, which a spline would overshoot.
        name: CubicSpline(run.time, values)(when)
        if name in OUTPUT_CHANNELS
        else np.interp(when, run.time, values)
        for name, values in run.channels.items()
    }
    return Run(run.name, time, channels)
