"""Runs as the service hands them about."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Protocol

from ...engine.run import Run
from ..storage.measurement import Measurement


class Runs(Protocol):
    """Whatever gives the runs of measurements."""

    def run(self, measurement: Measurement) -> Run:
        """The recording as it is used."""
        ...


def with_braking(run: Run, intervals: Iterable[tuple[float, float]] | None) -> Run:
    """The run with its braking marked, if it is marked."""
    return run if intervals is None else replace(run, braking=tuple(map(tuple, intervals)))


def size(run: Run) -> int:
    """Numbers in a run."""
    return run.time.size * (1 + len(run.columns))
