"""The service's health, for whoever watches over it: no login, and nothing told of the inside."""

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter
from fastapi.responses import JSONResponse

from ..web.services import Shared

router = APIRouter(tags=["health"])


@router.get("/healthz")
async def healthz() -> dict[str, str]:
    """The service runs: its event loop answers."""
    return {"state": "running"}


@router.get("/readyz", responses={503: {"description": "It does not; which part is not ready."}})
async def readyz(services: Shared) -> JSONResponse:
    """The service does its work: 200, be it that jobs wait (`degraded`), else 503; state and
    sentence of the worst part, and of each.
    """
    parts = await services.readiness.parts()
    wanting = sorted((one for one in parts.values() if not one.ready), key=lambda one: one.serves)
    worst = wanting[0] if wanting else parts["kernels"]
    body: dict[str, Any] = asdict(worst) | {
        "parts": {name: asdict(part) for name, part in parts.items()}
    }
    return JSONResponse(body, 200 if worst.serves else 503)
