"""The one seam to Dask: submit a task, cancel it, hear how it goes.

With an address the tasks go to that scheduler. Without one, a cluster of this machine's own starts
at the first task and goes again after a while without any: processes at the lowest priority,
behind TLS, because whoever reaches a scheduler runs code as its user.

Dask forgets everything with its scheduler; what must last is the caller's business.
"""

import asyncio
import logging
import math
import os
import secrets
import threading
import time
import warnings
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import Future, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from .. import logs
from ..errors import Unavailable, unforeseen
from ..settings import Certificates
from . import worker
from .dask_connection import ANSWER, DaskConnection

log = logging.getLogger(__name__)

LOOK_EVERY = 2.0
"""Time between two looks at a scheduler elsewhere, s."""

REFUSED_FOR = 10.0
"""How long a failed try to reach the workers counts, s: several tries while jobs wait for them."""


class Listener(Protocol):
    """Who hears about tasks; called from the cluster's own threads."""

    def task_started(self, task: str) -> None:
        """A worker has taken the task up."""

    def task_progressed(self, task: str, progress: Mapping[str, Any]) -> None:
        """The task reports how far it has come."""

    def task_kept(self, task: str, part: str, data: bytes) -> None:
        """A part of the task's work is done and need not be done again."""

    def task_ended(self, task: str, ending: worker.Ending) -> None:
        """The task has ended by itself, or as asked."""

    def task_lost(self, task: str, *, with_worker: bool) -> None:
        """The task may be submitted again: its result went with its worker, or it with the
        scheduler, which is not its fault.
        """


@dataclass
class _Task:
    listener: Listener
    key: str
    future: Any = None
    address: str = ""
    process: int = 0
    cancelled: bool = False


class Cluster:
    """Processes that run tasks."""

    def __init__(
        self,
        address: str,
        scratch: Path,
        *,
        certificates: Certificates | None = None,
        workers: int | None = None,
        idle_seconds: float = 120,
    ):
        self._address = address
        self._certificates = certificates
        self._scratch = scratch
        self._workers = workers or os.cpu_count() or 1
        self._idle_seconds = idle_seconds
        self._lock = threading.RLock()
        self._tasks: dict[str, _Task] = {}
        self._submissions = 0
        self._token = secrets.token_hex(4)
        self._connection: DaskConnection | None = None
        self._scheduler, self._there, self._looked = "", 0, 0.0
        self._leave: threading.Timer | None = None
        self._closed = False
        self._refused_at, self._told = -math.inf, ""
        self.became: Counter[str] = Counter()
        """How many tasks were submitted, and how many were done, failed, cancelled or lost."""

    @property
    def refused(self) -> bool:
        """Whether the last try to reach them failed, lately."""
        return time.monotonic() - self._refused_at < REFUSED_FOR

    def workers(self) -> int:
        """How many there are now; 0 while none are needed, or can be reached."""
        client = self._client
        if client is None or client.status != "running":
            return 0
        return len(client.sync(client.scheduler.ncores, callback_timeout=1))

    def width(self) -> int:
        """How many tasks run at a time; Unavailable where the workers cannot be reached."""
        if not self._address:
            return self._workers
        with self._lock:
            self._started()
            return max(self._there, 1)

    def submit(
        self,
        name: str,
        task: worker.Task,
        payload: Any,
        listener: Listener,
        *,
        kept: Mapping[str, bytes] | None = None,
        priority: int = 0,
    ) -> None:
        """Run a task once; blocks while the cluster starts, Unavailable where it does not. Any
        other exception is the task's: it cannot be sent.

        kept : parts of its work that are done already
        priority : tasks of a higher one are taken up first
        """
        with self._lock:
            if self._closed:
                return
            client = self._started()
            self._submissions += 1
            # Of this service alone: another may have the same task at the same scheduler.
            key = f"{name}-{self._token}-{self._submissions}"
            known = self._tasks[name] = _Task(listener, key)
            try:
                known.future = _given(
                    client, key, priority, (name, key, task, payload, dict(kept or {}))
                )
                if client.status != "running":
                    raise ConnectionError("what the client was given last may be lost")
            except Exception as error:
                del self._tasks[name]
                if client.status == "running":
                    self._leave_later()
                    raise
                log.warning("lost the workers %s: %r", self._where, error)
                self._disconnect()
                raise self._unavailable() from None
            self.became["submitted"] += 1
        known.future.add_done_callback(lambda done: self._ended(name, done))

    def cancel(self, name: str, grace: float) -> None:
        """Ask a task to stop, and return at once; after `grace` seconds kill its worker."""
        with self._lock:
            task = self._tasks.get(name)
            if task is None or task.cancelled:
                return
            task.cancelled = True
            client = self._client
        _tell_workers(client, worker.ask_to_stop, task.key)
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
                keys = [task.key for task in self._tasks.values()]
                wait([_tell_workers(self._client, worker.ask_to_stop, *keys)], ANSWER)
            self._stop()

    @property
    def _client(self) -> Any:
        connection = self._connection
        return None if connection is None else connection.client

    def _started(self) -> Any:
        """The client, connected anew where that before is lost; Unavailable where it cannot be."""
        if self._leave is not None:
            self._leave.cancel()
        if self._connection is not None:
            self._look()
        if self._connection is None:
            self._connect()
            self._look()
        if self._connection is None:
            raise self._unavailable()
        return self._client

    def _connect(self) -> None:
        try:
            self._connection = DaskConnection(
                self._address, self._certificates, self._workers, self._scratch
            )
            self._client.subscribe_topic(worker.TOPIC, self._heard)
        except Exception as error:
            self._refused_at = time.monotonic()
            if str(error) != self._told:  # not again every time it is tried
                self._told = str(error)
                unforeseen = not isinstance(error, OSError | RuntimeError)
                told = "cannot reach the workers %s, which is tried on: %s"
                log.error(told, self._where, error, exc_info=unforeseen)
            self._disconnect()
            raise self._unavailable() from None
        self._refused_at = -math.inf
        if self._told:
            self._told = ""
            log.warning("reached the workers %s again", self._where)

    @property
    def _where(self) -> str:
        return f"at {self._address}" if self._address else "on this machine"

    def _unavailable(self) -> Unavailable:
        return Unavailable(
            f"The job workers {self._where} cannot be started or reached; try again later or look "
            "at the service's log."
        )

    def _look(self) -> None:
        """Give up a client that has closed itself, as Dask's does while a scheduler is away, and
        one whose scheduler is gone or another one since: it goes on with that, but hears nothing of
        tasks. Count the workers of a scheduler elsewhere.
        """
        now, client = time.monotonic(), self._client
        if client.status != "running":
            log.warning("lost the workers %s: the client is %s", self._where, client.status)
            self._disconnect()
            return
        if not self._address or now - self._looked < LOOK_EVERY:
            return
        try:
            seen = client.sync(client.scheduler.identity, n_workers=0, callback_timeout=ANSWER)
        except Exception as error:  # of many kinds where the client closes itself meanwhile
            log.warning("lost the workers %s: %r", self._where, error)
            self._disconnect()
            return
        if self._scheduler not in ("", seen["id"]):
            self._disconnect()
            return
        self._looked, self._scheduler, self._there = now, seen["id"], seen["total_threads"]

    def _stop(self) -> None:
        self._disconnect()
        self._tasks.clear()

    def _disconnect(self) -> None:
        """Let go of the client; tasks that it still had are told to be lost."""
        if self._leave is not None:
            self._leave.cancel()
        connection, self._connection = self._connection, None
        self._scheduler, self._looked = "", 0.0
        if connection is not None:
            connection.close()

    def _heard(self, event: tuple[float, dict[str, Any]]) -> None:
        news = event[1]
        task = self._tasks.get(news["task"])
        if task is None or task.key != news["key"]:
            return
        if "process" in news:
            task.address, task.process = news["address"], news["process"]
            task.listener.task_started(news["task"])
        elif "part" in news:
            task.listener.task_kept(news["task"], news["part"], news["data"])
        else:
            task.listener.task_progressed(news["task"], news["progress"])

    def _ended(self, name: str, future: Any) -> None:
        """In Dask's callback thread: fetch the result before the cluster may leave."""
        task = self._tasks.get(name)
        if task is None or task.future is not future:
            return
        lost = future.status not in ("finished", "error") and not task.cancelled
        with logs.about(**worker.about(name)):
            ending = _ending_of(task, future)
        with self._lock:
            if self._closed or self._tasks.get(name) is not task:
                return
            del self._tasks[name]
            self._leave_later()
        self.became["lost" if ending is None else ending["state"]] += 1
        if ending is None:
            task.listener.task_lost(name, with_worker=not lost)
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
        _tell_workers(client, worker.kill, task.process, workers=[task.address], nanny=True)


def _given(client: Any, key: str, priority: int, task: tuple[Any, ...]) -> Any:
    """The future of what `worker.run` is called with."""
    with warnings.catch_warnings():
        # Recordings travel with their task so that a lost worker costs nothing but time.
        warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
        return client.submit(worker.run, *task, key=key, pure=False, priority=priority)


def _tell_workers(client: Any, function: Any, *values: Any, **where: Any) -> Future[None]:
    """Call a function on the workers, without waiting for those that are gone or frozen; done once
    all have called it, or `ANSWER` has passed.
    """

    async def told() -> None:
        try:
            async with asyncio.timeout(ANSWER):
                await client.run(function, *values, on_error="ignore", **where)
        except (OSError, RuntimeError, LookupError) as error:
            log.warning("job workers do not answer: %r", error)

    return asyncio.run_coroutine_threadsafe(told(), client.loop.asyncio_loop)


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
    return unforeseen(error)
