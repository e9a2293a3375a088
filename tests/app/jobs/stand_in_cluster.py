"""A cluster of no workers, in place of Dask's: its tasks do what the test says."""

from collections.abc import Callable

import pytest
from ridetune.app.errors import Unavailable


class StandIn:
    def __init__(self):
        self.tasks: dict[str, tuple] = {}
        self.cancelled: list[str] = []
        self.graces: dict[str, float] = {}
        self.kept: dict[str, dict[str, bytes]] = {}
        self.refusing = False
        self.meanwhile: Callable[[str], object] = lambda name: None

    def width(self):
        return 3

    def submit(self, name, task, payload, listener, *, kept, priority):
        if self.refusing:
            raise Unavailable("The job workers cannot be reached.")
        self.meanwhile(name)
        self.tasks[name] = (task, payload, listener)
        self.kept[name] = kept

    def cancel(self, name, grace):
        self.cancelled.append(name)
        self.graces[name] = grace
        if name in self.tasks:
            self.end(name, "cancelled")

    def close(self):
        self.tasks.clear()

    def start(self, name: str) -> None:
        self.tasks[name][2].task_started(name)

    def report(self, name: str, **progress) -> None:
        self.tasks[name][2].task_progressed(name, progress)

    def end(self, name: str, state: str, result=None, error=None) -> None:
        ending = {"state": state, "result": result, "error": error, "progress": {}}
        self.tasks.pop(name)[2].task_ended(name, ending)

    def lose(self, name: str, with_worker: bool) -> None:
        self.tasks.pop(name)[2].task_lost(name, with_worker=with_worker)


@pytest.fixture
def clusters(monkeypatch) -> list[StandIn]:
    """The stand-ins of all services of a test, the latest last."""
    made: list[StandIn] = []

    def make(address, scratch, certificates) -> StandIn:
        made.append(StandIn())
        return made[-1]

    monkeypatch.setattr("ridetune.app.main.Cluster", make)
    return made
