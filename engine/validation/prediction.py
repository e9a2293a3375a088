"""One model's prediction of one run, and how well it does."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.stats import norm

from ..channels import OUTPUT_CHANNELS
from ..errors import RideError
from ..filters import noise_gain
from ..identification.bands import bands
from ..identification.kept_fit import KeptFit
from ..identification.uncertainty import CONFIDENCE
from ..rating import Rating, rate
from ..run import Run
from ..run_notes import DEFAULT_NOISE
from ..simulation.comparison import fit_percent
from ..simulation.excitation import Excitation, FreeExcitation, RimsExcitation
from ..simulation.recorded_motion import recorded_motion
from ..simulation.rims import filtered_outputs
from ..simulation.rims_settings import RimsSettings
from ..simulation.simulate import Model, Simulation, Traction
from ..vehicle import Vehicle
from .cases import Case
from .squat import SquatWindow

Array = NDArray[np.float64]
Mode = Literal["rims", "road"]

MODELS: tuple[Model, ...] = ("8dof", "7dof")

NOISE_QUANTILE = float(norm.ppf(0.5 + CONFIDENCE / 2.0))


@dataclass(frozen=True, slots=True)
class Score:
    """How well one channel is predicted.

    rms_error : SI;  rating : of ISO/TS 18571, or none
    coverage : share of the samples within the 95 % band and the noise, or none without a band
    """

    fit_percent: float
    rms_error: float
    rating: Rating | None
    coverage: float | None


@dataclass(frozen=True, eq=False)
class Prediction:
    """One model's prediction of one run.

    run : at the recording's times, outputs through the output filter; None where the model failed
    squat : step of the pitch, rad, where the run has one
    half_width : of the 95 % band by the fit's errors, (samples,) by output, SI, where there is one
    faults : those of the warnings by which the recording is probably wrong
    failure : why there is no run
    """

    mode: Mode
    model: Model
    run: Run | None
    scores: Mapping[str, Score] = field(default_factory=dict)
    squat: float | None = None
    half_width: Mapping[str, Array] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    failure: str = ""


def kinds(case: Case) -> list[tuple[Mode, Model]]:
    """The predictions that a run allows."""
    modes: tuple[Mode, ...] = ("rims",) if case.manoeuvre is None else ("rims", "road")
    return [(mode, model) for mode in modes for model in MODELS]


@dataclass(frozen=True, slots=True)
class Driver:
    """A car that predicts.

    fit : whose errors make the bands; without one there are none
    """

    vehicle: Vehicle
    traction: Traction
    settings: RimsSettings
    fit: KeptFit | None = None


def predict(
    driver: Driver, case: Case, measured: Run, window: SquatWindow | None, mode: Mode, model: Model
) -> Prediction:
    """What one model predicts of one run; a failure is told in it.

    measured : the run as compared, with the window of its squat
    """
    try:
        ride = _ride(driver, case, mode, model)
        found = ride.simulate(driver.vehicle, model)
        within, open_ones = _bands(driver, ride, model)
    except RideError as error:
        return Prediction(mode, model, None, failure=str(error))
    run, noise = found.run, {**DEFAULT_NOISE, **case.run.noise}
    passed = noise_gain(case.run.time, driver.settings.output_band)
    scores = {
        name: Score(
            fit_percent(measured[name], run[name]),
            float(np.sqrt(np.mean((run[name] - measured[name]) ** 2))),
            rate(run.time, measured[name], run[name]),
            None
            if name not in within
            else coverage(measured[name], run[name], within[name], passed * noise[name]),
        )
        for name in OUTPUT_CHANNELS
        if name in measured and name in run
    }
    squat = None if window is None else window.step(run)
    warnings = (*found.warnings, *open_ones)
    return Prediction(mode, model, run, scores, squat, within, warnings, found.faults)


def coverage(measured: Array, predicted: Array, half_width: Array, noise: float) -> float:
    """Share of the samples within the band, widened by what 95 % of the noise stays below.

    noise : standard deviation
    """
    reach = np.hypot(half_width, NOISE_QUANTILE * noise)
    return float(np.mean(np.abs(measured - predicted) <= reach))


@dataclass(frozen=True, slots=True)
class _Compared:
    """A ride whose results are at a recording's times, with z, pitch and roll as compared.

    outputs_alone : whether these are all that is kept
    """

    excitation: Excitation
    time: Array
    settings: RimsSettings
    outputs_alone: bool = False

    def simulate(self, vehicle: Vehicle, model: Model) -> Simulation:
        found = self.excitation.simulate(vehicle, model)
        run = found.run
        if self.outputs_alone:
            run = replace(run, channels={name: run[name] for name in OUTPUT_CHANNELS})
        return replace(found, run=as_compared(_at(run, self.time), self.settings))

    def for_cars(self, cars: Sequence[Vehicle]) -> "_Compared":
        return replace(self, excitation=self.excitation.for_cars(cars))


def _ride(driver: Driver, case: Case, mode: Mode, model: Model) -> _Compared:
    if mode == "rims" or case.manoeuvre is None:
        motion = recorded_motion(case.run, driver.settings)
        # The linear model knows one way of driving.
        excitation = RimsExcitation(motion, driver.traction if model == "8dof" else "exact")
    else:
        excitation = FreeExcitation(case.manoeuvre)
    return _Compared(excitation, case.run.time, driver.settings)


def _bands(
    driver: Driver, ride: _Compared, model: Model
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Half the width of each output's 95 % band, those that have one, and why others have none."""
    if driver.fit is None or model != "8dof":
        return {}, ()
    try:
        found = bands(driver.fit, driver.vehicle, replace(ride, outputs_alone=True))
    except RideError as error:
        return {}, (str(error),)
    half_width = {name: 0.5 * (found.upper[name] - found.lower[name]) for name in OUTPUT_CHANNELS}
    closed = {name: one for name, one in half_width.items() if np.isfinite(one).all()}
    return closed, found.warnings


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
