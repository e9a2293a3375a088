"""The cookies of the service: random secrets that no script reads and no other site sends.

Cookies are shared by the ports of a host, so the access cookie is named after the port, and a
session's after the session. By https they are bound to the host besides (`__Host-`).
"""

from collections.abc import Iterator

from fastapi import Response
from starlette.requests import HTTPConnection

from ..web.services import services_of

ACCESS = "ridetune-access"
SESSION = "ridetune_"
BOUND = "__Host-"
SECONDS = 400 * 24 * 3600
"""As long as browsers keep a cookie at most; what it is good for ends by our own clock."""


def access_secret(connection: HTTPConnection) -> str:
    """What the browser got when it was let in, or nothing."""
    return connection.cookies.get(_access(connection), "")


def session_token(connection: HTTPConnection, sid: str) -> str:
    """The token of a session that the browser holds, or nothing."""
    return connection.cookies.get(_session(connection, sid), "")


def session_tokens(connection: HTTPConnection) -> Iterator[str]:
    """Tokens of all sessions that the browser holds."""
    beginning = _session(connection, "")
    return (token for name, token in connection.cookies.items() if name.startswith(beginning))


def give_access(connection: HTTPConnection, response: Response, secret: str) -> None:
    """Let the browser keep what shows that it was let in."""
    _give(connection, response, _access(connection), secret)


def give_session_token(
    connection: HTTPConnection, response: Response, sid: str, token: str
) -> None:
    """Let the browser keep the token of a session."""
    _give(connection, response, _session(connection, sid), token)


def renew(connection: HTTPConnection, response: Response, sid: str) -> None:
    """Let the browser keep what it has for its access and a session for as long again."""
    for name in (_access(connection), _session(connection, sid)):
        if secret := connection.cookies.get(name):
            _give(connection, response, name, secret)


def forget_session(connection: HTTPConnection, response: Response, sid: str) -> None:
    """Let the browser forget a session."""
    response.delete_cookie(
        _session(connection, sid), secure=_https(connection), httponly=True, samesite="strict"
    )


def _give(connection: HTTPConnection, response: Response, name: str, secret: str) -> None:
    response.set_cookie(
        name,
        secret,
        max_age=SECONDS,
        secure=_https(connection),
        httponly=True,
        samesite="strict",
    )


def _access(connection: HTTPConnection) -> str:
    port = connection.url.port
    return _bound(connection) + ACCESS + (f"-{port}" if port else "")


def _session(connection: HTTPConnection, sid: str) -> str:
    return _bound(connection) + SESSION + sid


def _bound(connection: HTTPConnection) -> str:
    return BOUND if _https(connection) else ""


def _https(connection: HTTPConnection) -> bool:
    return services_of(connection).settings.https
