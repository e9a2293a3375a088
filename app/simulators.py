"""The processes that do what people wait for, as many as there are cores.

In threads of the service they would wait for each other's hold on Python's lock, and everybody else
with them. They are forked from a process of their own that has loaded the kernels, so that one more
costs little memory and no time. One that is lost is replaced, and what it did is done again, once.
"""

import atexit
import logging
import threading
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from . import logs
from .errors import Unavailable
from .forking import processes
from .simulator import ASKED, DONE, FAILED, READY, REFUSED, simulator

log = logging.getLogger(__name__)

T = TypeVar("T")

PATIENCE = 120.0
"""How long a simulator may be silent, s; the budgets of requests are for far less."""

ENDING = 1.0
"""How long one that does nothing may take to end, s."""

Answers = Mapping[str, Callable[..., Any]]
"""What work may ask the service, by name."""


class _Lost(Exception):
    """A simulator has ended, or is `silent`."""

    def __init__(self, *, silent: bool = False):
        super().__init__()
        self.silent = silent


class Simulators:
    """All simulators of a service; used from the threads of its pool for interactive work."""

    def __init__(self, number: int):
        self._number = number
        self._all: dict[int, _Simulator] = {}
        self._free = set(range(number))
        self._changed = threading.Condition()
        self._closed = False
        self.lost = 0
        """How many were lost since the service started."""
        # Before multiprocessing waits for its processes, which do not heed its request to end.
        atexit.register(self.close)

    def start(self) -> None:
        """Have all of them ready; RuntimeError where they cannot be started."""
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
            try:
                return self._at(place).run(work, given, answers)
            except _Lost as lost:
                self._forget(place)
                if lost.silent:
                    raise
                return self._at(place).run(work, given, answers)
        except _Lost:
            self._forget(place)
            raise Unavailable(
                "The process that computed this was lost; try again, or ask for less at a time.",
                retry_after=1,
            ) from None
        finally:
            self._give_back(place)

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
            self._changed.notify()

    def _at(self, place: int) -> "_Simulator":
        """The simulator of a place that was taken, begun if there is none."""
        one = self._all.get(place)
        if one is not None:
            return one
        one = _Simulator()
        with self._changed:
            if not self._closed:
                self._all[place] = one
                return one
        one.end()
        raise Unavailable("The service is about to end; ask another, or again in a moment.")

    def _forget(self, place: int) -> None:
        self.lost += 1
        if one := self._all.pop(place, None):
            log.warning("the simulator %d was lost", one.process)
            one.end()


class _Simulator:
    """One process; for one thread at a time."""

    def __init__(self):
        self._connection, theirs = processes.Pipe()
        self._process = processes.Process(
            target=simulator, args=(theirs,), name="simulator", daemon=True
        )
        try:
            self._process.start()
            theirs.close()
            kind, self.process = self._heard()
            assert kind == READY
        except (EOFError, OSError, _Lost) as error:
            raise RuntimeError("a process that simulates could not be started") from error

    def run(self, work: Callable[..., T], given: tuple[Any, ...], answers: Answers) -> T:
        """Result of `work`; _Lost where the process is."""
        refused: Exception | None = None
        self._tell((work, given, logs.known_about()))
        while True:
            kind, told = self._heard()
            if kind == DONE:
                return told
            if kind == ASKED:
                what, about = told
                try:
                    answer = DONE, answers[what](*about)
                except Exception as error:
                    answer, refused = (REFUSED, None), error
                self._tell(answer)
            elif kind == FAILED:
                raise told
            elif kind == REFUSED and refused is not None:
                raise refused
            else:
                raise RuntimeError(f"in a simulator: {told}")

    def _tell(self, message: Any) -> None:
        try:
            self._connection.send(message)
        except OSError:
            raise _Lost from None

    def _heard(self) -> tuple[str, Any]:
        try:
            if self._connection.poll(PATIENCE):
                return self._connection.recv()
        except (EOFError, OSError):
            raise _Lost from None
        raise _Lost(silent=True)

    def end(self) -> None:
        """Let it end, or end it."""
        self._connection.close()
        self._process.join(ENDING)
        if self._process.is_alive():
            self._process.kill()
            self._process.join(ENDING)
