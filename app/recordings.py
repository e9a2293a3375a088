"""Measurement files as runs: parsed once, kept in memory while they are in use, summed up.

The original on disk stays the truth; a run here can always be read again from it.
"""

import threading
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..engine.channels import Run, channel
from ..engine.errors import MeasurementError
from ..engine.run_notes import doubtful_noise
from .store import Measurement, Store

REMEMBERED_VALUES = 8_000_000
"""Numbers kept in memory over all runs: 64 MB."""


class Recordings:
    """Runs of measurements, the most recently used ones in memory."""

    def __init__(self, store: Store):
        self._store = store
        self._runs: OrderedDict[str, Run] = OrderedDict()
        self._lock = threading.Lock()

    def run(self, measurement: Measurement) -> Run:
        """The parsed recording under the measurement's name, with its noise."""
        with self._lock:
            run = self._runs.get(measurement.sha256)
            if run is not None:
                self._runs.move_to_end(measurement.sha256)
        if run is None:
            run = parse(self._store.original(measurement).read_bytes(), measurement.name)
            self._remember(measurement.sha256, run)
        return replace(
            run,
            name=measurement.name,
            noise=measurement.noise,
            warnings=(*run.warnings, *doubtful_noise(measurement.noise, run.channels)),
        )

    def _remember(self, sha256: str, run: Run) -> None:
        with self._lock:
            self._runs[sha256] = run
            while (
                len(self._runs) > 1 and sum(map(_values, self._runs.values())) > REMEMBERED_VALUES
            ):
                self._runs.popitem(last=False)


def parse(data: bytes, name: str, noise: Mapping[str, float] | None = None) -> Run:
    """Read a measurement file; MeasurementError says what is wrong with it and where.

    noise : standard deviations in SI by channel, which are stated beside the file
    """
    from ..engine.measurement import parse_run

    try:
        return parse_run(data, name, noise=noise)
    except (RecursionError, MemoryError, OverflowError) as error:
        raise MeasurementError(
            f"{name}: the file is too large or too deep to read ({type(error).__name__}); "
            "send a plain CSV."
        ) from None


def with_braking(run: Run, intervals: Iterable[tuple[float, float]] | None) -> Run:
    """The run with its braking marked, if it is marked."""
    return run if intervals is None else replace(run, braking=tuple(map(tuple, intervals)))


def summary(run: Run) -> dict[str, Any]:
    """What a person wants to know of a recording before using it."""
    from ..engine.measurement import missing_for_identification

    missing = list(missing_for_identification(run))
    return {
        "samples": len(run.time),
        "duration": run.duration,
        "sample_step": run.sample_step,
        "channels": [_channel(name, run) for name in run.columns],
        "warnings": list(run.warnings),
        "usable_for_identification": not missing,
        "missing": missing,
    }


def _channel(name: str, run: Run) -> Mapping[str, Any]:
    values = run[name]
    return {
        "name": name,
        "unit": channel(name).unit,
        "minimum": float(values.min()),
        "maximum": float(values.max()),
        "rms": float(np.sqrt(np.mean(values**2))),
    }


def _values(run: Run) -> int:
    return len(run.time) * (1 + len(run.columns))
