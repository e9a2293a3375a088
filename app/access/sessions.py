"""Who may use a session: the user to whom it belongs, or whoever brings its token.

The token comes as a cookie or as a bearer; it is random, given once, and kept only as a hash. A
session that is not the caller's looks exactly like one that does not exist.
"""

from collections.abc import Callable
from functools import partial
from typing import Annotated

from fastapi import Depends, Response
from starlette.concurrency import run_in_threadpool
from starlette.requests import HTTPConnection

from .. import logs
from ..errors import Busy, NotFound
from ..session_name import free_name
from ..storage.owner_store import OwnSession
from ..storage.secret import hashed
from ..web.callers import caller_of
from ..web.services import services_of
from ..work.samples import sample_project
from . import cookies
from .login import is_let_in, require_let_in, user_of
from .origins import bearer
from .proxy_login import proxy_user


def session_of(connection: HTTPConnection, sid: str) -> str:
    """The session's id if it is the caller's, asked of the database; NotFound otherwise, and
    UnknownKey for a key that is none.
    """
    _owner(connection, sid)
    return sid


async def opened_session(connection: HTTPConnection, sid: str) -> str:
    """As `session_of`, asked once in a request, and not of what was answered lately."""
    if getattr(connection.state, "opened", None) != sid:
        token = bearer(connection.headers) or cookies.session_token(connection, sid)
        user = await _remembered(connection, sid, token, partial(_owner, connection, sid))
        connection.state.opened, connection.state.user = sid, user or None
    return sid


def user_who_opened(connection: HTTPConnection) -> str | None:
    """Who calls, where that is known, of a request whose session `opened_session` has opened."""
    return connection.state.user


async def require_visitor(connection: HTTPConnection) -> None:
    """Refuse who neither may use the service nor holds a session of it."""
    if not getattr(connection.state, "visitor", False):
        brought = (
            bearer(connection.headers),
            cookies.access_secret(connection),
            *cookies.session_tokens(connection),
        )
        await _remembered(connection, "", "\n".join(brought), partial(_visitor, connection))
        connection.state.visitor = True


async def _remembered(
    connection: HTTPConnection, sid: str, secrets: str, look: Callable[[], str]
) -> str:
    """What `look` answers, or answered lately of the same secrets and the same word of the proxy,
    on which it must depend alone: the caller's name, or nothing. It raises for who may not pass.
    """
    services = services_of(connection)
    answers = services.store.answers
    question = sid, hashed(secrets), proxy_user(connection.scope, services.settings)
    user = answers.recall(question)
    if user is None:
        return await run_in_threadpool(answers.ask, question, look)
    if user:
        logs.tell(user=user)
    return user


def _owner(connection: HTTPConnection, sid: str) -> str:
    user, owners = user_of(connection), services_of(connection).store.owners
    token = bearer(connection.headers) or cookies.session_token(connection, sid)
    if not owners.opens(sid, user=user, token=token):
        raise NotFound(
            "There is no such session, or it is not yours; the start page leads to your own."
        )
    return user or ""


def _visitor(connection: HTTPConnection) -> str:
    if not is_let_in(connection) and not own_sessions(connection):
        require_let_in(connection)
    return user_of(connection) or ""


def own_sessions(connection: HTTPConnection) -> list[OwnSession]:
    """The caller's sessions, those used latest first."""
    brought = bearer(connection.headers)
    tokens = [brought] if brought else list(cookies.session_tokens(connection))
    return services_of(connection).store.owners.sessions(user=user_of(connection), tokens=tokens)


def give_session(
    connection: HTTPConnection, response: Response, name: str | None = None
) -> dict[str, str]:
    """A fresh session: its id and name, and its token where no user owns it, set as a cookie as
    well. Without a name it gets one that the caller's others do not have.
    """
    services, project, user = services_of(connection), sample_project(), user_of(connection)
    services.callers.open_session(user or caller_of(connection))
    own, most = own_sessions(connection), services.settings.limits.browser_sessions
    if user is None and len(own) >= most:
        raise Busy(
            f"This browser already has the tokens of {most} projects (sessions), and would lose "
            "some with more; delete one that is no longer needed."
        )
    named = name or free_name({one.name for one in own})
    sid, token = services.store.sessions.create(
        project.vehicle, project.measurements, user, named, used=name is not None
    )
    if user is not None:
        return {"id": sid, "name": named}
    cookies.give_session_token(connection, response, sid, token)
    return {"id": sid, "name": named, "token": token}


SessionId = Annotated[str, Depends(opened_session)]
