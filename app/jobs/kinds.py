"""What a kind of job is: how its work is gathered here, cut into units, and done on workers.

Units are done side by side, on as many workers as there are, and what each makes is kept as a part
of the job; then the job's task makes the result of all parts. So a long job lets others pass
between two units, and goes on where it was when the service, a worker or the scheduler is lost. A
job that is not divided is one task, which may keep parts on its way (`Attempt.keep`).
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..schemas import WireForm
from ..storage.job_row import Job
from .worker import Task

PROMPT, PATIENT = 1, 0
"""Priorities: of jobs that a person waits for, and of those that take as long as they are asked."""

Progress = Mapping[str, Any]


@dataclass(frozen=True)
class Division:
    """How a job is cut into units.

    names : of the units of a spec, in the order in which they are sent
    unit : makes one; its payload is the job's with the name as `unit`. The file is the part that is
        kept, the result how far it came, as it may report before
    progress : of the job, of its spec, what is known of the units by name, kept ones included, and
        how many of them run at the moment
    slow : whether one takes longer than a person likes to wait: where there are several workers,
        one at least is left to other jobs
    cut_short : whether a job that is cancelled makes a result of the parts that there are
    """

    names: Callable[[Mapping[str, Any]], Sequence[str]]
    unit: Task
    progress: Callable[[Mapping[str, Any], Mapping[str, Progress], int], Progress]
    slow: Callable[[Mapping[str, Any]], bool] = lambda spec: False
    cut_short: bool = False


@dataclass(frozen=True)
class Kind:
    """What a job of one kind does: `payload` gathers here what `task` needs on a worker."""

    task: Task
    payload: Callable[[Job], Any]
    division: Division | None = None
    priority: int = PROMPT


def digest(form: Mapping[str, Any]) -> str:
    """What stands for a request in the form of JSON."""
    return hashlib.sha256(json.dumps(form, sort_keys=True).encode()).hexdigest()


def as_asked(request: WireForm) -> str:
    """What stands for a request of one spelling: the same whenever it is sent."""
    return digest(request.model_dump(mode="json", exclude={"key"}))
