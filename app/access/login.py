"""Who may use the service, apart from whose a session is (sessions.py).

It is whoever brings an API key or the service's token as a bearer, a user whom the proxy names, and
a browser that was let in once: by a link that is good for one browser, or by the service's token in
the address. Keys and the proxy tell who it is; their sessions belong to that user. Who brings a key
that is not known is told so, whatever else would let them in.
"""

import hmac

from fastapi import Response
from starlette.requests import HTTPConnection

from .. import logs
from ..errors import Forbidden, UnknownKey
from ..storage.key_store import PREFIX
from ..web.callers import caller_of
from ..web.services import services_of
from . import cookies
from .origins import bearer
from .proxy_login import proxy_user


def user_of(connection: HTTPConnection) -> str | None:
    """Who calls, where that is known: `key:` or `user:` and a name; told in the log."""
    if (key := _key_of(connection)) is not None:
        user = f"key:{key}"
    elif (named := proxy_user(connection.scope, services_of(connection).settings)) is not None:
        user = f"user:{named}"
    else:
        return None
    logs.tell(user=user)
    return user


def is_let_in(connection: HTTPConnection) -> bool:
    """Whether the caller may use the service and begin sessions."""
    services = services_of(connection)
    if not services.settings.login or user_of(connection) is not None:
        return True
    if brought := bearer(connection.headers):
        return _is_service_token(connection, brought)
    secret = cookies.access_secret(connection)
    return bool(secret) and services.store.browsers.knows(secret, services.settings.token)


def brings_secret(connection: HTTPConnection) -> bool:
    """Whether the caller's bearer is an API key or the service's token, as a program's is."""
    known = _key_of(connection) is not None
    return known or _is_service_token(connection, bearer(connection.headers))


def require_let_in(connection: HTTPConnection) -> None:
    """Refuse who may not use the service."""
    if not is_let_in(connection):
        raise Forbidden(
            "This service asks who you are; open the link that `ridetune link` prints, or send a "
            "key of `ridetune keys add` or the service's token as a bearer."
        )


def let_in(connection: HTTPConnection, response: Response, token: str) -> bool:
    """Let the browser in if its address holds the service's token or a link's, which is used up."""
    services = services_of(connection)
    browsers, known = services.store.browsers, _is_service_token(connection, token)
    if not (known or browsers.use_link(token)):
        return False
    if not is_let_in(connection):
        if known:  # which, unlike a link, can be brought as often as one likes
            services.callers.let_in(caller_of(connection))
        secret = browsers.let_in(services.settings.token if known else "")
        cookies.give_access(connection, response, secret)
    return True


def _key_of(connection: HTTPConnection) -> str | None:
    """Name of the key that is brought, None where the bearer is no key, or there is none."""
    brought, store = bearer(connection.headers), services_of(connection).store
    name = store.keys.name_of(brought)
    if name is None and brought.startswith(PREFIX):
        # Other tokens may begin like a key: the service's as it was chosen, a session's by chance.
        opens = store.owners.sessions(user=None, tokens=[brought])
        if not (opens or _is_service_token(connection, brought)):
            raise UnknownKey
    return name


def _is_service_token(connection: HTTPConnection, brought: str) -> bool:
    expected = services_of(connection).settings.token
    return bool(expected) and hmac.compare_digest(
        brought.encode(errors="replace"), expected.encode(errors="replace")
    )
