"""What the runs of a fit determine: parameters, and combinations where the parameters are not.

A fit may follow its runs perfectly with wrong parameters, since directions in which the parameters
move together leave the model as it is. The errors of any quantity q(x) of the car follow from the
covariance C of the search's variables x,

    s_q^2 = g^T C g,    g = dq/dx,

and are infinite where g has a part in a direction that the runs do not determine. A combination is
told where the runs hold it better than they hold the parameters it is made of: its error is below
PART_OF_APART of what these errors would give were they independent, sqrt(sum (g_k s_k)^2).
"""

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..parameters import ALL_NAMES, DAMPER_NAMES, parameter
from ..units import after_number, in_percent, listed
from ..vehicle import Vehicle
from .combinations import COMBINATIONS, Combination
from .fit import CombinationEstimate, Direction, ParameterEstimate, Verdict, determined
from .uncertainty import NAMED, Uncertainty
from .variables import moved

Array = NDArray[np.float64]

PART_OF_APART = 1.0 / 3.0
"""Two parameters of the same error must be correlated by 0.89 for their ratio to be so good."""

STEP = 1e-4
"""Of the central differences that make g; their error is of order STEP^2."""

ALONG = 0.95
"""Cosine of the angle between an axis and the gradient of a combination that it stands for."""

ORDER = ("yes", "weakly", "no")


def verdict(
    estimates: Sequence[ParameterEstimate],
    errors: Uncertainty,
    vehicle: Vehicle,
    released: Mapping[str, Array] | None = None,
) -> Verdict:
    """The verdict on a fit that converged.

    errors : of the search's variables;  vehicle : at the solution
    released : by the title of what is at a bound, how far the variables (n,) would go were it
        further away (`Found.released`), and by that of a rebound ratio of 1 were it free
        (`freed_ratios`)
    """
    classes = by_class(estimates)
    names = [one.name for one in estimates]
    gradients = {
        one.name: _gradient(one, estimates, vehicle)
        for one in COMBINATIONS
        if one.acts(vehicle) and sum(name in names for name in one.of) > 1
    }
    combined = [
        estimate
        for one in COMBINATIONS
        if one.name in gradients
        and (estimate := _held_together(one, gradients[one.name], estimates, errors, vehicle))
    ]
    conditions = _conditions(estimates, combined, gradients, errors, released or {})
    linear = [name for name in conditions if name in DAMPER_NAMES and name not in names]
    return Verdict(
        parameters=classes,
        combinations=tuple(combined),
        directions=tuple(_directions(names, errors, gradients)),
        conditions=conditions,
        sentences=(
            *_of_parameters(classes, conditions, linear),
            *(
                _of_combination(one, classes["yes"], conditions, linear)
                for one in _news(combined, gradients, estimates)
            ),
        ),
    )


def without_verdict(estimates: Sequence[ParameterEstimate]) -> Verdict:
    """That on a fit whose errors mean nothing."""
    return Verdict(by_class(estimates), (), (), {}, ())


def by_class(estimates: Sequence[ParameterEstimate]) -> dict[str, tuple[str, ...]]:
    """The parameters' names by how well they are determined."""
    return {word: tuple(one.name for one in estimates if one.determined == word) for word in ORDER}


def _gradient(one: Combination, estimates: Sequence[ParameterEstimate], vehicle: Vehicle) -> Array:
    """dq/dx, (n,); d ln q/dx of a quantity that is never negative, 0 where it is 0."""
    if not one.signed and one.value(vehicle) <= 0.0:
        return np.zeros(len(estimates))
    gradient = np.zeros(len(estimates))
    for k, of in enumerate(estimates):
        if of.name in one.of:
            ends = [_moved(one, of, vehicle, way * STEP) for way in (1.0, -1.0)]
            gradient[k] = (ends[0] - ends[1]) / (2.0 * STEP)
    return gradient


def _moved(one: Combination, of: ParameterEstimate, vehicle: Vehicle, change: float) -> float:
    """q, or its logarithm, with a parameter's variable changed by so much, bounds aside."""
    value = of.free.moved(of.value, change)
    found = one.value(vehicle.varied({of.name: np.array(value)}))
    return float(found if one.signed else np.log(found))


def _held_together(
    one: Combination,
    gradient: Array,
    estimates: Sequence[ParameterEstimate],
    errors: Uncertainty,
    vehicle: Vehicle,
) -> CombinationEstimate | None:
    """The combination, if the runs hold it better than what it is made of."""
    # A parameter may have no part in it here, as the arm of a bar without a rate.
    members = [k for k, slope in enumerate(gradient.tolist()) if slope]
    if not members:
        return None
    of = tuple(estimates[k].name for k in members)
    estimate = _estimate(one, of, gradient, errors, vehicle)
    apart = float(np.linalg.norm(gradient[members] * errors.std_error[members]))
    worst = max(ORDER.index(estimates[k].determined) for k in members)
    better = ORDER.index(estimate.determined) < worst
    return estimate if better and errors.error_of(gradient) < PART_OF_APART * apart else None


def _news(
    combined: Sequence[CombinationEstimate],
    gradients: Mapping[str, Array],
    estimates: Sequence[ParameterEstimate],
) -> list[CombinationEstimate]:
    """Those that do not follow from one before them and the parameters that are determined."""
    unknown = np.array([one.determined != "yes" for one in estimates])
    found: list[CombinationEstimate] = []
    ways: list[Array] = []
    for one in combined:
        way = gradients[one.name] * unknown
        way = way / np.linalg.norm(way)
        if not any(abs(float(way @ before)) > ALONG for before in ways):
            found.append(one)
            ways.append(way)
    return found


def _estimate(
    one: Combination, of: tuple[str, ...], gradient: Array, errors: Uncertainty, vehicle: Vehicle
) -> CombinationEstimate:
    value, error = one.value(vehicle), errors.error_of(gradient)
    half_width = errors.quantile * error
    low, high = (
        moved(value, change, logarithmic=not one.signed) for change in (-half_width, half_width)
    )
    return CombinationEstimate(
        name=one.name,
        symbol=one.symbol,
        label=one.label,
        unit=one.unit,
        of=of,
        value=value,
        std_error=error if one.signed else error * value,
        confidence_interval=(low, high),
        determined=determined(max(abs(value), one.matters), 0.5 * (high - low)),
    )


def _directions(
    names: Sequence[str], errors: Uncertainty, gradients: Mapping[str, Array]
) -> list[Direction]:
    """Unknown directions, then the covariance's axes by their length."""
    squares, axes = np.linalg.eigh(errors.covariance)
    lengths = errors.quantile * np.sqrt(np.maximum(squares, 0.0))
    known = range(len(squares) - 1, len(errors.unknown) - 1, -1)
    found = [(math.inf, row) for row in errors.unknown]
    found += [(float(lengths[k]), axes[:, k]) for k in known]
    return [
        Direction(length, _parts(names, axis), _along(axis, gradients)) for length, axis in found
    ]


def _parts(names: Sequence[str], axis: Array) -> dict[str, float]:
    """The loud components, the loudest first and positive."""
    order: list[int] = np.argsort(-np.abs(axis)).tolist()
    sign = float(np.sign(axis[order[0]]))
    return {names[k]: sign * float(axis[k]) for k in order if abs(float(axis[k])) >= NAMED}


def _along(axis: Array, gradients: Mapping[str, Array]) -> str | None:
    """Name of the combination whose gradient lies along an axis."""
    along = {
        name: abs(float(axis @ gradient)) / float(np.linalg.norm(gradient))
        for name, gradient in gradients.items()
        if np.any(gradient)
    }
    best = max(along, key=lambda name: along[name], default=None)
    return best if best is not None and along[best] > ALONG else None


def _conditions(
    estimates: Sequence[ParameterEstimate],
    combined: Sequence[CombinationEstimate],
    gradients: Mapping[str, Array],
    errors: Uncertainty,
    released: Mapping[str, Array],
) -> dict[str, tuple[str, ...]]:
    """What holds others, that are determined, to where they are by its bound or by being 1, and
    which.

    One that drifts along what the runs leave open leaves the rest where it is.
    """
    axes = np.eye(len(estimates))
    known = {one.name: axes[k] for k, one in enumerate(estimates) if one.determined != "no"}
    known |= {one.name: gradients[one.name] for one in combined if one.determined != "no"}
    moved_by = {
        name: tuple(
            of
            for of, g in known.items()
            if abs(float(g @ step)) > errors.quantile * errors.error_of(g)
        )
        for name, step in released.items()
    }
    return {name: moved for name, moved in moved_by.items() if moved}


def _condition(
    of: Sequence[str], conditions: Mapping[str, Sequence[str]], linear: Collection[str]
) -> str:
    """On what some of what is determined hangs: "if ... is where its bound puts it".

    linear : those of the conditions that are no bounds but dampers' being linear
    """
    holding = [name for name, moved in conditions.items() if {*moved} & {*of}]
    bounds = [_short(name) for name in holding if name not in linear]
    where = "is where its bound puts it" if len(bounds) == 1 else "are where their bounds put them"
    parts = [f"{listed(bounds)} {where}"] if bounds else []
    if len(bounds) < len(holding):
        parts.append("the dampers are linear")
    return f"if {' and '.join(parts)}"


def _short(name: str) -> str:
    """A parameter's symbol; what is found of a sensor keeps its name."""
    return parameter(name).symbol if name in ALL_NAMES else name


def _of_parameters(
    classes: Mapping[str, Sequence[str]],
    conditions: Mapping[str, Sequence[str]],
    linear: Collection[str],
) -> list[str]:
    wording = {
        "yes": "Determined to better than 15 %",
        "weakly": "Determined weakly, to between 15 and 50 %",
        "no": "Not determined by these runs",
    }
    held = {name for moved in conditions.values() for name in moved}
    sentences = []
    for word, said in wording.items():
        free = [_short(name) for name in classes[word] if name not in held]
        bound = [name for name in classes[word] if name in held]
        parts = [f"{said}: {', '.join(free)}"] if free else []
        if bound:
            head = "" if free else f"{said}, "
            symbols = ", ".join(map(_short, bound))
            parts.append(f"{head}{_condition(bound, conditions, linear)}: {symbols}")
        if parts:
            sentences.append(f"{'; '.join(parts)}.")
    return sentences


def _of_combination(
    one: CombinationEstimate,
    known: Sequence[str],
    conditions: Mapping[str, Sequence[str]],
    linear: Collection[str],
) -> str:
    apart = [parameter(name).symbol for name in one.of if name not in known]
    low, high = one.confidence_interval
    half_width, unit = 0.5 * (high - low), after_number(one.unit)
    if low < 0.0 < high:
        told = f"{one.value:.4g} ± {half_width:.2g}{unit}"
    else:
        told = f"{one.value:.4g}{unit} to {in_percent(half_width / abs(one.value))}"
    are = "are determined only together" if len(apart) > 1 else "is determined better"
    if any(one.name in moved for moved in conditions.values()):
        told += f", {_condition([one.name], conditions, linear)}"
    label = f"{one.label[0].lower()}{one.label[1:]}"
    return f"{listed(apart)} {are}, as {one.symbol}, the {label}: {told}."
