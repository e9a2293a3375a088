"""How well a car predicts runs, those it was identified from and those held out.

Every run is predicted by the 8-DOF model and by the 7-DOF baseline: driven by the recorded rims,
and, where the run's manoeuvre is known, over its road by its torques with the car's own tyres
(Fig. 12).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import Cancelled
from ..identification.cars import among_others, another_car
from ..identification.kept_fit import KeptFit
from ..manoeuvre import Manoeuvre
from ..roads.road_spectrum import RoadSpectrum, road_spectra
from ..run import Run
from ..simulation.rims_settings import RimsSettings
from ..simulation.simulate import Traction
from ..vehicle import Vehicle
from .cases import Case, Role, check_cases
from .prediction import Driver, Prediction, as_compared, kinds, predict
from .squat import SquatWindow, squat_window


@dataclass(frozen=True, eq=False)
class ValidatedRun:
    """A run beside its predictions.

    measured : with its outputs through the output filter
    findings : why the predictions say little of the car: the recording is of another one, or
        probably wrong
    """

    name: str
    role: Role
    measured: Run
    findings: tuple[str, ...]
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


def validate(
    vehicle: Vehicle,
    cases: Sequence[Case],
    *,
    traction: Traction = "exact",
    settings: RimsSettings | None = None,
    fit: KeptFit | None = None,
    progress: Callable[[int, int], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Validation:
    """Let a car predict runs; a prediction that fails says why and the others go on.

    fit : that found the car, whose errors make the bands; without one there are none
    progress : called with how many predictions of how many are done
    cancelled : polled before each; Cancelled is raised once it is true
    Raises what `check_cases` does.
    """
    settings = settings or RimsSettings()
    driver = Driver(vehicle, traction, settings, fit)
    names = check_cases(cases)
    total = sum(len(kinds(case)) for case in cases)
    plants = {name: case.run.plant for name, case in zip(names, cases, strict=True)}
    done, runs = 0, []
    for case, name in zip(cases, names, strict=True):
        case = replace(case, run=replace(case.run, name=name))
        measured = as_compared(case.run, settings)
        window = squat_window(measured)
        found = []
        for mode, model in kinds(case):
            if cancelled is not None and cancelled():
                raise Cancelled("The validation was cancelled.")
            found.append(predict(driver, case, measured, window, mode, model))
            done += 1
            if progress is not None:
                progress(done, total)
        runs.append(
            ValidatedRun(
                name=name,
                role=case.role,
                measured=measured,
                findings=(
                    *(another_car(case.run, vehicle) or among_others(name, plants)),
                    *dict.fromkeys(fault for one in found for fault in one.faults),
                ),
                manoeuvre=case.manoeuvre,
                predictions=tuple(found),
                window=window,
                squat=None if window is None else window.step(measured),
                road=_road(vehicle, case, found),
            )
        )
    return Validation(vehicle, traction, settings, tuple(runs))


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
