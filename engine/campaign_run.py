"""A campaign from its first drive to its last: here, or side by side in processes of their own."""

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from .campaign import Campaign, Recording
from .errors import CampaignError, Cancelled
from .plant import Asked
from .simulation.integration import cores

LOOK_EVERY = 0.1
"""Time between two looks at how far the processes are, s."""

TELL_EVERY = 0.1
"""Time between two reports of a process, s."""


@dataclass(frozen=True, slots=True)
class CampaignProgress:
    """How far a campaign is.

    runs, of, failed : drives that have ended, all of them, and those of them that broke off
    driven, duration : simulated s of the manoeuvres and of all of them
    seconds : since it began
    """

    runs: int
    of: int
    failed: int
    driven: float
    duration: float
    seconds: float


def drive(
    campaign: Campaign,
    *,
    processes: int | None = None,
    progress: Callable[[CampaignProgress], object] | None = None,
    cancelled: Asked | None = None,
) -> Iterator[Recording]:
    """Recordings of all manoeuvres as they end, whole or not.

    processes : at most; one a core for a car that takes long, none besides this one for another
    progress : told at least whenever a drive ends
    cancelled : asked all the time; Cancelled is raised once it says so, and nothing keeps running,
        as when the iteration is left in another way
    Raises CampaignError for a number of processes below 1, or where one of them is lost.
    """
    if processes is not None and processes < 1:
        raise CampaignError(f"{processes} processes are asked for; give 1 or more.")
    untold = cores() if campaign.plant.long else 1
    several = min(processes or untold, len(campaign.manoeuvres))
    watch = _Watch(campaign, progress)
    stopped = cancelled or (lambda: False)
    return (_here if several == 1 else _in_processes)(campaign, watch, stopped, several)


class _Watch:
    """Sums up how far the drives are."""

    def __init__(self, campaign: Campaign, progress: Callable[[CampaignProgress], object] | None):
        self._campaign = campaign
        self._progress = progress
        self._began = time.perf_counter()
        self._driven = dict.fromkeys(campaign.manoeuvres, 0.0)
        self._ended: list[bool] = []

    def heard(self, name: str, seconds: float) -> None:
        """A drive has come so far."""
        self._driven[name] = seconds
        self._tell()

    def ended(self, recording: Recording) -> None:
        """A drive has ended."""
        self._driven[recording.name] = recording.manoeuvre.duration
        self._ended.append(bool(recording.failure))
        self._tell()

    def cancelled(self) -> Cancelled:
        """What is raised when the campaign is to stop."""
        return Cancelled(
            f"The campaign was cancelled after {len(self._ended)} of {len(self._driven)} drives."
        )

    def _tell(self) -> None:
        if self._progress is not None:
            self._progress(
                CampaignProgress(
                    len(self._ended),
                    len(self._driven),
                    sum(self._ended),
                    sum(self._driven.values()),
                    self._campaign.seconds,
                    time.perf_counter() - self._began,
                )
            )


def _here(
    campaign: Campaign, watch: _Watch, cancelled: Asked, processes: int
) -> Iterator[Recording]:
    """One drive after the other."""
    for name in campaign.manoeuvres:
        if cancelled():
            raise watch.cancelled()
        recording = campaign.record(name, lambda s: watch.heard(name, s), cancelled)
        watch.ended(recording)
        yield recording


def _in_processes(
    campaign: Campaign, watch: _Watch, cancelled: Asked, processes: int
) -> Iterator[Recording]:
    """Several drives at a time."""
    spawn = multiprocessing.get_context("spawn")
    news, stop = spawn.SimpleQueue(), spawn.Event()
    pool = ProcessPoolExecutor(processes, spawn, _begin, (news, stop))
    try:
        with _interrupts_later():
            waiting: set[Future[Recording]] = {
                pool.submit(_record, campaign, name) for name in campaign.manoeuvres
            }
        while waiting:
            if cancelled():
                raise watch.cancelled()
            ended, waiting = wait(waiting, LOOK_EVERY, FIRST_COMPLETED)
            while not news.empty():
                watch.heard(*news.get())
            for future in ended:
                recording = future.result()
                watch.ended(recording)
                yield recording
    except BrokenProcessPool as error:
        raise CampaignError(
            "A process that drove was lost, perhaps for lack of memory; drive with --processes 1."
        ) from error
    finally:
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """An interrupt waits for the block's end, for a process that is half started dies loudly.

    Processes that start meanwhile never see SIGINT, which is their parent's business.
    """
    kept = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, kept)


_news: Any = None
_stop: Any = None


def _begin(news: Any, stop: Any) -> None:
    """In a process of its own, first."""
    global _news, _stop
    _news, _stop = news, stop
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})


def _record(campaign: Campaign, name: str) -> Recording:
    """In a process of its own: one drive."""
    told = 0.0

    def progress(seconds: float) -> None:
        nonlocal told
        if time.monotonic() - told >= TELL_EVERY:
            told = time.monotonic()
            _news.put((name, seconds))

    def stopped() -> bool:
        return _stop.is_set() or not (parent and parent.is_alive())

    parent = multiprocessing.parent_process()
    return campaign.record(name, progress, stopped)
