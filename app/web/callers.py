"""How much one caller may ask for in a time, whatever is under way at the moment."""

import math
import time
from collections.abc import Callable

from starlette.requests import HTTPConnection

from ..addresses import site
from ..errors import Busy
from ..limits import Limits
from .buckets import Buckets


class Callers:
    """The budgets of all callers; may be used from any thread."""

    def __init__(self, limits: Limits, clock: Callable[[], float] = time.monotonic):
        def an_hour(seconds: float) -> Buckets:
            return Buckets(seconds / 3600, seconds, clock=clock)

        opened = limits.new_sessions
        self._sessions = Buckets(opened / 60, opened, clock=clock)
        self._browsers = Buckets(opened / 60, opened, clock=clock)
        self._simulated = an_hour(limits.session_simulated_seconds)
        self._simulated_of_users = an_hour(limits.user_simulated_seconds)

    def open_session(self, caller: str) -> None:
        """Refuse one who opens many sessions a minute."""
        _refuse(
            self._sessions.take(caller),
            "Many sessions were opened from where you are within a minute; go on with one of them, "
            "or try again in {}.",
        )

    def let_in(self, caller: str) -> None:
        """Refuse one who has many browsers let in a minute, each of which is kept for long."""
        _refuse(
            self._browsers.take(caller),
            "Many browsers were let in from where you are within a minute; try again in {}.",
        )

    def simulating(self, session: str, user: str | None) -> Callable[[float], None]:
        """What takes a request's simulated seconds from a session's budget, and from its user's if
        known; asked again, because a process was lost with the work, it takes no more.
        """
        taken = False

        def take(seconds: float) -> None:
            nonlocal taken
            if not taken:
                self._take_simulated(session, user, seconds)
                taken = True

        return take

    def _take_simulated(self, session: str, user: str | None, seconds: float) -> None:
        _refuse(
            self._simulated.take(session, seconds),
            "The session has used up its simulated seconds for now; more are there in {}. Sweeps "
            "and identifications go on.",
        )
        if user is not None and (wait := self._simulated_of_users.take(user, seconds)):
            self._simulated.put_back(session, seconds)
            _refuse(
                wait,
                "You have used up your simulated seconds of all your sessions for now; more are "
                "there in {}. Sweeps and identifications go on.",
            )


def _refuse(wait: float, sentence: str) -> None:
    """Tell in the sentence after how many seconds there is enough again, unless there is now."""
    if wait:
        raise Busy(sentence.format(_in_words(wait)), retry_after=math.ceil(wait))


def caller_of(connection: HTTPConnection) -> str:
    """Who calls: the peer's address, of IPv6 its site."""
    return site(connection.client.host if connection.client else "")


def _in_words(seconds: float) -> str:
    return f"{math.ceil(seconds)} s" if seconds < 120 else f"{math.ceil(seconds / 60)} minutes"
