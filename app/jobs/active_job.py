"""A job under way in this process, and which of several has its turn."""

import time
from collections import Counter, deque
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

from ..storage.job_row import Job
from .kinds import Kind, Progress

LAST = ""
"""The unit that makes the result of all others."""


@dataclass
class ActiveJob:
    """A job that this process has claimed.

    gather_at : when its payload is to be gathered, s; infinite once that has begun
    send_at : before when none of its units is sent, s
    payload : None until it is gathered
    slow : whether its units hold a worker for long
    waiting : units that are not sent;  running : those that are, each with what stands for the
        attempt
    kept : names of the parts
    progress : of the units
    lost : how often a unit went with its worker
    """

    job: Job
    kind: Kind
    gather_at: float = 0.0
    send_at: float = 0.0
    payload: Any = None
    slow: bool = False
    waiting: deque[str] = field(default_factory=deque)
    running: dict[str, object] = field(default_factory=dict)
    kept: set[str] = field(default_factory=set)
    progress: dict[str, Progress] = field(default_factory=dict)
    lost: Counter[str] = field(default_factory=Counter)
    started: bool = False
    cancelled: bool = False

    @property
    def cut_short(self) -> bool:
        """Whether a result is made of its parts although it is cancelled."""
        return self.kind.division is not None and self.kind.division.cut_short

    @property
    def next(self) -> str | None:
        """The unit to be sent next, if there is one."""
        if self.payload is None or self.running and not self.waiting:
            return None
        return self.waiting[0] if self.waiting else LAST


def task_of(job: str, unit: str) -> str:
    """What the cluster calls a unit of a job."""
    return f"{job}/{unit}" if unit else job


def chosen(jobs: Collection[ActiveJob], width: int) -> ActiveJob | None:
    """The job whose unit is sent next, if there is one, and room: as many run as `width` says."""
    running = [one for one in jobs for _ in one.running]
    if len(running) >= width:
        return None
    busy, now = Counter(one.job.session for one in running), time.monotonic()
    slow = sum(one.slow for one in running) >= max(1, width - 1)
    return min(
        (
            one
            for one in jobs
            if one.next is not None and one.send_at <= now and not (slow and one.slow)
        ),
        key=lambda one: (-one.job.priority, busy[one.job.session], one.job.created),
        default=None,
    )
