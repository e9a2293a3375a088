"""A validation as JSON: the document that the report, the page and `--json` show.

Numbers are SI, those that are not finite null. Histories have at most MOST_SAMPLES instants, every
k-th sample, and six digits.
"""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..channels import OUTPUT_CHANNELS, WHEEL_CHANNELS
from ..frames import CORNERS
from ..identification.fit_file import plain
from ..manoeuvre import manoeuvre_to_json
from ..roads.iso8608 import CLASSES, REFERENCE_FREQUENCY
from ..roads.road_spectrum import RoadSpectrum
from ..run import Run
from .geometry import Geometry
from .prediction import Prediction, Score
from .validate import ValidatedRun, Validation

MOST_SAMPLES = 4001

MEASURED = (*OUTPUT_CHANNELS, *WHEEL_CHANNELS, "chassis.a_x", "chassis.v_x")
PREDICTED = (*OUTPUT_CHANNELS, *(f"drive.{corner}.torque" for corner in CORNERS))
"""What is kept of a recording and of a prediction, as far as there is."""

UPPER_LIMIT = 2.0
"""A class's upper limit over its geometric mean."""


def validation_to_json(
    validation: Validation,
    fit: Mapping[str, Any],
    geometry: Geometry | None,
    made: Mapping[str, Any],
) -> dict[str, Any]:
    """The document.

    fit : of the car that predicts, as `fit_to_json` gives it
    made : how the document came about (date, versions, recordings), kept as it is
    """
    return plain(
        {
            "fit": dict(fit),
            "geometry": {} if geometry is None else geometry.values(),
            "traction": validation.traction,
            "settings": asdict(validation.settings),
            "runs": [_run(run) for run in validation.runs],
            "road_classes": {
                "reference_frequency": REFERENCE_FREQUENCY,
                "upper_limits": {name: UPPER_LIMIT * mean for name, mean in CLASSES.items()},
            },
            "made": dict(made),
        }
    )


def _run(run: ValidatedRun) -> dict[str, Any]:
    every = -(-run.measured.time.size // MOST_SAMPLES)
    return {
        "name": run.name,
        "role": run.role,
        "findings": list(run.findings),
        "samples": run.measured.time.size,
        "duration": run.measured.duration,
        "manoeuvre": None if run.manoeuvre is None else manoeuvre_to_json(run.manoeuvre),
        "squat": None
        if run.window is None
        else {"rest": run.window.rest, "late": run.window.late, "step": run.squat},
        "time": _digits(run.measured.time[::every]),
        "measured": _histories(run.measured, MEASURED, every),
        "predictions": [_prediction(one, every) for one in run.predictions],
        "road": [_spectrum(one) for one in run.road],
    }


def _prediction(one: Prediction, every: int) -> dict[str, Any]:
    return {
        "mode": one.mode,
        "model": one.model,
        "scores": {name: _score(score) for name, score in one.scores.items()},
        "squat": one.squat,
        "warnings": list(one.warnings),
        "failure": one.failure,
        "values": {} if one.run is None else _predicted(one.run, one.half_width, every),
    }


def _predicted(
    run: Run, half_width: Mapping[str, NDArray[np.float64]], every: int
) -> dict[str, list[float]]:
    """What is kept of a prediction, with the ends of its bands as X.lower and X.upper."""
    return _histories(run, PREDICTED, every) | {
        f"{name}.{end}": _digits((run[name] + sign * width)[::every])
        for name, width in half_width.items()
        for end, sign in (("lower", -1.0), ("upper", 1.0))
    }


def _score(score: Score) -> dict[str, Any]:
    rating = score.rating
    return {
        "fit_percent": score.fit_percent,
        "rms_error": score.rms_error,
        "coverage": score.coverage,
        "rating": None if rating is None else {"overall": rating.overall, **asdict(rating)},
    }


def _spectrum(road: RoadSpectrum) -> dict[str, Any]:
    lines = {name: _digits(getattr(road, name)) for name in ("frequency", "left", "right")}
    return {"begin": road.begin, "end": road.end, **lines}


def _histories(run: Run, names: tuple[str, ...], every: int) -> dict[str, list[float]]:
    return {name: _digits(run[name][::every]) for name in names if name in run}


def _digits(values: NDArray[np.float64]) -> list[float]:
    return [float(f"{value:.6g}") for value in values.tolist()]
