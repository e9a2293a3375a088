"""uvicorn's server, ending as `draining` says: told to, it waits for what is under way, and exits
with 0; told a second time, it ends at once.
"""

import logging
import os
import socket
import time
from collections.abc import Callable
from types import FrameType
from typing import Any

import uvicorn

from ..addresses import in_brackets
from .draining import Draining
from .notify import notify

log = logging.getLogger(__name__)

CUT_OFF_SECONDS = 1
"""How long what is still under way after its grace may take to notice that it is cut off."""


class Server(uvicorn.Server):
    """One process that serves until SIGTERM or SIGINT."""

    def __init__(
        self,
        config: uvicorn.Config,
        draining: Draining,
        *,
        grace: float,
        notice: float,
        clock: Callable[[], float] = time.monotonic,
    ):
        """Both in s.

        grace : how long requests under way may take at the end
        notice : how long `/readyz` says so before the end, even if nothing is under way
        """
        super().__init__(config)
        self._draining, self._clock = draining, clock
        self._grace, self._notice = grace, notice
        self._told = 0.0

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen, and tell the service manager."""
        await super().startup(sockets)
        if self.started:
            _tell_of_start(self.config.app, sockets or [])
            notify("READY=1")

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End what is under way, and the services."""
        await super().shutdown(sockets)
        log.info("ridetune has stopped")

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """The signal's handler. What is kept is whole at any time, so a hard end costs nothing but
        what is under way.
        """
        if self.should_exit:
            os._exit(128 + sig)
        self.should_exit = True

    async def on_tick(self, counter: int) -> bool:
        """Ten times a second: whether to close the listener and go."""
        if not await super().on_tick(counter):
            return False
        if not self._draining.begun:
            self._told = self._clock()
            self._draining.begin()
            notify("STOPPING=1")
        passed = self._clock() - self._told
        if passed < self._notice:
            return False
        return self._draining.under_way == 0 or passed >= self._notice + self._grace


def _tell_of_start(app: Any, sockets: list[socket.socket]) -> None:
    """One record with what an operator looks for first; how to get in is not for a log."""
    listening = (one.getsockname() for one in sockets)
    addresses = ", ".join(f"{in_brackets(host)}:{port}" for host, port, *_ in listening)
    data = app.state.services.settings.data
    log.info("ridetune %s serves %s with data in %s", app.version, addresses, data)
