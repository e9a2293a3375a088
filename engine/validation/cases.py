"""The runs that a car is to predict, and what of them cannot be validated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..channels import OUTPUT_CHANNELS
from ..errors import ManoeuvreError, ProblemError
from ..identification.compared_runs import distinct_names, same_data
from ..identification.noise_source import noise_in
from ..identification.sensing import corrected
from ..identification.sensor_model import readings_in
from ..manoeuvre import Manoeuvre
from ..measurement import missing_for_identification
from ..run import Run

Role = Literal["fit", "hold-out"]


@dataclass(frozen=True, eq=False)
class Case:
    """A run to predict, whether the car was fitted to it, and what was driven if that is known."""

    run: Run
    role: Role
    manoeuvre: Manoeuvre | None = None


def as_it_moved(run: Run, fit: Mapping[str, Any], fitted: str | None) -> Run:
    """A run with the motion behind what its sensors read, and with their noise, as a fit knows
    them.

    fit : as `fit_to_json` gives it
    fitted : what the fit calls the run; None where it has not seen it
    """
    noise = {**run.noise, **noise_in(fit, fitted, run.time)}
    return corrected(replace(run, noise=noise), readings_in(fit, fitted))


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
