"""Browsers that were let in, and the links that let one in each.

A link is used up when it is opened. A browser stays let in for as long as it comes back now and
then. Of both only the hash is kept, so what lies in the database lets nobody in.
"""

import time
from contextlib import suppress

from sqlalchemy import delete, insert, select, update

from .database import Database
from .errors import Unavailable
from .secret import hashed, new_secret
from .tables import browsers, links

LINK_SECONDS = 24 * 3600.0
BROWSER_SECONDS = 90 * 24 * 3600.0
"""How long a browser that does not come back stays let in."""
RENEW_EVERY = 3600.0


class BrowserStore:
    """Who was let in by a link."""

    def __init__(self, database: Database):
        self._database = database

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

    def let_in(self) -> str:
        """The secret of one more browser."""
        secret, now = new_secret(), time.time()
        with self._database.writing() as connection:
            connection.execute(delete(browsers).where(browsers.c.expires < now))
            connection.execute(
                insert(browsers).values(
                    hash=hashed(secret), created=now, expires=now + BROWSER_SECONDS
                )
            )
        return secret

    def knows(self, secret: str) -> bool:
        """Whether a browser was let in; it stays so for as long again."""
        now, ours = time.time(), browsers.c.hash == hashed(secret)
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
