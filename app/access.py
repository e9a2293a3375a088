"""Who may use a session: the user to whom it belongs, or whoever brings its token.

The token comes as a cookie or as a bearer; it is random, given once, and kept only as a hash. A
session that is not the caller's looks exactly like one that does not exist.
"""

from typing import Annotated

from fastapi import Depends, Request, Response
from starlette.requests import HTTPConnection

from . import cookies
from .callers import caller_of
from .errors import NotFound
from .login import is_let_in, require_let_in, user_of
from .origins import bearer
from .owner_store import OwnSession
from .samples import sample_project
from .services import services_of


def session_of(connection: HTTPConnection, sid: str) -> str:
    """The session's id if it is the caller's; NotFound otherwise."""
    owners = services_of(connection).store.owners
    token = bearer(connection.headers) or cookies.session_token(connection, sid)
    if not owners.opens(sid, user=user_of(connection), token=token):
        raise NotFound(
            "There is no such session, or it is not yours; the start page leads to your own."
        )
    return sid


def own_sessions(connection: HTTPConnection) -> list[OwnSession]:
    """The caller's sessions, those used latest first."""
    brought = bearer(connection.headers)
    tokens = [brought] if brought else list(cookies.session_tokens(connection))
    return services_of(connection).store.owners.sessions(user=user_of(connection), tokens=tokens)


def require_visitor(request: Request) -> None:
    """Refuse who neither may use the service nor holds a session of it."""
    if not is_let_in(request) and not own_sessions(request):
        require_let_in(request)


def give_session(connection: HTTPConnection, response: Response) -> dict[str, str]:
    """A fresh session: its id, and its token where no user owns it, set as a cookie as well."""
    project, user = sample_project(), user_of(connection)
    services_of(connection).callers.open_session(user or caller_of(connection))
    sid, token = services_of(connection).store.sessions.create(
        project.vehicle, project.measurements, user
    )
    if user is not None:
        return {"id": sid}
    cookies.give_session_token(connection, response, sid, token)
    return {"id": sid, "token": token}


def _session(request: Request, sid: str) -> str:
    return session_of(request, sid)


SessionId = Annotated[str, Depends(_session)]
