"""Progress on standard error: one line on a terminal that goes when the work ends, else lines."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Generic, TypeVar

Progress = TypeVar("Progress")

TELL_EVERY = 10.0
"""Time between two lines of progress where no terminal shows them, s."""


@contextmanager
def watch(line: Callable[[Progress], str]) -> Iterator["Watch[Progress]"]:
    """Something to call with the latest progress; `line` says it."""
    watching = Watch(line)
    try:
        yield watching
    finally:
        watching.clear()


class Watch(Generic[Progress]):
    """Tells how far the work is."""

    def __init__(self, line: Callable[[Progress], str]):
        self.terminal = sys.stderr.isatty()
        self._line = line
        self._told = time.monotonic()

    def __call__(self, now: Progress) -> None:
        """Take the latest progress."""
        if self.terminal:
            print(f"\r{self._line(now)}\033[K", end="", file=sys.stderr, flush=True)
        elif time.monotonic() - self._told >= TELL_EVERY:
            self._told = time.monotonic()
            print(self._line(now), file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Take the line off a terminal."""
        if self.terminal:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


def left(done: float, of: float, seconds: float) -> str:
    """How long the rest takes at the speed so far."""
    return f"{hours((of - done) * seconds / done if done else 0.0)} left"


def hours(seconds: float) -> str:
    """A time as 1:02:03."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"
