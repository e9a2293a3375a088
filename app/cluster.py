"""The one seam to Dask: submit a task, cancel it, hear how it goes.

With an address the tasks go to that scheduler. Without one, a cluster of this machine's own starts
at the first task and goes again after a while without any: processes at the lowest priority,
behind TLS, because whoever reaches a scheduler runs code as its user.

Dask forgets everything with its scheduler; what must last is the caller's business.
"""

import logging
import os
import threading
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from . import worker
from .errors import Unavailable

log = logging.getLogger(__name__)

CONFIGURATION = {
    # The default of 15 s drops a nanny for good whose worker is lost twice in that time.
    "distributed.deploy.lost-worker-timeout": "365d",
    "distributed.scheduler.allowed-failures": 2,
    # Its web servers start in any case: without pages to show, and not on a port others may want.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}


class Listener(Protocol):
    """Who hears about tasks; called from the cluster's own threads."""

    def task_started(self, task: str) -> None:
        """A worker has taken the task up."""

    def task_progressed(self, task: str, progress: Mapping[str, Any]) -> None:
        """The task reports how far it has come."""

    def task_ended(self, task: str, ending: worker.Ending) -> None:
        """The task has ended by itself, or as asked."""

    def task_lost(self, task: str) -> None:
        """The task went with its scheduler; it may be submitted again."""


@dataclass
class _Task:
    listener: Listener
    future: Any = None
    address: str = ""
    process: int = 0
    cancelled: bool = False


class Cluster:
    """Processes that run tasks."""

    def __init__(
        self, address: str, scratch: Path, *, workers: int | None = None, idle_seconds: float = 120
    ):
        self._address = address
        self._scratch = scratch
        self._workers = workers or os.cpu_count() or 1
        self._idle_seconds = idle_seconds
        self._lock = threading.RLock()
        self._tasks: dict[str, _Task] = {}
        self._submissions = 0
        self._client: Any = None
        self._local: Any = None
        self._leave: threading.Timer | None = None
        self._closed = False

    def submit(self, name: str, task: worker.Task, payload: Any, listener: Listener) -> None:
        """Run a task once; blocks while the cluster starts."""
        with self._lock:
            if self._closed:
                return
            client = self._started()
            self._submissions += 1
            known = self._tasks[name] = _Task(listener)
            with warnings.catch_warnings():
                # Recordings travel with their task so that a lost worker costs nothing but time.
                warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
                future = client.submit(
                    worker.run,
                    name,
                    task,
                    payload,
                    key=f"{name}-{self._submissions}",
                    pure=False,
                )
            known.future = future
        future.add_done_callback(lambda done: self._ended(name, done))

    def cancel(self, name: str, grace: float) -> None:
        """Ask a task to stop; after `grace` seconds kill its worker."""
        with self._lock:
            task = self._tasks.get(name)
            if task is None or task.cancelled:
                return
            task.cancelled = True
            client = self._client
        client.run(worker.ask_to_stop, name, on_error="ignore")
        if task.address:
            timer = threading.Timer(grace, self._kill, (name,))
            timer.daemon = True
            timer.start()
        else:
            task.future.cancel()

    def close(self) -> None:
        """End all workers of our own; running tasks end unheard."""
        with self._lock:
            self._closed = True
            if self._client is not None and self._tasks:
                # A worker that still computes would hold up the end for seconds.
                self._client.run(worker.ask_to_stop, *self._tasks, on_error="ignore")
            self._stop()

    def _started(self) -> Any:
        if self._leave is not None:
            self._leave.cancel()
        if self._client is None:
            try:
                self._client = self._start()
            except (OSError, RuntimeError) as error:
                self._stop()
                where = f"at {self._address}" if self._address else "on this machine"
                log.error("cannot start or reach the job workers %s: %s", where, error)
                raise Unavailable(
                    f"The job workers {where} cannot be started or reached; try again later or "
                    "look at the service's log."
                ) from None
            self._client.subscribe_topic(worker.TOPIC, self._heard)
        return self._client

    def _start(self) -> Any:
        from dask import config
        from distributed import Client, LocalCluster

        config.set(CONFIGURATION)
        logging.getLogger("distributed").setLevel(logging.ERROR)
        if self._address:
            return Client(self._address, set_as_default=False, name="ridetune")
        no_dashboard: Any = None
        self._local = LocalCluster(
            n_workers=self._workers,
            threads_per_worker=1,
            processes=True,
            security=True,
            dashboard_address=no_dashboard,
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
            local_directory=str(self._scratch),
            silence_logs=logging.ERROR,
        )
        return Client(self._local, set_as_default=False, name="ridetune")

    def _stop(self) -> None:
        if self._leave is not None:
            self._leave.cancel()
        for part in (self._client, self._local):
            if part is not None:
                part.close()
        self._client = self._local = None
        self._tasks.clear()

    def _heard(self, event: tuple[float, dict[str, Any]]) -> None:
        news = event[1]
        task = self._tasks.get(news["task"])
        if task is None:
            return
        if "process" in news:
            task.address, task.process = news["address"], news["process"]
            task.listener.task_started(news["task"])
        else:
            task.listener.task_progressed(news["task"], news["progress"])

    def _ended(self, name: str, future: Any) -> None:
        """In Dask's callback thread: fetch the result before the cluster may leave."""
        task = self._tasks.get(name)
        if task is None or task.future is not future:
            return
        ending = _ending_of(task, future)
        with self._lock:
            if self._closed or self._tasks.get(name) is not task:
                return
            del self._tasks[name]
            self._leave_later()
        if ending is None:
            task.listener.task_lost(name)
        else:
            task.listener.task_ended(name, ending)

    def _leave_later(self) -> None:
        if self._tasks or self._address:
            return
        self._leave = threading.Timer(self._idle_seconds, self._leave_if_idle)
        self._leave.daemon = True
        self._leave.start()

    def _leave_if_idle(self) -> None:
        with self._lock:
            if not self._tasks:
                self._stop()

    def _kill(self, name: str) -> None:
        with self._lock:
            task = self._tasks.get(name)
            if task is None or self._client is None or task.future.done():
                return
            client = self._client
        task.future.cancel()
        client.run(worker.kill, task.process, workers=[task.address], nanny=True, on_error="ignore")


def _ending_of(task: _Task, future: Any) -> worker.Ending | None:
    """How a settled future ended; None if its result went with the worker or the scheduler."""
    if future.status == "finished":
        try:
            return future.result()
        except Exception as error:
            log.warning("a result was lost with its worker: %s", error)
            return None
    if task.cancelled:
        return _without_result("cancelled")
    if future.status == "error":
        return _without_result("failed", _explained(future))
    return None


def _without_result(state: worker.State, error: dict[str, str] | None = None) -> worker.Ending:
    return {"state": state, "result": None, "error": error, "progress": {}}


def _explained(future: Any) -> dict[str, str]:
    from distributed import KilledWorker

    error = future.exception()
    if isinstance(error, KilledWorker):
        return {
            "code": "worker-lost",
            "detail": "The job's worker died each time it was tried, perhaps for lack of memory; "
            "try it with fewer or shorter runs.",
        }
    log.error("a task failed unexpectedly", exc_info=error)
    return {
        "code": "internal",
        "detail": f"The job failed unexpectedly ({type(error).__name__}); the service's log has "
        "the details.",
    }
