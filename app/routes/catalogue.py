"""What comes with the service and is the same for everybody: tables, cars, manoeuvres, roads.

Manoeuvres and roads bring scipy with them, which takes longer to import than the rest of the
service to start; they are imported when they are first asked for.
"""

from dataclasses import asdict
from typing import Annotated, Any, get_args

import numpy as np
from fastapi import APIRouter, Depends
from pydantic import Field
from starlette.concurrency import run_in_threadpool

from ...engine.channels import CHANNELS
from ...engine.errors import ParameterError
from ...engine.parameters import (
    ALL_PARAMETERS,
    DAMPER_NAMES,
    DAMPER_STARTS,
    bounds_rule,
    default_bounds,
    parameter,
)
from ...engine.run_notes import DEFAULT_NOISE
from ...engine.vehicle import numbers
from ...engine.vehicle_file import reference_vehicles, vehicle_to_json
from ..access.sessions import require_visitor
from ..errors import NotFound
from ..schemas import RimsSettingsForm, RoadPreview, StartValues
from ..web.services import Shared
from ..work.plants import PLANTS
from .strict_json import StrictRoute
from .uploads import Upload, openapi, receive

router = APIRouter(
    prefix="/api",
    tags=["catalogue"],
    route_class=StrictRoute,
    dependencies=[Depends(require_visitor)],
)

Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Sensors = Annotated[Upload, Depends(receive("sensors.toml"))]


@router.get("/parameters")
def parameters() -> list[dict[str, Any]]:
    """The parameters of an identification, their sliders and what is accepted, SI.

    linear_start : of those that a car with linear dampers lacks, where a search begins; else null
    """
    return [
        {
            **asdict(row),
            **_accepted(row.name),
            "bounds_rule": bounds_rule(row.name),
            "linear_start": DAMPER_STARTS[row.name.rpartition(".")[2]]
            if row.name in DAMPER_NAMES
            else None,
        }
        for row in ALL_PARAMETERS
    ]


def _accepted(name: str) -> dict[str, float]:
    """What a vehicle takes: `lower` to `upper`, and at least `apart` from zero."""
    accepted = numbers()[name]
    return {"lower": accepted.lower, "upper": accepted.upper, "apart": accepted.apart}


@router.post("/parameters/bounds")
def bounds(request: StartValues) -> dict[str, Pair | None]:
    """Default bounds of a fit from these start values; null where none follow from the start."""
    return {parameter(name).name: _bounds(name, start) for name, start in request.start.items()}


def _bounds(name: str, start: float) -> Pair | None:
    try:
        return list(default_bounds(name, start))
    except ParameterError:
        return None


@router.get("/channels")
def channels() -> list[dict[str, Any]]:
    """Every channel: name, SI unit, how a page shows it, and noise where none is stated, SI."""
    shown = ("name", "label", "quantity", "unit", "display_unit", "display_factor", "sign")
    return [
        {**{key: getattr(info, key) for key in shown}, "default_noise": DEFAULT_NOISE.get(name)}
        for name, info in CHANNELS.items()
    ]


@router.get("/rims-settings")
def rims_settings() -> dict[str, Any]:
    """How recordings are prepared for the rims mode unless a request says otherwise."""
    return RimsSettingsForm().model_dump()


@router.get("/vehicles")
def vehicles() -> list[dict[str, str]]:
    """The reference cars."""
    return [
        {"key": key, "name": vehicle.name, "source": getattr(vehicle, "source", "")}
        for key, vehicle in reference_vehicles().items()
    ]


@router.get("/vehicles/{key}")
def vehicle(key: str) -> dict[str, Any]:
    """One reference car."""
    known = reference_vehicles()
    if key not in known:
        raise NotFound(f"There is no reference car by that key; there are {', '.join(known)}.")
    return vehicle_to_json(known[key])


@router.get("/manoeuvres")
def manoeuvres() -> list[dict[str, Any]]:
    """The manoeuvres that come with the service."""
    from ...engine.manoeuvre import reference_manoeuvres

    shown = ("name", "kind", "description", "duration")
    return [
        {"key": key, **{field: getattr(manoeuvre, field) for field in shown}}
        for key, manoeuvre in reference_manoeuvres().items()
    ]


@router.get("/manoeuvres/{key}")
def manoeuvre(key: str) -> dict[str, Any]:
    """One manoeuvre as data, to change and send back with a simulation."""
    from ...engine.manoeuvre import manoeuvre_to_json
    from ..work.excitation import known_manoeuvre

    return manoeuvre_to_json(known_manoeuvre(key))


@router.get("/plants")
def plants() -> list[dict[str, Any]]:
    """The cars that a campaign can drive.

    effort : s that a driven second takes, about;  missing : why one cannot be driven here, else ""
    """
    shown = ("name", "takes_vehicle", "effort")
    return [
        {"key": key, **{field: getattr(one, field) for field in shown}, "missing": one.missing()}
        for key, one in PLANTS.items()
    ]


@router.get("/formats")
def formats() -> list[dict[str, str]]:
    """The forms of a campaign's recordings; missing : why one cannot be written here, else ""."""
    from ...engine.formats.readers import missing_package

    return [
        {"key": "csv", "name": "CSV", "missing": ""},
        {"key": "mf4", "name": "MDF4", "missing": missing_package("MDF4")},
    ]


@router.post("/sensors", openapi_extra=openapi("application/toml"))
async def sensors(services: Shared, received: Sensors) -> dict[str, Any]:
    """A file of sensors, TOML or JSON, checked: `sensors` as a campaign takes them, the channels
    that they record, and the samples a second.
    """
    return await run_in_threadpool(
        _sensors, received.read(services.settings.limits.body_bytes), received.name
    )


def _sensors(data: bytes, name: str) -> dict[str, Any]:
    from ...engine.sensor_file import content_of, sensors_from_json

    content = content_of(data, name)
    found = sensors_from_json(content, name)
    return {"sensors": content, "channels": list(found.sensors), "rate_hz": found.rate_hz}


@router.get("/roads")
def roads() -> dict[str, Any]:
    """What a road can be made of."""
    from ...engine.roads.iso8608 import Coherence
    from ...engine.roads.road_specs import RoadClass, RoadSpec

    return {
        "kinds": [kind.kind for kind in get_args(RoadSpec)],
        "classes": list(get_args(RoadClass)),
        "coherence": list(get_args(Coherence)),
    }


@router.post("/roads/preview")
def preview(request: RoadPreview) -> dict[str, list[float]]:
    """Both tracks of a road, sampled evenly."""
    from ...engine.roads.road_specs import Place, road_spec_from_json

    spec = road_spec_from_json(request.road)
    road = spec.build(Place(0.0, request.torque_end, request.length), request.seed)
    x = np.linspace(0.0, request.length, request.points)
    return {
        "x": x.tolist(),
        "left": road.height(0, x).tolist(),
        "right": road.height(1, x).tolist(),
    }
