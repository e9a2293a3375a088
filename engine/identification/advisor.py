"""Which manoeuvre to drive next: what each would do to the errors of the parameters.

What is known so far is the `Information` of the runs (none, for a car that is only known from a
vehicle file). A candidate is driven by the car as it stands (`candidates`), recorded, and given to
the rims mode as a run would be (`new_run`). What it would add are its Jacobian J at the current
values and the scatter M of the residuals it would leave (`expected_noise`):

    R^T R = sum J^T J,    M = sum M_run,    C = B M B,    B = (R^T R)^-1

so that the errors afterwards are those of a fit to all runs, as far as the current values are near
the true ones. What is found of the sensors counts as unknown throughout. Candidates are ranked by
whether they keep the tyres on the road, by how many classes ("no", "weakly", "yes") the parameters
rise together, then by the information gained,

    gain = 1/2 log2 (det(C_before + f^2) / det(C_after + f^2)) bits,

which is D-optimality between two ends: C is cut to what the bounds admit, so that a direction that
the runs leave open counts as much as that, and f = CLOSE, so that what is known to 1 % gains
nothing. `worst` is E-optimality: the largest error of any direction of the search's variables,
infinite as long as there is one that nothing moves.
"""

import math
import time
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ProblemError
from ..manoeuvre import Manoeuvre
from ..parameters import ALL_NAMES, PARAMETER_NAMES, default_bounds, parameter
from ..run_notes import DEFAULT_NOISE
from ..simulation.integration import cores
from ..simulation.rims_settings import RimsSettings
from ..simulation.simulate import SAMPLE_STEP, rims_batch
from ..units import in_percent
from ..vehicle import Vehicle
from .candidates import Drive, catalogue, drives
from .cars import mixed_plants
from .expected_noise import INPUT_NOISE, ExpectedNoise, noise_of_runs, stated_noise
from .fit import Outcome, determined
from .fit_findings import fault_sentences, faults_of_channels
from .new_run import of_all_runs, said_by
from .problem import FreeParameter, Problem
from .residuals import FAILED_TRIAL, Residuals
from .uncertainty import Information, Uncertainty, information, uncertainty
from .variables import Variable

Array = NDArray[np.float64]

TOGETHER = 3
"""Manoeuvres that are chosen to be driven together."""

TOLD = 3
"""Parameters that a sentence names."""

BETTER = 0.8
"""Error afterwards over error before from which on an improvement is worth a word."""

UNKNOWN = 10.0
"""Error over value from which on a parameter is called unknown."""

CLOSE = 0.01
"""Error of a variable, about 1 % of a parameter, below which no more is gained."""

OPEN = 1e3
"""Error of a variable along a direction that no run moves: far beyond any bounds."""

CLASSES = ("no", "weakly", "yes")


@dataclass(frozen=True, slots=True)
class Knowledge:
    """How well one parameter is known, SI.

    std_error : infinite where nothing is known
    confidence_interval : 95 %, as of a fit away from its bounds
    determined : "yes", "weakly" or "no"
    """

    name: str
    value: float
    std_error: float
    confidence_interval: tuple[float, float]
    determined: str

    @property
    def relative(self) -> float:
        """Standard error over |value|."""
        return self.std_error / abs(self.value) if self.value else math.inf


@dataclass(frozen=True, slots=True)
class Advice:
    """What one more run would do.

    after : the parameters, once it is fitted with the runs so far
    promoted : classes that the parameters rise together;  gain : bits
    worst : largest error of any direction of the search's variables afterwards
    sentence : the gain in words;  remark : what was assumed, or empty
    """

    key: str
    manoeuvre: Manoeuvre
    after: tuple[Knowledge, ...]
    promoted: int
    gain: float
    worst: float
    sentence: str
    remark: str


@dataclass(frozen=True, slots=True)
class Advisory:
    """Candidates by rank.

    now : the parameters as the runs so far leave them;  worst : as of `Advice`
    ranked : each candidate alone, the best first
    together : the best one, what is best after it, and so on; each with what all up to it give
    excluded : by key, why a candidate gives no run
    warnings : sentences about what is doubtful in the runs so far
    """

    now: tuple[Knowledge, ...]
    worst: float
    ranked: tuple[Advice, ...]
    together: tuple[Advice, ...]
    excluded: Mapping[str, str]
    seconds: float
    warnings: tuple[str, ...] = ()


def advise(
    problem: Problem,
    candidates: Mapping[str, Manoeuvre] | None = None,
    *,
    planned: Collection[str] = (),
) -> Advisory:
    """Advice after some runs, whose problem starts at the fitted values.

    candidates : by key; those of `catalogue` without
    planned : keys of candidates that will be driven in any case, so that they count as known
    Raises what `Residuals` does, and ProblemError where the car does not come through the runs or
    one of them is probably wrong.
    """
    began = time.perf_counter()
    residuals = Residuals(problem, rims_batch)
    x = _variables(problem.variables)
    r = residuals.vector(x)
    if np.any(r == FAILED_TRIAL):
        raise ProblemError(
            "The car does not come through the runs at these values; fit it to the runs first."
        )
    if faults := fault_sentences(
        problem.runs, faults_of_channels(problem.runs, residuals.model(x))
    ):
        raise ProblemError(" ".join(faults))
    runs = residuals.of_runs(r, residuals.jacobian(x))
    said = information(runs)
    noise = noise_of_runs(problem, runs, said.root)
    known = sum(residuals.of_priors(), start=said).marginal(of_all_runs(problem.variables))
    found = _advised(problem, known, noise, candidates or catalogue(), planned, began)
    mixed = mixed_plants({seen.name: seen.plant for seen in problem.runs})
    return replace(found, warnings=tuple(mixed))


def require_sound(fit: Mapping[str, Any]) -> None:
    """Raise ProblemError for a fit, given as JSON, to runs that are probably wrong: it has bent the
    car until the two look alike.
    """
    if fit.get("outcome") == Outcome.DOUBTFUL:
        # Fits of earlier versions do not list their faults.
        raise ProblemError(" ".join(fit.get("faults", ())) or Outcome.DOUBTFUL)


def advise_unmeasured(
    vehicle: Vehicle,
    candidates: Mapping[str, Manoeuvre] | None = None,
    *,
    planned: Collection[str] = (),
    free: Sequence[str] = PARAMETER_NAMES,
    noise: Mapping[str, float] | None = None,
    settings: RimsSettings | None = None,
) -> Advisory:
    """Advice for a car of which there is no run; arguments as of `advise`.

    free : names or symbols of the parameters to find, in any order
    noise : standard deviation by channel, over DEFAULT_NOISE and INPUT_NOISE, SI
    """
    began = time.perf_counter()
    settings, noise = settings or RimsSettings(), {**INPUT_NOISE, **DEFAULT_NOISE, **(noise or {})}
    named = {parameter(name).name for name in free}
    parameters = tuple(
        FreeParameter(name, start, *default_bounds(name, start))
        for name in ALL_NAMES
        if name in named
        for start in [vehicle.value(name)]
    )
    problem = Problem(vehicle, (), parameters, "exact", settings)
    nothing = np.zeros((len(parameters), len(parameters)))
    known = Information(nothing, (), 0.0, ())
    expected = stated_noise(vehicle, settings, noise, step=SAMPLE_STEP)
    return _advised(problem, known, expected, candidates or catalogue(), planned, began)


@dataclass(frozen=True, slots=True)
class _State:
    """What some runs tell: their information, and what follows from it."""

    information: Information
    parameters: tuple[Knowledge, ...]
    bits: float
    worst: float

    @classmethod
    def of(cls, known: Information, free: Sequence[FreeParameter]) -> "_State":
        errors = uncertainty(known.marginal(range(len(free))))
        return cls(known, _knowledge(free, errors), _bits(free, errors), _worst(errors))


def _advised(
    problem: Problem,
    known: Information,
    noise: ExpectedNoise,
    candidates: Mapping[str, Manoeuvre],
    planned: Collection[str],
    began: float,
) -> Advisory:
    if strangers := [key for key in planned if key not in candidates]:
        raise ProblemError(
            f"{strangers[0]} is planned, but the candidates are {', '.join(candidates)}; choose "
            "one of them."
        )
    driven = drives(problem.vehicle, candidates, sample_step=noise.step)
    added, excluded = _added(problem, driven, noise)
    for key in planned:
        if key in excluded:
            raise ProblemError(f"{key} is planned, but gives no run. {excluded[key]}")
        known = known + added[key]
    now = _State.of(known, problem.free)
    open_ones = [one for one in driven if one.key in added and one.key not in planned]
    together, before = [], now
    ranked = _ranked(open_ones, added, now, now, problem.free)
    left = ranked
    while left and len(together) < TOGETHER:
        together.append(left[0])
        before = _State.of(before.information + added[left[0].key], problem.free)
        open_ones = [one for one in open_ones if one.key != left[0].key]
        left = _ranked(open_ones, added, before, now, problem.free)
    return Advisory(
        now.parameters,
        now.worst,
        tuple(ranked),
        tuple(together),
        excluded,
        time.perf_counter() - began,
    )


def _added(
    problem: Problem, driven: Sequence[Drive], noise: ExpectedNoise
) -> tuple[dict[str, Information], dict[str, str]]:
    """What each candidate's run would add, and why some give none, by key."""
    with ThreadPoolExecutor(cores()) as pool:
        said = pool.map(lambda one: said_by(problem, one, noise), driven)
        found = dict(zip((one.key for one in driven), said, strict=True))
    added = {key: one for key, one in found.items() if isinstance(one, Information)}
    return added, {key: one for key, one in found.items() if isinstance(one, str)}


def _ranked(
    driven: Sequence[Drive],
    added: Mapping[str, Information],
    before: _State,
    now: _State,
    free: Sequence[FreeParameter],
) -> list[Advice]:
    """The best first: by classes, then by bits, gained over `before`; both are told over `now`.

    Those that lift a tyre come last: no car would record what the model does there.
    """
    scored = []
    for one in driven:
        after = _State.of(before.information + added[one.key], free)
        promoted = _promoted(now.parameters, after.parameters)
        advice = Advice(
            one.key,
            one.manoeuvre,
            after.parameters,
            promoted,
            after.bits - now.bits,
            after.worst,
            _sentence(one.manoeuvre.name, before.parameters, after.parameters),
            one.remark,
        )
        scored.append(((not one.lifts, promoted, after.bits), advice))
    scored.sort(key=lambda row: row[0], reverse=True)
    return [advice for _, advice in scored]


def _variables(free: Sequence[Variable]) -> Array:
    return np.array([one.variable(one.start) for one in free])


def _knowledge(free: Sequence[FreeParameter], errors: Uncertainty) -> tuple[Knowledge, ...]:
    """A parameter at its bound stays undetermined: how the runs move it there is not known."""
    found = []
    for one, deviation in zip(free, errors.std_error.tolist(), strict=True):
        variable, value = one.variable(one.start), one.start
        half_width = errors.quantile * deviation
        interval = one.interval(variable, half_width, half_width)
        found.append(
            Knowledge(
                one.name,
                value,
                abs(one.slope(variable)) * deviation,
                interval,
                determined(one.size(value), 0.5 * (interval[1] - interval[0]), one.at_bound(value)),
            )
        )
    return tuple(found)


def _bits(free: Sequence[FreeParameter], errors: Uncertainty) -> float:
    """-1/2 log2 det of the covariance between what the bounds admit and what is close enough."""
    spans = [high - low for low, high in (one.ends for one in free)]
    admitted = np.diag(np.square(spans) / 12.0)
    covariance = errors.covariance + OPEN**2 * errors.unknown.T @ errors.unknown
    # (C^-1 + W^-1)^-1 without inverting C
    within = admitted @ np.linalg.solve(covariance + admitted, covariance)
    return float(-0.5 * np.linalg.slogdet(within + CLOSE**2 * np.eye(len(free)))[1] / math.log(2.0))


def _worst(errors: Uncertainty) -> float:
    if len(errors.unknown):
        return math.inf
    return float(np.sqrt(np.linalg.eigvalsh(errors.covariance)[-1]))


def _promoted(before: Sequence[Knowledge], after: Sequence[Knowledge]) -> int:
    """Classes that the parameters rise together."""
    return sum(_rise(one, other) for one, other in zip(before, after, strict=True))


def _rise(before: Knowledge, after: Knowledge) -> int:
    return CLASSES.index(after.determined) - CLASSES.index(before.determined)


def _sentence(name: str, before: Sequence[Knowledge], after: Sequence[Knowledge]) -> str:
    """The parameters that gain most by a manoeuvre."""
    pairs = list(zip(before, after, strict=True))
    told = [pair for pair in pairs if pair[1].std_error < BETTER * pair[0].std_error]
    told.sort(key=lambda pair: (-_rise(*pair), _ratio(*pair), pair[1].relative))
    if not told:
        return f"{name}: no parameter's error falls by a fifth."
    gains = (
        f"{parameter(one.name).symbol} from {_percent(one)} to {_percent(other)}"
        for one, other in told[:TOLD]
    )
    return f"{name}: {', '.join(gains)}."


def _ratio(before: Knowledge, after: Knowledge) -> float:
    return after.std_error / before.std_error if math.isfinite(before.std_error) else 0.0


def _percent(one: Knowledge) -> str:
    """Standard error over value."""
    return in_percent(one.relative) if one.relative < UNKNOWN else "unknown"
