"""The service's health, for whoever watches over it: no login, and nothing told of the inside."""

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter
from fastapi.responses import JSONResponse

from .services import Shared

router = APIRouter(tags=["health"])


@router.get("/healthz")
async def healthz() -> dict[str, str]:
    """The service runs: its event loop answers."""
    return {"state": "running"}


@router.get("/readyz", responses={503: {"description": "Not all of it; which part is not ready."}})
async def readyz(services: Shared) -> JSONResponse:
    """The service does its work: 200 with all of its parts, else 503; state and sentence of the
    first that is not ready, and of each part.
    """
    parts = await services.readiness.parts()
    worst = next((part for part in parts.values() if not part.ready), parts["kernels"])
    body: dict[str, Any] = asdict(worst) | {
        "parts": {name: asdict(part) for name, part in parts.items()}
    }
    return JSONResponse(body, 200 if worst.ready else 503)
