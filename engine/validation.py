"""How well a car predicts runs, those it was identified from and those held out.

Every run is predicted by the 8-DOF model and by the 7-DOF baseline: driven by the recorded rims,
and, where the run's manoeuvre is known, over its road by its torques with the car's own tyres
(Fig. 12).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from .channels import OUTPUT_CHANNELS, Run
from .errors import Cancelled, ManoeuvreError, ProblemError, RideError, VehicleError
from .identification.compared_runs import distinct_names, same_data
from .json_record import RecordReader
from .manoeuvre import Manoeuvre
from .measurement import missing_for_identification
from .rating import Rating, rate
from .roads.road_spectrum import RoadSpectrum, road_spectra
from .simulation.metrics import pushes
from .simulation.rims import filtered_outputs
from .simulation.rims_settings import RimsSettings
from .simulation.simulate import (
    Model,
    Simulation,
    Traction,
    fit_percent,
    simulate_rims,
    simulate_road,
)
from .vehicle import Pivot, Vehicle

Array = NDArray[np.float64]
Role = Literal["fit", "hold-out"]
Mode = Literal["rims", "road"]

MODELS: tuple[Model, ...] = ("8dof", "7dof")

REST_BEFORE = 2.0
REST_GAP = 0.5
"""Pitch before a push is the mean over so many seconds, which end so many before it."""

LEAST_REST = 0.5
"""Shortest time before a push that is called one, s."""


@dataclass(frozen=True, eq=False)
class Case:
    """A run to predict, whether the car was fitted to it, and what was driven if that is known."""

    run: Run
    role: Role
    manoeuvre: Manoeuvre | None = None


@dataclass(frozen=True, slots=True)
class Score:
    """How well one channel is predicted; `rms_error` in SI, `rating` of ISO/TS 18571 or none."""

    fit_percent: float
    rms_error: float
    rating: Rating | None


@dataclass(frozen=True, slots=True)
class SquatWindow:
    """Where the squat of a run is read, (begin, end) in s: at rest, and late in the push."""

    rest: tuple[float, float]
    late: tuple[float, float]

    def step(self, time: Array, pitch: Array) -> float:
        """Mean pitch late in the push less that before it, rad; negative with the nose up."""
        before, during = (
            float(np.mean(pitch[(time >= begin) & (time <= end)]))
            for begin, end in (self.rest, self.late)
        )
        return during - before


@dataclass(frozen=True, eq=False)
class Prediction:
    """One model's prediction of one run.

    run : at the recording's times, outputs through the output filter; None where the model failed
    squat : step of the pitch, rad, where the run has one
    failure : why there is no run
    """

    mode: Mode
    model: Model
    run: Run | None
    scores: Mapping[str, Score] = field(default_factory=dict)
    squat: float | None = None
    warnings: tuple[str, ...] = ()
    failure: str = ""


@dataclass(frozen=True, eq=False)
class ValidatedRun:
    """A run beside its predictions; `measured` has its outputs through the output filter."""

    name: str
    role: Role
    measured: Run
    manoeuvre: Manoeuvre | None
    predictions: tuple[Prediction, ...]
    window: SquatWindow | None
    squat: float | None
    road: tuple[RoadSpectrum, ...]


@dataclass(frozen=True, eq=False)
class Validation:
    """All runs, predicted by one car."""

    vehicle: Vehicle
    traction: Traction
    settings: RimsSettings
    runs: tuple[ValidatedRun, ...]


@dataclass(frozen=True, slots=True)
class Geometry:
    """Where the pivots lie by geometry, to be held against where a fit puts them."""

    front: Pivot | None = None
    rear: Pivot | None = None

    def values(self) -> dict[str, float]:
        """By the parameter's name, SI."""
        axles = {"front": self.front, "rear": self.rear}
        return {
            f"{axle}.pivot.{name}": getattr(pivot, name)
            for axle, pivot in axles.items()
            if pivot is not None
            for name in ("distance", "angle")
        }


def geometry_from_json(data: Any, source: str = "geometry") -> Geometry:
    """Read {"front": {"distance": m, "angle": rad}, "rear": ...}; VehicleError names the field."""
    geometry = RecordReader(source, VehicleError).record(Geometry, data)
    if not geometry.values():
        raise VehicleError(
            f'{source}: it holds no pivot; add "front": {{"distance": m, "angle": rad}}, or "rear".'
        )
    return geometry


def check_cases(cases: Sequence[Case]) -> list[str]:
    """The runs' names, told apart; raises ProblemError or ManoeuvreError for what cannot be
    validated, before any work is done.
    """
    if not cases:
        raise ProblemError("No run is given; give at least one recording.")
    for held in (case.run for case in cases if case.role == "hold-out"):
        for fitted in (case.run for case in cases if case.role == "fit"):
            if same_data(held, fitted):
                raise ProblemError(
                    f"Run {held.name} is to be held out, but the car is fitted to it"
                    f" ({fitted.name}); take another one, or leave it out of one of the two."
                )
    for case in cases:
        _check_case(case)
    return distinct_names([case.run for case in cases])


def _check_case(case: Case) -> None:
    run = case.run
    if missing := missing_for_identification(run):
        raise ProblemError(
            f"Run {run.name} lacks {', '.join(missing)}; record what is missing or leave the run"
            " out."
        )
    for name in OUTPUT_CHANNELS:
        if name in run and not np.all(np.isfinite(run[name])):
            raise ProblemError(
                f"Run {run.name} has gaps (not a number) in {name}; leave the channel out."
            )
    if case.manoeuvre is None:
        return
    if case.manoeuvre.kind != "road":
        raise ManoeuvreError(
            f"Run {run.name}: its manoeuvre, '{case.manoeuvre.name}', moves the posts of a rig;"
            " give one on a road."
        )
    begin, end, duration = run.time[0], run.time[-1], case.manoeuvre.duration
    if begin < 0.0 or end > duration + 1e-6:
        raise ManoeuvreError(
            f"Run {run.name} lasts from {begin:g} to {end:g} s, its manoeuvre,"
            f" '{case.manoeuvre.name}', from 0 to {duration:g} s; count the run's time from the"
            " manoeuvre's beginning and cut what is beyond it."
        )


def validate(
    vehicle: Vehicle,
    cases: Sequence[Case],
    *,
    traction: Traction = "exact",
    settings: RimsSettings | None = None,
    progress: Callable[[int, int], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Validation:
    """Let a car predict runs; a prediction that fails says why and the others go on.

    progress : called with how many predictions of how many are done
    cancelled : polled before each; Cancelled is raised once it is true
    Raises what `check_cases` does.
    """
    settings = settings or RimsSettings()
    names = check_cases(cases)
    total = sum(len(_kinds(case)) for case in cases)
    done, runs = 0, []
    for case, name in zip(cases, names, strict=True):
        case = replace(case, run=replace(case.run, name=name))
        measured = _filtered(case.run, settings)
        window = squat_window(measured)
        found = []
        for mode, model in _kinds(case):
            if cancelled is not None and cancelled():
                raise Cancelled("The validation was cancelled.")
            found.append(_predict(vehicle, case, measured, window, mode, model, traction, settings))
            done += 1
            if progress is not None:
                progress(done, total)
        runs.append(
            ValidatedRun(
                name=name,
                role=case.role,
                measured=measured,
                manoeuvre=case.manoeuvre,
                predictions=tuple(found),
                window=window,
                squat=None if window is None else _squat(window, measured),
                road=_road(vehicle, case, found),
            )
        )
    return Validation(vehicle, traction, settings, tuple(runs))


def squat_window(run: Run) -> SquatWindow | None:
    """The later half of the longest time in which the car accelerates, and the rest before it."""
    during = pushes(run).get("squat")
    if during is None or "chassis.pitch" not in run:
        return None
    begin, end = _longest(run.time, during)
    rest_end = begin - REST_GAP
    rest_begin = max(float(run.time[0]), rest_end - REST_BEFORE)
    if rest_end - rest_begin < LEAST_REST:
        return None
    return SquatWindow((rest_begin, rest_end), (0.5 * (begin + end), end))


def _longest(time: Array, during: NDArray[np.bool_]) -> tuple[float, float]:
    """First and last instant of the longest stretch of samples that are true, of one at least."""
    edges = np.flatnonzero(np.diff(during.astype(np.int8), prepend=0, append=0))
    first, last = time[edges[::2]], time[edges[1::2] - 1]
    longest = np.argmax(last - first)
    return float(first[longest]), float(last[longest])


def _kinds(case: Case) -> list[tuple[Mode, Model]]:
    """The predictions that a run allows."""
    modes: tuple[Mode, ...] = ("rims",) if case.manoeuvre is None else ("rims", "road")
    return [(mode, model) for mode in modes for model in MODELS]


def _predict(
    vehicle: Vehicle,
    case: Case,
    measured: Run,
    window: SquatWindow | None,
    mode: Mode,
    model: Model,
    traction: Traction,
    settings: RimsSettings,
) -> Prediction:
    try:
        found = _simulation(vehicle, case, mode, model, traction, settings)
    except RideError as error:
        return Prediction(mode, model, None, failure=str(error))
    run = _filtered(_at(found.run, case.run.time), settings)
    scores = {
        name: Score(
            fit_percent(measured[name], run[name]),
            float(np.sqrt(np.mean((run[name] - measured[name]) ** 2))),
            rate(run.time, measured[name], run[name]),
        )
        for name in OUTPUT_CHANNELS
        if name in measured and name in run
    }
    squat = None if window is None else _squat(window, run)
    return Prediction(mode, model, run, scores, squat, found.warnings)


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


def _squat(window: SquatWindow, run: Run) -> float:
    return window.step(run.time, run["chassis.pitch"])


def _filtered(run: Run, settings: RimsSettings) -> Run:
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


def _road(
    vehicle: Vehicle, case: Case, predictions: Sequence[Prediction]
) -> tuple[RoadSpectrum, ...]:
    """Spectra of the road that the front wheels met, before and after the drive torque ended."""
    driven = next((one.run for one in predictions if one.mode == "road" and one.run), None)
    if case.manoeuvre is None or driven is None:
        return ()
    road = case.manoeuvre.demand(vehicle).road
    if road is None:
        return ()
    contact = vehicle.front.cg_distance + driven["chassis.x"]
    edges = [float(contact[0]), float(contact[-1])]
    off = None if case.manoeuvre.drive is None else case.manoeuvre.drive.end()
    if off is not None and driven.time[0] < off < driven.time[-1]:
        edges.insert(1, float(np.interp(off, driven.time, contact)))
    return road_spectra(road, edges)
