"""The service's database, opened beside a service that runs."""

from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import StartError
from ..settings import Settings
from ..storage.data_directory import is_used, make_private, usable
from ..storage.database import Database
from ..storage.store import database_beside


@contextmanager
def kept(settings: Settings, *, new: bool = False, files: bool = False) -> Iterator[Database]:
    """The database of a data directory that a service has used, or, `new`, will use.

    files : whether the directory itself is needed, too, where the rows are in PostgreSQL
    """
    data = settings.data
    with usable(data):
        if (files or not settings.database) and not is_used(data):
            if not new:
                raise StartError(
                    f"No service has used the data directory {data} yet; start one with `ridetune "
                    "serve`, or name another with --data."
                )
            make_private(data)
        database = database_beside(data, settings.database)
    try:
        yield database
    finally:
        database.close()


def place(settings: Settings) -> str:
    """Where a command looks, as a person is told."""
    shared = "the database of RIDETUNE_DATABASE"
    return shared if settings.database else f"the data directory {settings.data.absolute()}"
