"""What a step needs of a run, and what it leaves."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..channels import channel
from ..errors import ConditioningError
from ..filters import PAD_PERIODS, is_uniform, resolved, too_coarse
from ..run import Run

Array = NDArray[np.float64]
Band = tuple[float | None, float | None]


@dataclass(frozen=True, slots=True, eq=False)
class Done:
    """What a step has done to a run.

    channels : those it writes; all that are left, where it changes the time
    time : None where it stays
    noise : standard deviations that it changes, SI
    settled : warnings of the run that hold no longer
    others as of StepRecord
    """

    channels: Mapping[str, Array]
    time: Array | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)
    band_hz: Band = (None, None)
    sentences: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    noise: Mapping[str, float] = field(default_factory=dict)
    settled: tuple[str, ...] = ()


def history(run: Run, name: str) -> Array:
    """A channel (samples,) without gaps; ConditioningError with the remedy where it has some."""
    values = recorded(run, name)
    if not np.all(np.isfinite(values)):
        first = run.time[np.argmin(np.isfinite(values))]
        raise ConditioningError(
            f"{name} has gaps (not a number) from {first:.4g} s on; fill or cut them before."
        )
    return values


def history_or(run: Run, name: str, otherwise: float) -> Array:
    """A channel (samples,) without gaps, or a constant in its place."""
    return history(run, name) if name in run else np.full(len(run.time), otherwise)


def recorded(run: Run, name: str) -> Array:
    """A channel (samples,) as it is; ConditioningError where the run lacks it."""
    require(run, [name])
    return run[name]


def require(run: Run, names: Iterable[str]) -> None:
    """Refuse a run without some channels."""
    missing = [channel(name).name for name in names if name not in run]
    if missing:
        raise ConditioningError(
            f"the run lacks {', '.join(missing)}, it holds {', '.join(run.columns)}; record "
            f"{'it' if len(missing) == 1 else 'them'}, add a step before that makes "
            f"{'it' if len(missing) == 1 else 'them'}, or leave this step out."
        )


def require_even(run: Run) -> None:
    """Refuse a run that is not sampled evenly."""
    if not is_uniform(run.time):
        raise ConditioningError("the samples are not evenly spaced in time; resample before.")


def require_resolved(run: Run, low: float, name: str) -> None:
    """Refuse a lowest frequency, Hz, of which the record does not hold enough periods."""
    if not resolved(run.time, low):
        raise ConditioningError(
            f"{name} begins at {low:g} Hz, which takes a record of {PAD_PERIODS / low:.3g} s, and "
            f"this one lasts {run.duration:.3g} s; raise it to {PAD_PERIODS / run.duration:.2g} Hz "
            "or more."
        )


def require_sampled(run: Run, high: float, name: str) -> None:
    """Refuse a highest frequency, Hz, that the sampling does not hold."""
    step = run.duration / (len(run.time) - 1)
    if too_coarse(step, high):
        raise ConditioningError(
            f"{name} ends at {high:g} Hz, and a sample every {1e3 * step:.3g} ms holds "
            f"{0.45 / step:.3g} Hz; lower it."
        )


def require_band(run: Run, band: tuple[float, float]) -> None:
    """Refuse a band that is empty or that the record does not hold."""
    low, high = band
    if low >= high:
        raise ConditioningError(
            f"band_hz goes from {low:g} to {high:g} Hz; give the lower frequency first."
        )
    require_resolved(run, low, "band_hz")
    require_sampled(run, high, "band_hz")
