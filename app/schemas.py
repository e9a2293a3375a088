"""What a request may say: the wire forms, checked here for shape and by the engine for sense.

Vehicles, manoeuvres and roads stay plain JSON objects: the engine's readers know their fields, name
the nearest one for a misspelt key, and are shared with the command line.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    FiniteFloat,
    Strict,
    StringConstraints,
    Tag,
)
from pydantic_core import PydanticCustomError

from ..engine.identification.search_settings import (
    DEFAULT_SCALE,
    LARGEST_SCALE,
    MOST_STARTS,
    SMALLEST_SCALE,
    LossName,
)
from ..engine.simulation import rims_settings
from ..engine.simulation.rims_settings import (
    HIGHEST_HIGHPASS,
    LOWEST_CUTOFF,
    LOWEST_HIGHPASS,
    InitialState,
    RimsSettings,
)
from ..engine.simulation.step_limits import LONGEST_SAMPLE_STEP, LONGEST_STEP, SHORTEST_STEP
from .session_name import LONGEST, on_one_line

Number = Annotated[FiniteFloat, Strict()]
Whole = Annotated[int, Strict()]
Seed = Annotated[int, Strict(), Field(ge=0, le=2**53)]
Flag = Annotated[bool, Strict()]
JsonObject = Mapping[str, Any]
Name = Annotated[str, StringConstraints(min_length=1, max_length=100)]
Names = Annotated[list[Name], Field(max_length=200)]
Traction = Literal["exact", "paper"]
Cutoff = Annotated[Number, Field(ge=LOWEST_CUTOFF)] | None
Highpass = Annotated[Number, Field(ge=LOWEST_HIGHPASS, le=HIGHEST_HIGHPASS)] | None
RimsStep = Annotated[Number, Field(ge=rims_settings.SHORTEST_STEP, le=rims_settings.LONGEST_STEP)]
Intervals = Annotated[list[tuple[Number, Number]], Field(max_length=100)]
RIMS = RimsSettings()
SHORTEST_PREVIEW = 0.01
"""Of a road, m."""


def _key_or_object(value: Any) -> Any:
    """One refusal in place of one for each member of a union."""
    if not isinstance(value, str | Mapping):
        raise PydanticCustomError("manoeuvre", "give a known manoeuvre's key or an object")
    return value


def _keys_or_object(value: Any) -> Any:
    """As `_key_or_object`, of several manoeuvres."""
    if not isinstance(value, list | Mapping):
        raise PydanticCustomError(
            "manoeuvres", "give a list of known manoeuvres' keys, or an object by name"
        )
    return value


def _part_of_path(value: str) -> str:
    """A name that is one part of an address, however a browser shortens that."""
    if "/" in value or "\\" in value or not value.strip("."):
        raise PydanticCustomError("name", "give a name without / and \\ that is more than dots")
    return value


def _session_name(value: str) -> str:
    """The name of a session, as it is kept."""
    try:
        return on_one_line(value)
    except ValueError as error:
        raise PydanticCustomError("name", "{said}", {"said": str(error)}) from None


SessionName = Annotated[
    str,
    AfterValidator(_session_name),
    Field(description=f"1 to {LONGEST} characters without control characters."),
]
KeyOrObject = Annotated[str | JsonObject, BeforeValidator(_key_or_object)]
PathName = Annotated[Name, AfterValidator(_part_of_path)]


class WireForm(BaseModel):
    """A request body: unknown fields are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class RimsSettingsForm(WireForm):
    """How recordings are prepared for the rims mode; null for no filter, `step` in s."""

    a_x_cutoff_hz: Cutoff = RIMS.a_x_cutoff_hz
    rim_cutoff_hz: Cutoff = RIMS.rim_cutoff_hz
    output_cutoff_hz: Cutoff = RIMS.output_cutoff_hz
    output_highpass_hz: Highpass = RIMS.output_highpass_hz
    initial_state: InitialState = RIMS.initial_state
    step: RimsStep = RIMS.step

    def settings(self) -> RimsSettings:
        """The engine's settings."""
        return RimsSettings(**self.model_dump())


class RimsRequest(WireForm):
    """Let the model follow the wheel centres of a measurement.

    braking : (begin, end) where the car brakes, s; without it, what a_x shows
    """

    measurement: Name
    traction: Traction = "exact"
    settings: RimsSettingsForm = RimsSettingsForm()
    braking: Intervals | None = None


class PostsRequest(WireForm):
    """Stand the car on a rig whose posts move as measured."""

    measurement: Name


class ExcitationForm(WireForm):
    """What a car goes through: a manoeuvre ("2" without), a recording's rims, or its posts.

    road, duration : in place of the manoeuvre's
    lift_off, step, sample_step : with a manoeuvre or posts; untold, the step is the car's
        (2.5 ms, 1.25 ms with two-slope dampers) and the sample step 5 ms
    """

    manoeuvre: KeyOrObject | None = None
    rims: RimsRequest | None = None
    posts: PostsRequest | None = None
    road: JsonObject | None = None
    duration: Number | None = None
    lift_off: Flag = False
    step: Annotated[Number, Field(ge=SHORTEST_STEP, le=LONGEST_STEP)] | None = None
    sample_step: Annotated[Number, Field(ge=SHORTEST_STEP, le=LONGEST_SAMPLE_STEP)] | None = None


class BandsForm(WireForm):
    """95 % bands of a simulation by the errors of an identification that is done.

    cars, seed : of the sampling
    """

    identification: Name
    method: Literal["linear", "sampled"] = "linear"
    cars: Annotated[Whole, Field(ge=39, le=256)] = 64
    seed: Seed = 0


class SimulationRequest(ExcitationForm):
    """One simulation of the session's car, or of another one."""

    vehicle: JsonObject | None = None
    values: Annotated[dict[Name, Number], Field(max_length=200)] = {}
    model: Literal["8dof", "7dof"] = "8dof"
    channels: Names | None = None
    max_samples: Annotated[Whole, Field(ge=2, le=2_000_000)] | None = None
    decimate: Literal["extremes", "stride"] = "extremes"
    seq: Annotated[Whole, Field(ge=0, le=2**53)] = 0
    scene: Flag = False
    bands: BandsForm | None = None


class SpacedForm(WireForm):
    """Evenly spaced levels, both ends included."""

    low: Number
    high: Number
    count: Whole


def _list_or_object(value: Any) -> Any:
    """As `_key_or_object`; the form of the levels is told by what is given."""
    if not isinstance(value, list | Mapping):
        raise PydanticCustomError("levels", "give a list of numbers, or low, high and count")
    return value


Levels = Annotated[
    Annotated[SpacedForm, Tag("spaced")]
    | Annotated[list[Number], Field(max_length=10_000), Tag("listed")],
    Discriminator(lambda value: "listed" if isinstance(value, list) else "spaced"),
    BeforeValidator(_list_or_object),
]


class FullFactorialForm(WireForm):
    """Every combination of levels, given by parameter, SI."""

    kind: Literal["full-factorial"]
    levels: Annotated[dict[Name, Levels], Field(max_length=200)]


class SampledForm(WireForm):
    """Cars drawn from a box, (low, high) by parameter, SI."""

    kind: Literal["sobol", "latin-hypercube"]
    ranges: Annotated[dict[Name, tuple[Number, Number]], Field(max_length=200)]
    cars: Whole
    seed: Seed = 0


class SweepRequest(ExcitationForm):
    """Let a design of cars, made from the session's (or another one), go through the same."""

    vehicle: JsonObject | None = None
    design: Annotated[FullFactorialForm | SampledForm, Field(discriminator="kind")]
    key: Name | None = None


Manoeuvres = Annotated[
    Annotated[dict[Name, KeyOrObject], Field(max_length=50), Tag("named")]
    | Annotated[list[Name], Field(max_length=50), Tag("known")],
    Discriminator(lambda value: "known" if isinstance(value, list) else "named"),
    BeforeValidator(_keys_or_object),
]


class CampaignRequest(WireForm):
    """Let a car that is known drive manoeuvres while virtual sensors record.

    manoeuvres : keys of known ones, or by the recording's name a key or an object; the usual ones
    class_factor, band (cycle/m), road_seed : of every random road among them
    noise : standard deviation by channel of the usual sensors, SI;  sensors : in their place
    """

    plant: Name = "concept"
    vehicle: JsonObject | None = None
    manoeuvres: Manoeuvres | None = None
    class_factor: Number | None = None
    band: tuple[Number, Number] | None = None
    road_seed: Seed | None = None
    noise: Annotated[dict[Name, Annotated[Number, Field(ge=0, le=1e6)]], Field(max_length=50)] = {}
    sensors: JsonObject | None = None
    seed: Seed = 0
    format: Literal["csv", "mf4"] = "csv"
    key: Name | None = None


class AdviceRequest(WireForm):
    """What to drive next, after an identification that is done or before there is any run.

    vehicle : in place of the session's, where there is no identification
    candidates : keys of known manoeuvres, or by key a known one's or an object; the usual ones
    planned : keys of those that will be driven in any case
    noise : standard deviation by channel of the sensors, SI, where there is no identification
    """

    identification: Name | None = None
    vehicle: JsonObject | None = None
    candidates: Manoeuvres | None = None
    planned: Annotated[list[Name], Field(max_length=20)] = []
    noise: Annotated[dict[Name, Annotated[Number, Field(ge=0, le=1e6)]], Field(max_length=50)] = {}


class RoadPreview(WireForm):
    """A road as a manoeuvre would build it, seen from above the car at rest."""

    road: JsonObject
    length: Annotated[Number, Field(ge=SHORTEST_PREVIEW, le=20_000)] = 200.0
    torque_end: Annotated[Number, Field(ge=0, le=20_000)] = 100.0
    seed: Seed = 0
    points: Annotated[Whole, Field(ge=2, le=20_000)] = 2000


class ConditioningRequest(WireForm):
    """Steps that are done to a measurement before it is used; none for the recording as it is.

    vehicle : whose dimensions the steps take that need some, in place of the session's car
    """

    steps: Annotated[list[JsonObject], Field(max_length=100)]
    vehicle: JsonObject | None = None


class NewSession(WireForm):
    """What a fresh session is called; untold a name that its visitor's others do not have."""

    name: SessionName | None = None


class SessionNameForm(WireForm):
    """What a session is called."""

    name: SessionName


class NamedMapping(WireForm):
    """A mapping to be kept for the next files whose columns are the same."""

    name: PathName
    mapping: JsonObject


class StartValues(WireForm):
    """Where parameters start, SI, by name."""

    start: Annotated[dict[Name, Number], Field(max_length=50)]


class ValidationRequest(WireForm):
    """Let the car of an identification that is done predict its runs, and others held out.

    manoeuvres : by measurement, what was driven in place of what is kept with it: a known
        manoeuvre's key, an object, or null where it is not known
    braking : by measurement, as of an identification, which tells that of its own runs
    geometry : {"front": {"distance": m, "angle": rad}, "rear": ...}, one axle or both
    """

    identification: Name
    hold_out: Annotated[list[Name], Field(max_length=20)] = []
    manoeuvres: Annotated[dict[Name, KeyOrObject | None], Field(max_length=40)] = {}
    braking: Annotated[dict[Name, Intervals], Field(max_length=40)] = {}
    geometry: JsonObject | None = None
    key: Name | None = None


class ProfileRequest(WireForm):
    """How well a fit holds one parameter: hold it elsewhere, fit all others anew.

    parameter : name or symbol, of one that was free
    """

    identification: Name
    parameter: Name
    key: Name | None = None


def _number_or_fit(value: Any) -> Any:
    """As `_key_or_object`, of a sensor's quantity."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number or value == "fit"):
        raise PydanticCustomError("quantity", 'give a number or "fit"')
    return value


SensorForm = Annotated[
    dict[Name, Annotated[Number | Literal["fit"], BeforeValidator(_number_or_fit)]],
    Field(max_length=10),
]


class SearchForm(WireForm):
    """How parameters are found, whichever they are and of whatever runs.

    starts, seed : points tried as starts, the told one and others between the bounds
    loss, loss_scale : how much outliers count, and from how many noises on they are ones
    fit_noise : find the noise of all compared channels for which `sensors` says none
    """

    traction: Traction = "exact"
    settings: RimsSettingsForm = RimsSettingsForm()
    starts: Annotated[Whole, Field(ge=1, le=MOST_STARTS)] = 1
    seed: Seed = 0
    loss: LossName = "linear"
    loss_scale: Annotated[Number, Field(ge=SMALLEST_SCALE, le=LARGEST_SCALE)] = DEFAULT_SCALE
    fit_noise: Flag = False


class IdentificationRequest(SearchForm):
    """Find parameters of the session's car (or of another start) from measurements.

    braking : by measurement, (begin, end) where the car brakes, s; for others what a_x shows
    priors : by parameter its mean and standard deviation, known before the runs, SI
    sensors : by channel what its sensor is known to do, SI, or "fit" for what is to be found:
        delay, gain, bias, sign and noise
    """

    runs: Annotated[list[Name], Field(max_length=20)]
    vehicle: JsonObject | None = None
    free: Names | None = None
    fixed: Names | None = None
    bounds: Annotated[dict[Name, tuple[Number, Number]], Field(max_length=50)] = {}
    start: Annotated[dict[Name, Number], Field(max_length=50)] = {}
    noise: Annotated[dict[Name, Number], Field(max_length=50)] = {}
    braking: Annotated[dict[Name, Intervals], Field(max_length=20)] = {}
    priors: Annotated[dict[Name, tuple[Number, Number]], Field(max_length=50)] = {}
    sensors: Annotated[dict[Name, SensorForm], Field(max_length=50)] = {}
    key: Name | None = None
