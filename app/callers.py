"""How much one caller may ask for in a time, whatever is under way at the moment."""

import ipaddress
import math
import time
from collections.abc import Callable

from starlette.requests import HTTPConnection

from .buckets import Buckets
from .errors import Busy
from .limits import Limits

IPV6_SITE = 64
"""Bits of an IPv6 address that a caller does not choose."""


class Callers:
    """The budgets of all callers; may be used from any thread."""

    def __init__(self, limits: Limits, clock: Callable[[], float] = time.monotonic):
        opened, simulated = limits.new_sessions, limits.session_simulated_seconds
        self._sessions = Buckets(opened / 60, opened, clock=clock)
        self._browsers = Buckets(opened / 60, opened, clock=clock)
        self._simulated = Buckets(simulated / 3600, simulated, clock=clock)

    def open_session(self, caller: str) -> None:
        """Refuse one who opens many sessions a minute."""
        if wait := self._sessions.take(caller):
            raise Busy(
                "Many sessions were opened from where you are within a minute; go on with one of "
                f"them, or try again in {_in_words(wait)}.",
                retry_after=math.ceil(wait),
            )

    def let_in(self, caller: str) -> None:
        """Refuse one who has many browsers let in a minute, each of which is kept for long."""
        if wait := self._browsers.take(caller):
            raise Busy(
                "Many browsers were let in from where you are within a minute; try again in "
                f"{_in_words(wait)}.",
                retry_after=math.ceil(wait),
            )

    def simulate(self, session: str, seconds: float) -> None:
        """Take simulated seconds from a session's budget."""
        if wait := self._simulated.take(session, seconds):
            raise Busy(
                "The session has used up its simulated seconds for now; more are there in "
                f"{_in_words(wait)}. Sweeps and identifications go on.",
                retry_after=math.ceil(wait),
            )


def caller_of(connection: HTTPConnection) -> str:
    """Who calls: the peer's address, of IPv6 its site."""
    host = connection.client.host if connection.client else ""
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host
    if address.version == 6:
        return str(ipaddress.ip_network((address, IPV6_SITE), strict=False))
    return host


def _in_words(seconds: float) -> str:
    return f"{math.ceil(seconds)} s" if seconds < 120 else f"{math.ceil(seconds / 60)} minutes"
