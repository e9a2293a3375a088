"""What one measurement found: figures with their units, some with a target."""

from collections.abc import Sequence
from dataclasses import dataclass

PERCENTS = (50, 95, 99)


@dataclass(frozen=True, slots=True)
class Figure:
    """One number, SI.

    most, least : the target, where there is one
    """

    name: str
    value: float
    unit: str
    most: float | None = None
    least: float | None = None

    @property
    def met(self) -> bool | None:
        """Whether the target is; None without one."""
        if self.most is not None:
            return self.value < self.most
        return self.value > self.least if self.least is not None else None


@dataclass(frozen=True, slots=True)
class Measured:
    """Figures of one row.

    what : under which load
    load : the machine's load average before
    generator : share of a core that the bench itself took meanwhile
    """

    what: str
    figures: tuple[Figure, ...]
    load: float = 0.0
    generator: float = 0.0


def percentile(values: Sequence[float], percent: float) -> float:
    """The least value that so many percent do not exceed."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, max(0, -int(-percent * len(ordered) // 100) - 1))]


def percentiles(name: str, values: Sequence[float], **targets: float) -> list[Figure]:
    """Figures `NAME p50` and so on of durations, s; targets : most by percent, as p95=0.1."""
    return [
        Figure(f"{name} p{percent}", percentile(values, percent), "s", targets.get(f"p{percent}"))
        for percent in PERCENTS
    ]
