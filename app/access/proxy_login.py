"""The user whom a proxy in front of the service names, where one is set up.

The header counts only from the proxy's own address, the other end of the connection. From anywhere
else it is refused, so that a wrong set-up shows itself.
"""

from starlette.datastructures import Headers
from starlette.types import Scope

from ..addresses import is_in
from ..settings import Settings

NAME_LENGTH = 200


def refusal(scope: Scope, settings: Settings) -> str | None:
    """Why what is told of a user may not be believed, or None."""
    named = _named(scope, settings)
    if not named:
        return None
    if not is_in((scope.get("client") or ("", 0))[0], settings.proxy_addresses):
        return (
            f"Only the proxy may send {settings.proxy_user_header}; if this is the proxy, add its "
            "address to RIDETUNE_PROXY_ADDRESSES."
        )
    if len(named) > 1 or len(named[0]) > NAME_LENGTH:
        return (
            f"{settings.proxy_user_header} must come once and name a user in at most {NAME_LENGTH} "
            "characters; let the proxy replace what visitors send."
        )
    return None


def proxy_user(scope: Scope, settings: Settings) -> str | None:
    """Name of the user by the proxy's word; a request that `refusal` has let pass."""
    named = _named(scope, settings)
    return named[0].strip() or None if named else None


def _named(scope: Scope, settings: Settings) -> list[str]:
    header = settings.proxy_user_header
    return Headers(scope=scope).getlist(header) if header else []
