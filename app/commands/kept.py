"""The service's database, opened beside a service that runs."""

from collections.abc import Iterator
from contextlib import contextmanager

from ..data_directory import database_of, make_private
from ..database import Database
from ..errors import StartError
from ..settings import Settings
from ..store import database_beside


@contextmanager
def kept(settings: Settings, *, new: bool = False) -> Iterator[Database]:
    """The database of a data directory that a service has used, or, `new`, will use."""
    if not (new or settings.database or database_of(settings.data).exists()):
        raise StartError(
            f"No service has used the data directory {settings.data} yet; start one with `ridetune "
            "serve`, or name another with --data."
        )
    try:
        make_private(settings.data)
    except OSError as error:
        raise StartError(
            f"The data directory {settings.data} cannot be used ({error.strerror}); "
            "choose another with --data."
        ) from None
    database = database_beside(settings.data, settings.database)
    try:
        yield database
    finally:
        database.close()
