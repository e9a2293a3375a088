"""The processes that do what people wait for, as many as there are cores.

In threads of the service they would wait for each other's hold on Python's lock, and everybody else
with them. They are forked from a process of their own that has loaded the kernels, so that one more
costs little memory and no time. One that is lost is replaced, and what it did is done again, once.
"""

import atexit
import logging
import os
import socket
import struct
import threading
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from .. import logs
from ..errors import Unavailable
from .forking import processes
from .simulator import ASKED, DONE, FAILED, READY, REFUSED, simulator

log = logging.getLogger(__name__)

T = TypeVar("T")

PATIENCE = 120.0
"""How long a simulator may neither take nor give anything, s; requests' budgets are for far less.
"""

ENDING = 1.0
"""How long one that does nothing may take to end, s."""

ATTEMPTS = 2
"""At a piece of work whose process is lost."""

RETRY_AFTER = 5
"""s after which another may try where none can be started."""

Answers = Mapping[str, Callable[..., Any]]
"""What work may ask the service, by name."""


class _Lost(Exception):
    """A simulator has ended, or is `silent`."""

    def __init__(self, *, silent: bool = False):
        super().__init__()
        self.silent = silent


class Simulators:
    """All simulators of a service; used from the threads of its pool for interactive work."""

    def __init__(self, number: int, patience: float = PATIENCE):
        """`patience` with one that is silent, s."""
        self._number, self._patience = number, patience
        self._all: dict[int, _Simulator] = {}
        self._free = set(range(number))
        self._changed = threading.Condition()
        self._closed = False
        self.lost = 0
        """How many were lost since the service started."""
        # Before multiprocessing waits for its processes, which do not heed its request to end.
        atexit.register(self.close)

    def start(self) -> None:
        """Have all of them ready; Unavailable where they cannot be started."""
        for place in range(self._number):
            with self._changed:
                self._changed.wait_for(lambda place=place: place in self._free)
                self._free.discard(place)
            try:
                self._at(place)
            finally:
                self._give_back(place)

    def run(self, session: str, work: Callable[..., T], *given: Any, **answers: Any) -> T:
        """Result of `work(host, *given)` in a simulator, or the error that it raised.

        session : works in the same simulator as before if it can, which knows its recordings
        answers : functions that the work may ask for by their names, called here; `recording`
            gives the run of a measurement
        """
        place = self._taken(session)
        try:
            for _ in range(ATTEMPTS):
                try:
                    return self._at(place).run(work, given, answers)
                except _Lost as lost:
                    if lost.silent:
                        break
                finally:
                    self._forget_unless_free(place)
        finally:
            self._give_back(place)
        raise Unavailable(
            "The process that computed this was lost; try again, or ask for less at a time.",
            retry_after=1,
        )

    def count(self) -> int:
        """How many there are."""
        return len(self._all)

    def close(self) -> None:
        """End all of them; what they do is lost."""
        atexit.unregister(self.close)
        with self._changed:
            self._closed = True
            ended, self._all = list(self._all.values()), {}
        for one in ended:
            one.end()

    def _taken(self, session: str) -> int:
        """A place that is free, the session's usual one if that is."""
        usual = hash(session) % self._number
        with self._changed:
            self._changed.wait_for(lambda: self._free)
            place = usual if usual in self._free else next(iter(self._free))
            self._free.discard(place)
            return place

    def _give_back(self, place: int) -> None:
        with self._changed:
            self._free.add(place)
            # To all: one waits for this place, another for any.
            self._changed.notify_all()

    def _at(self, place: int) -> "_Simulator":
        """The simulator of a place that was taken, begun if there is none."""
        one = self._all.get(place)
        if one is not None:
            return one
        one = _Simulator(self._patience)
        with self._changed:
            if not self._closed:
                self._all[place] = one
                return one
        one.end()
        raise Unavailable("The service is about to end; ask another, or again in a moment.")

    def _forget_unless_free(self, place: int) -> None:
        """Have another in a place whose simulator is lost, or still owes something to a work that
        broke off: the next one would take it for its own.
        """
        one = self._all.get(place)
        if one is not None and not one.free:
            self.lost += 1
            log.warning("the simulator %d was lost", one.process)
            self._all.pop(place, None)
            one.end()


class _Simulator:
    """One process; for one thread at a time."""

    def __init__(self, patience: float):
        """Unavailable where it cannot be started."""
        self.free = False
        """Whether nothing is on the way between it and the service."""
        try:
            self._connection, theirs = processes.Pipe()
        except OSError as error:
            raise _not_started() from error
        self._process = processes.Process(
            target=simulator, args=(theirs,), name="simulator", daemon=True
        )
        try:
            with theirs:
                self._process.start()
            _limit_silence(self._connection.fileno(), PATIENCE)
            kind, self.process = self._heard()
            assert kind == READY
            _limit_silence(self._connection.fileno(), patience)
        except (EOFError, OSError, _Lost) as error:
            self.end()
            raise _not_started() from error
        self.free = True

    def run(self, work: Callable[..., T], given: tuple[Any, ...], answers: Answers) -> T:
        """Result of `work`; _Lost where the process is."""
        refused: Exception | None = None
        self.free = False
        self._tell((work, given, logs.known_about()))
        while (heard := self._heard())[0] == ASKED:
            what, about = heard[1]
            try:
                answer = DONE, answers[what](*about)
            except Exception as error:
                answer, refused = (REFUSED, None), error
            self._tell(answer)
        self.free = True
        kind, told = heard
        if kind == DONE:
            return told
        if kind == FAILED:
            raise told
        if kind == REFUSED and refused is not None:
            raise refused
        raise RuntimeError(f"in a simulator: {told}")

    def _tell(self, message: Any) -> None:
        try:
            self._connection.send(message)
        except OSError as error:
            raise _Lost(silent=isinstance(error, BlockingIOError)) from None

    def _heard(self) -> tuple[str, Any]:
        try:
            return self._connection.recv()
        except (EOFError, OSError) as error:
            raise _Lost(silent=isinstance(error, BlockingIOError)) from None

    def end(self) -> None:
        """Let it end, or end it."""
        self._connection.close()
        if self._process.pid is None:
            return
        self._process.join(ENDING)
        if self._process.is_alive():
            self._process.kill()
            self._process.join(ENDING)


def _limit_silence(connection: int, seconds: float) -> None:
    """Have reading from and writing to a local socket fail once nothing has moved for so long: a
    process that was stopped does neither, however little is on the way.
    """
    limit = struct.pack("ll", int(seconds), int(seconds % 1 * 1e6))
    with socket.socket(fileno=os.dup(connection)) as options:
        options.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)
        options.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)


def _not_started() -> Unavailable:
    return Unavailable(
        "A process that simulates could not be started; try again in a moment, and see the log of "
        "the service if it stays so.",
        retry_after=RETRY_AFTER,
    )
