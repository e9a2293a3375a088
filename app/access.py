"""Who may use a session: whoever brings its token, as a cookie or as a bearer.

The token is random, given once, and kept only as a hash. A session that is not the caller's looks
exactly like one that does not exist.
"""

import hmac
from typing import Annotated

from fastapi import Depends, Request, Response
from starlette.requests import HTTPConnection

from .callers import caller_of
from .errors import Forbidden, NotFound
from .samples import sample_project
from .services import services_of

COOKIE = "ridetune_"
COOKIE_SECONDS = 400 * 24 * 3600


def session_of(connection: HTTPConnection, sid: str) -> str:
    """The session's id if the caller holds its token; NotFound otherwise."""
    token = bearer(connection) or connection.cookies.get(COOKIE + sid, "")
    if not token or not services_of(connection).store.sessions.holds(sid, token):
        raise NotFound("There is no such session, or it is not yours; open the start page.")
    return sid


def own_session(request: Request) -> str | None:
    """A session the browser already holds the cookie of, the latest it was given."""
    store = services_of(request).store
    for name, token in reversed(request.cookies.items()):
        sid = name.removeprefix(COOKIE)
        if sid != name and store.sessions.holds(sid, token):
            return sid
    return None


def bearer(connection: HTTPConnection) -> str:
    """Token in the Authorization header, or nothing."""
    kind, _, token = connection.headers.get("authorization", "").partition(" ")
    return token.strip() if kind.lower() == "bearer" else ""


def require_service_token(connection: HTTPConnection, token: str) -> None:
    """Refuse who does not bring the service's own token, where one is configured."""
    expected = services_of(connection).settings.token
    if expected and not hmac.compare_digest(token.encode(), expected.encode()):
        raise Forbidden(
            "This service asks for its token; open the link with ?token=... that it was started "
            "with, or send it as a bearer."
        )


def give_session(connection: HTTPConnection, response: Response) -> tuple[str, str]:
    """Id and token of a fresh session, its cookie set on the response."""
    services_of(connection).callers.open_session(caller_of(connection))
    project = sample_project()
    sid, token = services_of(connection).store.sessions.create(
        project.vehicle, project.measurements
    )
    response.set_cookie(
        COOKIE + sid,
        token,
        max_age=COOKIE_SECONDS,
        httponly=True,
        samesite="strict",
        secure=connection.url.scheme == "https",
    )
    return sid, token


def _session(request: Request, sid: str) -> str:
    return session_of(request, sid)


SessionId = Annotated[str, Depends(_session)]
