"""Browsers that were let in, and the links that let one in each.

A link is used up when it is opened. A browser stays let in for as long as it comes back now and
then, and, where it was let in by the service's token, for as long as that stays the same. Of all
only a hash is kept, so what lies in the database lets nobody in.
"""

import time
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass

from sqlalchemy import ColumnElement, delete, insert, or_, select, update

from ..errors import NotFound, Unavailable
from .database import Database
from .secret import hashed, marked, new_secret
from .tables import browsers, links

LINK_SECONDS = 24 * 3600.0
BROWSER_SECONDS = 90 * 24 * 3600.0
"""How long a browser that does not come back stays let in."""
RENEW_EVERY = 3600.0
ID_LENGTH = 12


@dataclass(frozen=True)
class Browser:
    """What is known of a browser; its `id` opens nothing.

    by_token : whether it was let in by the service's token, else by a link
    came : when it came last, to `RENEW_EVERY`
    """

    id: str
    by_token: bool
    created: float
    came: float


class BrowserStore:
    """Who was let in by a link or by the service's token."""

    def __init__(self, database: Database, removed: Callable[[], None] = lambda: None):
        """removed : called once browsers have been ended"""
        self._database = database
        self._removed = removed

    def make_link(self) -> str:
        """The secret of a link that lets one browser in within a day."""
        secret, now = new_secret(), time.time()
        with self._database.writing() as connection:
            connection.execute(delete(links).where(links.c.expires < now))
            connection.execute(
                insert(links).values(hash=hashed(secret), expires=now + LINK_SECONDS)
            )
        return secret

    def use_link(self, secret: str) -> bool:
        """Use a link up; whether there was one."""
        ours = links.c.hash == hashed(secret)
        with self._database.reading() as connection:
            if connection.execute(select(links.c.hash).where(ours)).first() is None:
                return False
        with self._database.writing() as connection:
            alive = ours & (links.c.expires >= time.time())
            return connection.execute(delete(links).where(alive)).rowcount == 1

    def let_in(self, token: str = "") -> str:
        """The secret of one more browser, let in by the service's token or, without one, a link."""
        secret, now, mark = new_secret(), time.time(), self._mark(token)
        with self._database.writing() as connection:
            connection.execute(delete(browsers).where(browsers.c.expires < now))
            connection.execute(
                insert(browsers).values(
                    hash=hashed(secret),
                    created=now,
                    expires=now + BROWSER_SECONDS,
                    token_mark=mark,
                )
            )
        return secret

    def knows(self, secret: str, token: str = "") -> bool:
        """Whether a browser was let in, by a link or by the token that the service has now; it
        stays so for as long again.
        """
        now, ours = time.time(), (browsers.c.hash == hashed(secret)) & self._holds(token)
        with self._database.reading() as connection:
            expires = connection.execute(select(browsers.c.expires).where(ours)).scalar()
        if expires is None or expires < now:
            return False
        if expires < now + BROWSER_SECONDS - RENEW_EVERY:
            # Where nothing can be written, what is kept may still be looked at.
            with suppress(Unavailable), self._database.writing() as connection:
                connection.execute(
                    update(browsers).where(ours).values(expires=now + BROWSER_SECONDS)
                )
        return True

    def list(self) -> list[Browser]:
        """All that are let in, in the order in which they were."""
        columns = (browsers.c.hash, browsers.c.token_mark, browsers.c.created, browsers.c.expires)
        alive = select(*columns).where(browsers.c.expires >= time.time())
        with self._database.reading() as connection:
            rows = connection.execute(alive.order_by(browsers.c.created, browsers.c.hash)).all()
        return [
            Browser(
                row.hash[:ID_LENGTH],
                row.token_mark is not None,
                row.created,
                row.expires - BROWSER_SECONDS,
            )
            for row in rows
        ]

    def remove(self, ids: Collection[str]) -> None:
        """End browsers, all or none of them; NotFound where there is none of an id."""
        with self._database.writing() as connection:
            for id in ids:
                its = browsers.c.hash.startswith(id, autoescape=True)
                if (
                    len(id) != ID_LENGTH
                    or not connection.execute(delete(browsers).where(its)).rowcount
                ):
                    raise NotFound(
                        f"There is no browser {id!r}; `ridetune browsers list` shows those there "
                        "are."
                    )
        self._removed()

    def remove_others(self, token: str) -> None:
        """End those that were let in by a token which the service has no more."""
        with self._database.writing() as connection:
            connection.execute(delete(browsers).where(~self._holds(token)))
        self._removed()

    def _mark(self, token: str) -> str | None:
        return marked(token, self._database.id) if token else None

    def _holds(self, token: str) -> ColumnElement[bool]:
        by_link = browsers.c.token_mark.is_(None)
        return or_(by_link, browsers.c.token_mark == self._mark(token)) if token else by_link
