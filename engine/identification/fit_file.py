"""A fit as JSON: `fit.json`, whose "vehicle" any command takes as a car.

Numbers are SI. JSON knows neither infinity nor not-a-number: both become null, which stands for
"not determined by the runs" (and, in fit_percent, for a channel that never moves).
"""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..step_record import step_record_to_json
from ..vehicle_file import vehicle_to_json
from .fit import Estimate, Fit
from .profile import Profile


def fit_to_json(fit: Fit) -> dict[str, Any]:
    """Everything in a fit but its residual histories."""
    return plain(
        {
            "vehicle": vehicle_to_json(fit.vehicle),
            "parameters": [_estimate(one) for one in fit.parameters],
            "sensors": [_estimate(one) for one in fit.sensors],
            "fixed_sensors": {name: dict(one) for name, one in fit.fixed_sensors.items()},
            "verdict": asdict(fit.verdict),
            "correlation": fit.errors.correlation.tolist(),
            "covariance": fit.errors.covariance.tolist(),
            "unknown": fit.errors.unknown.tolist(),
            "quantile": fit.errors.quantile,
            "outcome": str(fit.outcome),
            "converged": fit.converged,
            "warnings": list(fit.warnings),
            "faults": list(fit.faults),
            "offers": [asdict(one) for one in fit.offers],
            "cost": fit.cost,
            "cost_history": list(fit.cost_history),
            "fit_percent": {run: dict(channels) for run, channels in fit.fit_percent.items()},
            "runs": [
                {
                    "name": run.name,
                    "samples": run.samples,
                    "noise": dict(run.noise),
                    "noise_source": dict(run.noise_source),
                    "discounted": dict(run.discounted),
                    "braking": [list(interval) for interval in run.braking],
                    "conditioning": [step_record_to_json(one) for one in run.conditioning],
                }
                for run in fit.runs
            ],
            "traction": fit.traction,
            "settings": asdict(fit.settings),
            "loss": fit.loss.name,
            "loss_scale": fit.loss.scale,
            "priors": [asdict(one) for one in fit.priors],
            "whiteness": [asdict(one) for one in fit.whiteness],
            "starts": fit.starts,
            "minima": [asdict(one) for one in fit.minima],
            "seconds": fit.seconds,
            "simulations": fit.simulations,
            "evaluations": fit.evaluations,
        }
    )


def profile_to_json(found: Profile) -> dict[str, Any]:
    """A profile; null for an end of the interval that is open."""
    return plain(asdict(found))


def write_fit(fit: Fit, path: Path | str) -> None:
    """Write fit.json."""
    text = json.dumps(fit_to_json(fit), indent=1, allow_nan=False, ensure_ascii=False)
    Path(path).write_text(text + "\n", encoding="utf-8")


def _estimate(one: Estimate) -> dict[str, Any]:
    row = asdict(one)
    row["confidence_interval"] = list(one.confidence_interval)
    return row


def plain(value: Any) -> Any:
    """The value with null for every number that is not finite."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
