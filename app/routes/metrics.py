"""The service's metrics in Prometheus' text format: for this machine, or for who has a key."""

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

from ..access.login import brings_secret
from ..addresses import is_loopback
from ..errors import Forbidden
from ..web.services import Shared

router = APIRouter()

FORWARDED = ("forwarded", "via", "x-forwarded-for", "x-forwarded-host", "x-real-ip")


@router.get("/metrics", include_in_schema=False)
def metrics(request: Request, services: Shared) -> Response:
    """Every number there is; looked up off the event loop."""
    if not (_is_from_here(request) or brings_secret(request)):
        raise Forbidden(
            "Metrics are for this machine, or for who sends a key of `ridetune keys add` or the "
            "service's token as a bearer."
        )
    return Response(generate_latest(services.metrics.registry), media_type=CONTENT_TYPE_LATEST)


def _is_from_here(request: Request) -> bool:
    """Whether this machine asks for itself, and not a proxy on it for somebody else."""
    forwarded = any(name in request.headers for name in FORWARDED)
    return request.client is not None and is_loopback(request.client.host) and not forwarded
