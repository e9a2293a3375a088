"""A fit read back from its JSON: the car, what was free, and how well it is known."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..errors import ProblemError, RideError
from ..json_text import read_json
from ..parameters import parameter
from ..simulation.braking import Interval
from ..simulation.rims_settings import RimsSettings
from ..simulation.simulate import Traction
from ..vehicle import Vehicle
from ..vehicle_file import vehicle_from_json
from .loss import Loss
from .problem import FreeParameter
from .sensor_model import asked_in
from .uncertainty import Uncertainty

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class KeptFit:
    """A fit without its runs.

    vehicle : with the fitted values
    free : what was free, with the search's variables
    errors : of these variables
    braking : where the car was taken to brake, by the runs' names, s
    priors : (mean, standard deviation) by parameter, SI
    sensors : what was known of them and what was found, as a problem takes it
    ended : the JSON
    """

    vehicle: Vehicle
    free: tuple[FreeParameter, ...]
    errors: Uncertainty
    traction: Traction
    settings: RimsSettings
    braking: Mapping[str, tuple[Interval, ...]]
    loss: Loss = Loss()
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    sensors: Mapping[str, Mapping[str, float | str]] = field(default_factory=dict)
    ended: Mapping[str, Any] = field(default_factory=dict)

    @property
    def x(self) -> Array:
        """(n,) the search's variables at the solution."""
        return np.array([one.variable(self.vehicle.value(one.name)) for one in self.free])


def is_fit(data: Any) -> bool:
    """Whether parsed JSON is a fit rather than a vehicle."""
    return isinstance(data, Mapping) and "vehicle" in data and "parameters" in data


def read_fit(path: str | Path) -> KeptFit:
    """Read a fit's file; ProblemError names what it lacks."""
    path = Path(path)
    return fit_from_json(read_json(path, ProblemError), path.name)


def fit_from_json(data: Any, source: str = "fit") -> KeptFit:
    """A fit from parsed JSON; `source` heads every message."""
    if not is_fit(data):
        raise ProblemError(f"{source}: this is no fit; give what an identification wrote.")
    vehicle = vehicle_from_json(data, source)
    try:
        free = tuple(
            FreeParameter(
                parameter(row["name"]).name,
                *(float(row[name]) for name in ("start", "lower", "upper")),
            )
            for row in data["parameters"]
        )
        n = len(free)
        errors = Uncertainty(
            np.array(data["covariance"], dtype=np.float64).reshape(n, n),
            np.array(data["unknown"], dtype=np.float64).reshape(-1, n),
            float(data["quantile"]),
            np.full(n, np.nan),
        )
        kept = KeptFit(
            vehicle,
            free,
            errors,
            cast(Traction, data["traction"]),
            RimsSettings(**data["settings"]),
            {
                run["name"]: tuple((float(begin), float(end)) for begin, end in run["braking"])
                for run in data["runs"]
            },
            Loss(data["loss"], float(data["loss_scale"])),
            {one["name"]: (float(one["mean"]), float(one["deviation"])) for one in data["priors"]},
            asked_in(data),
            data,
        )
        finite = np.all(np.isfinite(errors.covariance)) and np.all(np.isfinite(kept.x))
    except (KeyError, TypeError, ValueError, IndexError, RideError) as error:
        raise ProblemError(
            f"{source}: this fit cannot be read ({error}); write it anew with ridetune identify."
        ) from error
    if not (finite and n):
        raise ProblemError(f"{source}: the fit's covariance is not finite; fit anew.")
    return kept
