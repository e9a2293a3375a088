"""What a request may say: the wire forms, checked here for shape and by the engine for sense.

Vehicles, manoeuvres and roads stay plain JSON objects: the engine's readers know their fields, name
the nearest one for a misspelt key, and are shared with the command line.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, StringConstraints

JsonObject = Mapping[str, Any]
Name = Annotated[str, StringConstraints(min_length=1, max_length=100)]
Names = Annotated[list[Name], Field(max_length=200)]
Traction = Literal["exact", "paper"]


class WireForm(BaseModel):
    """A request body: unknown fields are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class RimsRequest(WireForm):
    """Let the model follow the wheel centres of a measurement."""

    measurement: Name
    traction: Traction = "exact"


class PostsRequest(WireForm):
    """Stand the car on a rig whose posts move as measured."""

    measurement: Name


class SimulationRequest(WireForm):
    """One simulation of the session's car, or of another one."""

    vehicle: JsonObject | None = None
    values: Annotated[dict[Name, FiniteFloat], Field(max_length=200)] = {}
    manoeuvre: Name | JsonObject | None = None
    rims: RimsRequest | None = None
    posts: PostsRequest | None = None
    road: JsonObject | None = None
    model: Literal["8dof", "7dof"] = "8dof"
    lift_off: bool = False
    step: Annotated[FiniteFloat, Field(ge=1e-4, le=0.01)] = 0.002
    sample_step: Annotated[FiniteFloat, Field(ge=5e-4, le=0.1)] = 0.005
    channels: Names | None = None
    max_samples: Annotated[int, Field(ge=2, le=2_000_000)] | None = None
    decimate: Literal["extremes", "stride"] = "extremes"
    seq: Annotated[int, Field(ge=0, le=2**53)] = 0
    scene: bool = False


class RoadPreview(WireForm):
    """A road as a manoeuvre would build it, seen from above the car at rest."""

    road: JsonObject
    length: Annotated[FiniteFloat, Field(gt=0, le=20_000)] = 200.0
    torque_end: Annotated[FiniteFloat, Field(ge=0, le=20_000)] = 100.0
    seed: Annotated[int, Field(ge=0, le=2**53)] = 0
    points: Annotated[int, Field(ge=2, le=20_000)] = 2000


class IdentificationRequest(WireForm):
    """Find parameters of the session's car (or of another start) from measurements."""

    runs: Annotated[list[Name], Field(max_length=20)]
    vehicle: JsonObject | None = None
    free: Names | None = None
    fixed: Names | None = None
    bounds: Annotated[dict[Name, tuple[FiniteFloat, FiniteFloat]], Field(max_length=50)] = {}
    start: Annotated[dict[Name, FiniteFloat], Field(max_length=50)] = {}
    noise: Annotated[dict[Name, FiniteFloat], Field(max_length=50)] = {}
    traction: Traction = "exact"
    key: Name | None = None
