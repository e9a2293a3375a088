"""A process that simulates for the service: what happens in it.

It is forked from one that has loaded the kernels (`preload`), does one piece of work at a time, and
ends when the service does. What it has to know of the service it asks by the same connection: a
recording, once, and whether a session may simulate so many seconds.
"""

import os
import signal
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from ...engine.errors import RideError
from .. import logs
from ..recordings.lent import LentRecordings

BEHIND_THE_SERVICE = 5
"""By how much nicer than the service: what asks it for little is answered while every core
simulates, and jobs (19) still wait for both.
"""

READY, ASKED, DONE = "ready", "asked", "done"
REFUSED, FAILED, BROKEN = "refused", "failed", "broken"
"""What a message is; those of the simulator, and in answer to what it asked DONE or REFUSED."""

Work = Callable[..., Any]
"""A function of the `Host` and of what the service sends with it."""


class Refused(Exception):
    """The service does not answer what was asked; it knows why."""


class Host:
    """The service, as work in a simulator sees it."""

    def __init__(self, connection: Connection):
        self._connection = connection
        self.recordings = LentRecordings(lambda measurement: self.ask("recording", measurement))

    def ask(self, what: str, *about: Any) -> Any:
        """What the service answers to a question of those it was told to expect."""
        self._connection.send((ASKED, (what, about)))
        kind, answer = self._connection.recv()
        if kind == REFUSED:
            raise Refused
        return answer


def simulator(connection: Connection) -> None:
    """Do what comes until the other end is closed."""
    # Told by a terminal or a service manager, the service ends; what it still serves needs this.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    os.nice(BEHIND_THE_SERVICE)
    logs.configure_worker()
    host = Host(connection)
    with suppress(EOFError, OSError):
        connection.send((READY, os.getpid()))
        while True:
            work, given, about = connection.recv()
            connection.send(_done(host, work, given, about))


def _done(
    host: Host, work: Work, given: tuple[Any, ...], about: Mapping[str, str]
) -> tuple[str, Any]:
    """What is said of a piece of work.

    about : what log records on the way are about
    """
    try:
        with logs.about(**about):
            return DONE, work(host, *given)
    except Refused:
        return REFUSED, None
    except RideError as error:
        return FAILED, error
    except Exception:
        return BROKEN, traceback.format_exc()
