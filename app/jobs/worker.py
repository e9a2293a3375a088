"""What runs inside a job worker: one task at a time, at the lowest priority, able to stop.

A task is a function of its payload and its `Attempt`; it gives its result, with a file if it makes
one, or raises CutShort with what it had finished when it was cancelled. It is told to stop through
a flag in this module, set by the worker's event loop while the task computes; it reports through
the scheduler's event log, at most ten times a second, and always the whole progress, so nothing
depends on the order or number of reports. Parts that it keeps go the same way: one that is lost
costs the time to make it again.
"""

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NotRequired, TypedDict

from ...engine.errors import Cancelled, RideError
from .. import logs

TOPIC = "ridetune-tasks"
LOWEST_PRIORITY = 19
REPORT_EVERY = 0.1

MOST_KEPT = 100_000
"""Bytes of a part that a task keeps on its way; the scheduler holds the latest thousand."""

State = Literal["done", "failed", "cancelled"]


@dataclass(frozen=True)
class WithFile:
    """A task's result and the file it made."""

    result: dict[str, Any]
    file: bytes


class CutShort(Cancelled):
    """The task was cancelled; what it had finished by then is kept."""

    def __init__(self, kept: WithFile):
        super().__init__("Cancelled; what was finished is kept.")
        self.kept = kept


@dataclass(frozen=True)
class Attempt:
    """What a task has at hand while it runs.

    report : told how far it is, all of it each time
    cancelled : says whether to stop
    keep : told the name of a part of the work that is done, and MOST_KEPT bytes of it at most
    kept : parts by name that earlier attempts kept, or that units made for it
    """

    report: Callable[[Mapping[str, Any]], None]
    cancelled: Callable[[], bool]
    keep: Callable[[str, bytes], None]
    kept: Mapping[str, bytes]


Task = Callable[[Any, Attempt], dict[str, Any] | WithFile]

_asked_to_stop: set[str] = set()


class Ending(TypedDict):
    """How a task ended: its result, perhaps with a file, or the error a person can mend."""

    state: State
    result: dict[str, Any] | None
    error: dict[str, str] | None
    progress: dict[str, Any]
    file: NotRequired[bytes]


def run(name: str, key: str, task: Task, payload: Any, kept: Mapping[str, bytes]) -> Ending:
    """Run a task to its end; unknown exceptions go to the scheduler as they are.

    key : stands for this submission of the task, of all there are
    """
    from distributed import get_worker

    logs.configure_worker()
    os.setpriority(os.PRIO_PROCESS, 0, LOWEST_PRIORITY)
    worker = get_worker()
    progress: dict[str, Any] = {}
    reported = 0.0

    def send(**news: Any) -> None:
        worker.log_event(TOPIC, {"task": name, "key": key, **news})

    def report(now: Mapping[str, Any]) -> None:
        nonlocal progress, reported
        progress = dict(now)
        if time.monotonic() - reported >= REPORT_EVERY:
            reported = time.monotonic()
            send(progress=progress)

    def keep(part: str, data: bytes) -> None:
        if len(data) > MOST_KEPT:
            raise ValueError(f"{part} has {len(data)} bytes, a part may have {MOST_KEPT}")
        send(part=part, data=data)

    def ending(state: State, result: Any = None, error: Any = None) -> Ending:
        return {"state": state, "result": result, "error": error, "progress": progress}

    send(address=worker.address, process=os.getpid())
    try:
        attempt = Attempt(report, lambda: key in _asked_to_stop, keep, kept)
        with logs.about(**about(name)):
            found = task(payload, attempt)
        if isinstance(found, WithFile):
            return {**ending("done", result=found.result), "file": found.file}
        return ending("done", result=found)
    except CutShort as stopped:
        return {**ending("cancelled", result=stopped.kept.result), "file": stopped.kept.file}
    except Cancelled:
        return ending("cancelled")
    except RideError as error:
        return ending("failed", error={"code": error.code, "detail": str(error)})
    finally:
        _asked_to_stop.discard(key)


def about(name: str) -> dict[str, str]:
    """What log records of a task are about: its job, and the unit of it where there are several."""
    job, _, unit = name.partition("/")
    return {"job": job, "unit": unit} if unit else {"job": job}


def ask_to_stop(*keys: str) -> None:
    """Raise the flags of submissions, in the process that runs them."""
    _asked_to_stop.update(keys)


def kill(process: int) -> None:
    """End a worker process at once; its nanny, where this runs, starts another."""
    import signal

    os.kill(process, signal.SIGKILL)
