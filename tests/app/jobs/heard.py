"""What a cluster tells a test that listens to it."""

import queue

import pytest
from ridetune.app.jobs.worker import Ending

PATIENCE = 60.0


class Heard:
    """A listener that writes down what it is told."""

    def __init__(self):
        self.started: queue.Queue[str] = queue.Queue()
        self.progress: queue.Queue[tuple[str, dict]] = queue.Queue()
        self.ends: queue.Queue[tuple[str, Ending]] = queue.Queue()
        self.kept: queue.Queue[tuple[str, str, bytes]] = queue.Queue()
        self.lost: queue.Queue[tuple[str, bool]] = queue.Queue()

    def task_started(self, task):
        self.started.put(task)

    def task_progressed(self, task, progress):
        self.progress.put((task, dict(progress)))

    def task_kept(self, task, part, data):
        self.kept.put((task, part, data))

    def task_ended(self, task, ending):
        self.ends.put((task, ending))

    def task_lost(self, task, *, with_worker):
        self.lost.put((task, with_worker))

    def end_of(self, task: str) -> Ending:
        name, ending = self.ends.get(timeout=PATIENCE)
        assert name == task
        return ending


@pytest.fixture
def heard() -> Heard:
    return Heard()
