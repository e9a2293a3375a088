"""Every error a caller can mend, each with a stable code and one sentence for a person.

A message names the place (file, line, field, channel), says what is wrong there, and what to do.
How a numerical method ended is not an error: a poor fit is a result.
"""

import re
from typing import Any

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]+")
_LONG = re.compile(r"(\S{160})\S{40,}")


class RideError(Exception):
    """An input or a request that the caller can mend; `str(error)` is the sentence to show.

    A name, a key or a text of a file that it repeats may be anything: control characters and ends
    of lines become spaces, and what no word is so long as is shortened.
    """

    code = "ride"

    def __init__(self, sentence: str = ""):
        super().__init__(_LONG.sub(r"\1...", _CONTROL.sub(" ", sentence)))

    def __reduce__(self) -> tuple[Any, ...]:
        """Between processes it goes as it is: made anew it would want what made its sentence."""
        return _as_it_was, (type(self), self.args, self.__dict__)


def _as_it_was(kind: type[RideError], args: tuple[Any, ...], known: dict[str, Any]) -> RideError:
    error = kind.__new__(kind)
    error.args = args
    error.__dict__.update(known)
    return error


class VehicleError(RideError):
    """A vehicle's data is missing, misspelt or physically impossible."""

    code = "vehicle"


class ParameterError(RideError):
    """An unknown parameter name or a value outside its range."""

    code = "parameter"


class MeasurementError(RideError):
    """A measurement file or one of its channels cannot be used."""

    code = "measurement"


class UnmappedError(MeasurementError):
    """A measurement file cannot be read by the names of our channels, but under a mapping: its
    columns have others, or have no number here and there.
    """


class ConditioningError(RideError):
    """A step of conditioning cannot be done to a recording as asked."""

    code = "conditioning"


class RoadError(RideError):
    """A road profile or its description cannot be used."""

    code = "road"


class ManoeuvreError(RideError):
    """A manoeuvre's description cannot be used."""

    code = "manoeuvre"


class SimulationError(RideError):
    """A simulation cannot be set up as asked."""

    code = "simulation"


class SimulationDiverged(SimulationError):
    """A simulation left the range where the model means anything.

    time : when, s
    coordinate : which generalized coordinate, by its channel name
    """

    code = "simulation-diverged"

    def __init__(self, time: float, coordinate: str, remedy: str):
        super().__init__(f"The simulation diverged at t = {time:.3f} s in {coordinate}; {remedy}")
        self.time = time
        self.coordinate = coordinate


class ProblemError(RideError):
    """An identification cannot be set up: runs, free parameters or bounds do not fit together."""

    code = "identification"


class SweepError(RideError):
    """A sweep cannot be set up: its parameters, levels or ranges, or how much it asks for."""

    code = "sweep"


class CampaignError(RideError):
    """A campaign cannot be driven as asked, or some of its recordings are not whole."""

    code = "campaign"


class Cancelled(RideError):
    """The caller asked for the work to stop."""

    code = "cancelled"
