"""Time histories of one recording or simulation."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .channels import channel, in_order
from .errors import MeasurementError
from .step_record import StepRecord


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Time histories in SI of one recording or simulation.

    time : (n,), strictly increasing, s
    channels : name -> (n,) in the channel's SI unit
    noise : name -> standard deviation of the measurement noise in SI, where it is known
    warnings : sentences about what is doubtful in the recording
    braking : (begin, end) in s where the car brakes; None to look for it in a_x
    conditioning : what made these channels of those that were recorded, step by step
    vehicle : name of the car that was driven, where it is known
    plant : which car of a campaign drove, as `Plant.name`; empty where no virtual one is known
    """

    name: str
    time: NDArray[np.float64]
    channels: Mapping[str, NDArray[np.float64]]
    noise: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    description: str = ""
    braking: tuple[tuple[float, float], ...] | None = None
    conditioning: tuple[StepRecord, ...] = ()
    vehicle: str = ""
    plant: str = ""

    def __post_init__(self) -> None:
        """Check the shapes and bring the channels into the table's order."""
        time = np.ascontiguousarray(self.time, dtype=np.float64)
        if time.ndim != 1 or time.size < 2 or not np.all(np.diff(time) > 0.0):
            raise MeasurementError(
                f"{self.name}: time must be one strictly increasing column of at least two samples."
            )
        ordered = {}
        for name in in_order(self.channels):
            info = channel(name)
            values = np.ascontiguousarray(self.channels[name], dtype=np.float64)
            if name == "time" or values.shape != time.shape:
                raise MeasurementError(
                    f"{self.name}: {info.name} has shape {values.shape}, but time has"
                    f" {time.shape}; give one value a sample."
                )
            ordered[name] = values
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "channels", ordered)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """One channel's values, or the time."""
        if name == "time":
            return self.time
        if name not in self.channels:
            channel(name)
            raise MeasurementError(
                f"{self.name}: there is no channel {name}; it holds {', '.join(self.columns)}."
            )
        return self.channels[name]

    def __contains__(self, name: object) -> bool:
        """Whether the run holds a channel (or the time, which it always does)."""
        return name == "time" or name in self.channels

    @property
    def columns(self) -> list[str]:
        """Names of the channels, time apart, in the order of the table."""
        return list(self.channels)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.time[-1] - self.time[0])

    @property
    def sample_step(self) -> float:
        """Median time between samples, s."""
        return float(np.median(np.diff(self.time)))
