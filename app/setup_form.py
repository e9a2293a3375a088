"""What a page may change in a session's set-up: names and numbers that say something to a fit.

Whether a fit can be made of it is for the identification, which is given all of it at once.
"""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from ..engine.channels import channel
from ..engine.errors import MeasurementError, ParameterError, RideError
from ..engine.parameters import parameter
from .schemas import Intervals, Name, Number, SearchForm, SensorForm, WireForm


class RideForm(WireForm):
    """What is on show: a measurement by its id, or a known manoeuvre by its key."""

    kind: Literal["measurement", "manoeuvre"]
    id: Name | None = None
    key: Name | None = None

    @model_validator(mode="after")
    def _named(self) -> "RideForm":
        needed = "id" if self.kind == "measurement" else "key"
        if getattr(self, needed) is None:
            raise PydanticCustomError(
                "ride", "give the {needed} of a {kind}", {"needed": needed, "kind": self.kind}
            )
        return self


def _parameter_name(told: str) -> str:
    """The name of a parameter that is told by name or symbol."""
    try:
        return parameter(told).name
    except ParameterError as error:
        raise _refused(error) from None


def _channel_name(told: str) -> str:
    """The name of a known channel."""
    try:
        return channel(told).name
    except MeasurementError as error:
        raise _refused(error) from None


def _refused(error: RideError) -> PydanticCustomError:
    """A refusal of the engine as the end of a sentence about a field, which sets its full stop."""
    return PydanticCustomError("name", "{said}", {"said": str(error).rstrip(".")})


def _in_order(bounds: tuple[float | None, float | None]) -> tuple[float | None, float | None]:
    """Bounds between which something lies."""
    lower, upper = bounds
    if lower is not None and upper is not None and lower >= upper:
        raise PydanticCustomError("bounds", "give a lower bound below the upper one")
    return bounds


ParameterName = Annotated[Name, AfterValidator(_parameter_name)]
ChannelName = Annotated[Name, AfterValidator(_channel_name)]
Bounds = Annotated[tuple[Number | None, Number | None], AfterValidator(_in_order)]
Deviation = Annotated[Number, Field(gt=0, le=1e6)]


class SetupForm(SearchForm):
    """What changes in what the page will ask of the next identification; untold parts stay.

    `use` and what follows tell entries by measurement, parameter or channel: others stay, null
    takes one away. `settings` tells those that change.

    ride : on show
    fixed : parameters that are not found
    use : of a measurement; of others the page finds one
    bounds : (lower, upper), null for the default
    """

    ride: RideForm | None = None
    fixed: Annotated[list[ParameterName], Field(max_length=50)] | None = None
    use: dict[Name, Literal["fit", "hold_out", "leave_out"] | None] = {}
    braking: dict[Name, Intervals | None] = {}
    bounds: Annotated[dict[ParameterName, Bounds | None], Field(max_length=50)] = {}
    noise: Annotated[dict[ChannelName, Deviation | None], Field(max_length=50)] = {}
    priors: Annotated[
        dict[ParameterName, tuple[Number, Deviation] | None], Field(max_length=50)
    ] = {}
    sensors: Annotated[dict[ChannelName, SensorForm | None], Field(max_length=50)] = {}
