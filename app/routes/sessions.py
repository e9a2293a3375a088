"""Sessions: one visitor's car, its baseline, measurements, identifications and sweeps.

What is asked for most goes to a thread once; of a handler that is not asynchronous FastAPI sends
the reply's check to a second one.
"""

from typing import Annotated, Any

from fastapi import APIRouter, Body, Request, Response
from starlette.concurrency import run_in_threadpool

from ...engine.vehicle_file import vehicle_from_json, vehicle_to_json
from ..access import cookies
from ..access.login import require_let_in
from ..access.sessions import SessionId, give_session, own_sessions
from ..instants import instant
from ..recordings.measurement_view import measurements_to_json
from ..schemas import JsonObject, NewSession, SessionNameForm
from ..setup_form import SetupForm
from ..storage.owner_store import OwnSession
from ..web.services import Shared
from .identifications import VIEW as IDENTIFICATION
from .jobs import all_to_json
from .strict_json import StrictRoute
from .sweeps import VIEW as SWEEP

router = APIRouter(prefix="/api/sessions", tags=["sessions"], route_class=StrictRoute)

UNNAMED = NewSession()
VehicleBody = Annotated[JsonObject, Body(description="A vehicle as docs/files describes it, SI.")]


@router.post("", status_code=201)
def create(request: Request, response: Response, body: NewSession = UNNAMED) -> dict[str, str]:
    """A fresh session with the sample project, called as the body says, if one is sent. Its token
    comes as a cookie and in the reply; who brings a key, or is named by the proxy, owns it and
    needs none.
    """
    require_let_in(request)
    return give_session(request, response, body.name)


@router.get("")
def sessions(request: Request) -> list[dict[str, Any]]:
    """The caller's own sessions, those used latest first."""
    return [_summary(one) for one in own_sessions(request)]


@router.get("/{sid}")
def read(sid: SessionId, services: Shared) -> dict[str, Any]:
    """Everything in the session, results of its jobs apart."""
    session = services.store.sessions.get(sid)
    return {
        "id": sid,
        "name": session.name,
        "vehicle": session.vehicle,
        "baseline": session.baseline,
        "setup": session.setup,
        "measurements": measurements_to_json(services.store, sid),
        "identifications": all_to_json(services, sid, IDENTIFICATION),
        "sweeps": all_to_json(services, sid, SWEEP),
    }


@router.patch("/{sid}")
def rename(sid: SessionId, services: Shared, body: SessionNameForm) -> dict[str, Any]:
    """Call the session something else."""
    services.store.sessions.rename(sid, body.name)
    return _summary(services.store.owners.session(sid))


@router.delete("/{sid}", status_code=204)
def delete(request: Request, sid: SessionId, services: Shared, response: Response) -> None:
    """Remove the session with all it holds; what runs in it is cancelled."""
    services.jobs.cancel_all(sid)
    services.viewers.stop(sid)
    services.store.sessions.delete(sid)
    cookies.forget_session(request, response, sid)


@router.get("/{sid}/vehicle")
async def vehicle(sid: SessionId, services: Shared) -> dict[str, Any]:
    """The car being tuned."""
    return (await run_in_threadpool(services.store.sessions.get, sid)).vehicle


@router.put("/{sid}/vehicle")
def set_vehicle(sid: SessionId, services: Shared, body: VehicleBody) -> dict[str, Any]:
    """Replace the car being tuned; a fit.json is taken too, for its vehicle."""
    checked = vehicle_to_json(vehicle_from_json(body))
    services.store.sessions.set_vehicle(sid, checked)
    return checked


@router.get("/{sid}/baseline")
async def baseline(sid: SessionId, services: Shared) -> dict[str, Any]:
    """The car it is compared with."""
    return (await run_in_threadpool(services.store.sessions.get, sid)).baseline


@router.put("/{sid}/baseline")
def set_baseline(sid: SessionId, services: Shared, body: VehicleBody) -> dict[str, Any]:
    """Replace the car it is compared with."""
    checked = vehicle_to_json(vehicle_from_json(body))
    services.store.sessions.set_baseline(sid, checked)
    return checked


@router.get("/{sid}/setup")
async def setup(sid: SessionId, services: Shared) -> dict[str, Any] | None:
    """What the page will ask of the next identification; null while nothing was chosen."""
    return (await run_in_threadpool(services.store.sessions.get, sid)).setup


@router.patch("/{sid}/setup")
def change_setup(sid: SessionId, services: Shared, body: SetupForm) -> dict[str, Any]:
    """Change parts of it; what is told of a measurement goes with it."""
    return services.store.setups.change(sid, body)


def _summary(session: OwnSession) -> dict[str, Any]:
    return {
        "id": session.id,
        "name": session.name,
        "created": instant(session.created),
        "seen": instant(session.seen),
        "measurement_count": session.measurements,
    }
