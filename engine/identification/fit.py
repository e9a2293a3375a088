"""The result of an identification, as data; how it ended is a sentence."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from ..simulation.braking import Interval
from ..simulation.rims_settings import RimsSettings
from ..step_record import StepRecord
from ..vehicle import Vehicle
from .loss import Loss
from .noise_source import NoiseSource
from .uncertainty import Uncertainty
from .variables import FreeParameter

Array = NDArray[np.float64]

DETERMINED_BELOW = 0.15
WEAKLY_BELOW = 0.50
"""Half-width of the 95 % interval over its size, |value| unless that may be 0, up to which a
parameter is determined, or weakly."""

DELAY_MATTERS = 0.005
"""What stands for |value| where it is a delay's, s: one sample at the usual rate."""


class Outcome(StrEnum):
    """How a fit ended; the value is the sentence the engineer reads."""

    DETERMINED = "The fit converged and the runs determine every free parameter."
    WEAKLY = "The fit converged; the runs determine some of the free parameters only weakly."
    AT_BOUND = (
        "The fit converged at a bound of the search; the warnings name it and say what to do."
    )
    UNDETERMINED = (
        "The fit converged, but the runs do not determine every free parameter; fix one or "
        "measure more."
    )
    DOUBTFUL = (
        "The fit ended, but a channel is probably wrong (its sign, its unit, its column, spikes or "
        "a dead sensor) or the car lacks its brakes, so nothing is determined; mend it as the "
        "warnings say and fit again."
    )
    ASTRAY = (
        "The fit ended further from the measurement than the measurement's own mean; check signs "
        "and units of the channels, the car's known data, any priors and the start values."
    )
    BUDGET_SPENT = (
        "The fit ran out of evaluations before it converged; begin another from its values, or "
        "free fewer parameters."
    )
    STUCK = (
        "The fit stopped because the model fails for most cars around it; choose other start "
        "values or narrower bounds."
    )


CONVERGED = (Outcome.DETERMINED, Outcome.WEAKLY, Outcome.AT_BOUND, Outcome.UNDETERMINED)


class Ending(StrEnum):
    """How one search ended; the value is the sentence the engineer reads."""

    CONVERGED = "The search converged."
    SAME_BASIN = "The search was cut short in the basin of a minimum already found."
    BUDGET_SPENT = "The search ran out of evaluations before it converged."
    STUCK = "The search stopped because the model fails for most cars around it."


@dataclass(frozen=True, slots=True)
class Estimate:
    """One identified number, SI.

    std_error : infinite where the runs do not determine the number
    confidence_interval : 95 %, an end infinite where the runs leave it open: on both sides of a
        number that they do not determine, beyond a bound at which the search ended
    determined : "yes" (95 % half-width under 15 % of |value|, of an angle of at least
        ANGLE_MATTERS), "weakly" (under 50 %) or "no" (wider, or at a bound, or when the fit did not
        converge to the runs)
    """

    name: str
    value: float
    unit: str
    std_error: float
    confidence_interval: tuple[float, float]
    start: float
    lower: float
    upper: float
    at_bound: bool
    determined: str

    @property
    def title(self) -> str:
        """What sentences call it."""
        return self.name


@dataclass(frozen=True, slots=True)
class ParameterEstimate(Estimate):
    """A parameter of the car."""

    @property
    def free(self) -> FreeParameter:
        """What was free, with the search's variable."""
        return FreeParameter(self.name, self.start, self.lower, self.upper)


@dataclass(frozen=True, slots=True)
class SensorEstimate(Estimate):
    """A quantity of a sensor that was found with the parameters.

    run : whose own it is, or None where the runs share it
    determined : by the half-width over the value of a gain, over the channel's standard deviation
        in the run for a bias, and over DELAY_MATTERS for a delay
    """

    channel: str
    quantity: str
    run: str | None

    @property
    def title(self) -> str:
        """What sentences call it."""
        return self.name if self.run is None else f"{self.name} of run {self.run}"


@dataclass(frozen=True, slots=True)
class Offer:
    """What of a sensor would mend a channel that is probably wrong.

    sensor : quantities to fix, as an identification takes them
    """

    run: str
    channel: str
    sensor: Mapping[str, float]
    sentence: str


@dataclass(frozen=True, slots=True)
class CombinationEstimate:
    """A quantity that several parameters make together, SI; fields as of `Estimate`.

    of : names of the parameters that were free and act in it
    """

    name: str
    symbol: str
    label: str
    unit: str
    of: tuple[str, ...]
    value: float
    std_error: float
    confidence_interval: tuple[float, float]
    determined: str


@dataclass(frozen=True, slots=True)
class Direction:
    """A way for the parameters to move together, an axis of their covariance.

    half_width : of the 95 % interval of how far they go, in the search's variables, where 1 is
        about 100 %; infinite where the runs do not determine it
    parts : by parameter, the larger components of the unit direction, the largest first
    combination : name of the one that moves along it and hardly otherwise, if there is one
    """

    half_width: float
    parts: Mapping[str, float]
    combination: str | None


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the runs determine.

    parameters : by "yes", "weakly" and "no", their names
    combinations : that the runs determine better than their parameters
    directions : axes of the covariance, the least determined first
    conditions : by what is at a bound, or is the rebound ratio of a damper that is taken for
        linear, the parameters and combinations that are determined and would be elsewhere without
    sentences : the same for a person
    """

    parameters: Mapping[str, tuple[str, ...]]
    combinations: tuple[CombinationEstimate, ...]
    directions: tuple[Direction, ...]
    conditions: Mapping[str, tuple[str, ...]]
    sentences: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PriorCheck:
    """A prior and what the runs say without it, SI.

    without, without_std_error : by the runs and the other priors; None where they do not tell
    apart : the runs' less the prior's, in combined standard errors
    """

    name: str
    mean: float
    deviation: float
    without: float | None
    without_std_error: float | None
    apart: float | None


@dataclass(frozen=True, slots=True)
class Whiteness:
    """How far one channel's residuals are from white noise (`whiteness`).

    statistic : greatest distance of the cumulative periodogram from that of white noise, 0 to 1
    p : probability of such a distance or a greater one, were they white
    rms : of the residuals, in units of the noise; with a loss, of what stands for them in the
        errors (`Residuals.of_runs`)
    effective_samples : independent samples that they are worth, of `samples`
    """

    run: str
    channel: str
    rms: float
    statistic: float
    p: float
    effective_samples: float
    samples: int


@dataclass(frozen=True, slots=True)
class FittedRun:
    """What was compared in one run, SI.

    noise : in force, by channel
    noise_source : by channel, where that is from
    discounted : samples beyond the scale of the loss, by channel; none where it is linear
    braking : (begin, end) where the car was taken to brake, s
    conditioning : what made its channels of those that were recorded
    """

    name: str
    samples: int
    noise: Mapping[str, float]
    noise_source: Mapping[str, NoiseSource]
    discounted: Mapping[str, int]
    braking: tuple[Interval, ...]
    conditioning: tuple[StepRecord, ...] = ()


@dataclass(frozen=True, slots=True)
class Minimum:
    """A minimum of the cost that searches ended in, SI.

    starts : searches that ended here
    cut_short : those of them that were not run to their end, being clearly in this basin
    from_start : whether the search from the start values is among them
    at_bound : names of the parameters at a bound
    outcome : how the lowest of these searches ended
    """

    cost: float
    parameters: Mapping[str, float]
    fit_percent: Mapping[str, Mapping[str, float]]
    starts: int
    cut_short: int
    from_start: bool
    at_bound: tuple[str, ...]
    outcome: Ending


class Stage(StrEnum):
    """What a fit is at."""

    SCREENING = "screening"
    """Every start is simulated once."""
    SEARCHING = "searching"
    """From the told start and the best of the others."""
    REWEIGHING = "reweighing"
    """The minima are refined with the noise that was found from their residuals."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a fit stands after an evaluation: the best found so far.

    cost : half the sum of squared residuals, in units of the noise
    search, searches : which of how many searches of the stage is under way, from 1; 0 before them
    """

    evaluations: int
    simulations: int
    cost: float
    parameters: Mapping[str, float]
    fit_percent: Mapping[str, Mapping[str, float]]
    stage: Stage = Stage.SEARCHING
    search: int = 1
    searches: int = 1


@dataclass(frozen=True, slots=True)
class Fit:
    """An identified car and everything known about how good it is.

    vehicle : with the identified values
    cost : half the sum of squared residuals as the loss counts them, in units of the noise, priors
        among them
    sensors : what was found of the sensors with the parameters
    fixed_sensors : what was known of them, by channel and quantity
    errors : of the search's variables, those of `FreeParameter`, in the parameters' order, whatever
        the sensors are
    fit_percent : by run and channel
    residuals : by run and channel, (samples,) model, as the sensors read it, minus measured, SI
    faults : those of the warnings because of which the outcome is DOUBTFUL
    offers : what would mend channels that are probably wrong
    cost_history : the best cost after each evaluation, as the noise then in force counts it
    starts : points that were tried as starts, the told one among them
    minima : what the searches from the best of them ended in, the fit's own first
    """

    vehicle: Vehicle
    parameters: tuple[ParameterEstimate, ...]
    sensors: tuple[SensorEstimate, ...]
    fixed_sensors: Mapping[str, Mapping[str, float]]
    cost: float
    errors: Uncertainty
    fit_percent: Mapping[str, Mapping[str, float]]
    residuals: Mapping[str, Mapping[str, Array]]
    outcome: Outcome
    converged: bool
    warnings: tuple[str, ...]
    faults: tuple[str, ...]
    offers: tuple[Offer, ...]
    seconds: float
    simulations: int
    evaluations: int
    cost_history: tuple[float, ...]
    traction: str
    settings: RimsSettings
    runs: tuple[FittedRun, ...]
    starts: int
    minima: tuple[Minimum, ...]
    loss: Loss
    priors: tuple[PriorCheck, ...]
    whiteness: tuple[Whiteness, ...]
    verdict: Verdict


def determined(size: float, half_width: float, at_bound: bool = False) -> str:
    """ "yes", "weakly" or "no" of a half-width judged by a size."""
    if at_bound or not half_width < WEAKLY_BELOW * size:
        return "no"
    return "yes" if half_width < DETERMINED_BELOW * size else "weakly"
