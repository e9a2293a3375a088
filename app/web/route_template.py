"""Which route a request took, without what its address says of the caller."""

from starlette.types import Scope


def route_of(scope: Scope) -> str:
    """The template of the address, of which there are few; `unknown` where there is nothing."""
    if (route := scope.get("route")) is not None:
        return route.path
    return "/static" if scope["path"].startswith("/static/") else "unknown"
