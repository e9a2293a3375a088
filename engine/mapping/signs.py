"""Which channels of a run are probably turned over, found from the run alone.

Below SLOW a car follows the road: its height, pitch and roll go with those of the plane through its
wheel centres, the wheels of one axle and of one side go together, a_x goes with the change of
speed, and what of the pitch is not the road's goes against a_x (it squats when it accelerates and
dives when it brakes). Each of these is a correlation that is positive when all signs are right. Of
all ways to turn channels over the one is taken that has the greatest sum of them, less a little for
every channel it turns; it is offered, never done.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..channels import OUTPUT_CHANNELS, WHEEL_CHANNELS
from ..filters import low_pass, too_coarse
from ..run import Run

Array = NDArray[np.float64]
Pair = tuple[str, str]

SLOW = 1.0
"""Hz"""

MOVES = {
    **dict.fromkeys((*WHEEL_CHANNELS, "chassis.z"), 5e-4),
    "chassis.pitch": 2e-4,
    "chassis.roll": 2e-4,
    "chassis.a_x": 0.2,
}
"""Standard deviation below SLOW from which a channel tells its sign, SI."""

GAINS = 0.2
"""The same of the change of speed, m/s2."""

TELLS = 0.5
"""Correlation from which, either way, two motions are taken to belong together."""

EACH_FLIP = 0.15
"""What turning a channel over must gain in correlation."""

PER_PERIOD = 20
"""Samples in a period at SLOW that are looked at, which is enough for what lies below."""

LONGEST_SHARE = 0.25
"""Share of a record's length that one period at SLOW may have."""

ON_A_RIG = 0.999
"""Correlation of all wheels, either way, beyond which it is no road that moves them."""

TOGETHER = {
    "chassis.z": "the mean height of the wheels",
    "chassis.pitch": "the pitch of the wheels' plane",
    "chassis.roll": "the roll of the wheels' plane",
    "chassis.a_x": "the change of chassis.v_x",
}
"""What each channel is held against."""


@dataclass(frozen=True, slots=True)
class SignSuggestion:
    """A channel that is probably turned over.

    correlation : of the channel as it is with what it should go with
    """

    channel: str
    correlation: float
    sentence: str
    flip: bool = True


def check_signs(run: Run, sure: Collection[str] = ()) -> tuple[SignSuggestion, ...]:
    """Channels that are probably turned over; nothing where the run does not tell.

    sure : channels whose signs somebody has confirmed, of which nothing is said
    """
    slow = _slow_motion(run)
    wheels = [name for name in WHEEL_CHANNELS if name in slow]
    if len(wheels) < len(WHEEL_CHANNELS):
        wheels = []
    names = [*wheels, *(name for name in (*OUTPUT_CHANNELS, "chassis.a_x") if name in slow)]
    if len(names) < 2 and "speed" not in slow:
        return ()
    pairs = _wheel_pairs(slow) if wheels else ()
    free = [name for name in names if pairs or name not in wheels]
    best, value = {}, -np.inf
    for signs in product((1, -1), repeat=len(free)):
        turned = {**dict.fromkeys(names, 1), **dict(zip(free, signs, strict=True))}
        sum_of_all = sum(one for _, one in _agreements(slow, turned, pairs))
        sum_of_all -= EACH_FLIP * signs.count(-1)
        if sum_of_all > value:
            best, value = turned, sum_of_all
    return tuple(
        _suggestion(name, slow, best, pairs)
        for name in names
        if best[name] < 0 and name in slow and name not in sure
    )


def _suggestion(
    name: str, slow: Mapping[str, Array], best: Mapping[str, int], pairs: Sequence[Pair]
) -> SignSuggestion:
    """The sentence about a channel, with its correlation as it is, all others being right."""
    as_it_is = {**best, name: 1}
    held = [one for names, one in _agreements(slow, as_it_is, pairs) if name in names]
    correlation = min(held, default=0.0)
    against = TOGETHER.get(name, "the other wheels and the body")
    if name == "chassis.a_x" and "speed" not in slow:
        against = "the dive and squat of chassis.pitch"
    return SignSuggestion(
        name,
        round(correlation, 3),
        f"{name} runs against {against} below {SLOW:g} Hz (correlation {correlation:.2f}); turn"
        " its sign over, unless the other one is wrong.",
    )


def _slow_motion(run: Run) -> dict[str, Array]:
    """What moves enough below SLOW, about its mean; `speed` is the change of speed."""
    step = float(run.time[-1] - run.time[0]) / (len(run.time) - 1)
    if too_coarse(step, SLOW) or run.duration * LONGEST_SHARE < 1.0 / SLOW:
        return {}
    names = [name for name in (*MOVES, "chassis.v_x") if name in run]
    if not names:
        return {}
    slow = low_pass(run.time, np.column_stack([run[name] for name in names]), SLOW)
    thin = slice(None, None, max(1, int(1.0 / (PER_PERIOD * SLOW * step))))
    time, slow = run.time[thin], slow[thin]
    found = {name: slow[:, k] - slow[:, k].mean() for k, name in enumerate(names)}
    speed = found.pop("chassis.v_x", None)
    moving = {name: values for name, values in found.items() if np.std(values) >= MOVES[name]}
    if speed is not None:
        gained = np.gradient(speed, time)
        # A car that drives backwards has v_x below zero and its change the right way round.
        if np.std(gained) >= GAINS:
            moving["speed"] = gained - gained.mean()
    return moving


def _wheel_pairs(slow: Mapping[str, Array]) -> tuple[Pair, ...]:
    """Wheels that go together on a road: those of an axle and those of a side; none on a rig, which
    moves all four alike or in turns.
    """
    fl, fr, rl, rr = WHEEL_CHANNELS
    pairs = ((fl, fr), (rl, rr)), ((fl, rl), (fr, rr))
    alike = [_told(slow[one], slow[other]) for both in pairs for one, other in both]
    if min(map(abs, alike)) > ON_A_RIG:
        return ()
    turned = (max(alike[:2]) < 0.0, max(alike[2:]) < 0.0)
    return tuple(
        pair for both, skip in zip(pairs, turned, strict=True) if not skip for pair in both
    )


def _agreements(
    slow: Mapping[str, Array], signs: Mapping[str, int], pairs: Sequence[Pair]
) -> Iterator[tuple[tuple[str, ...], float]]:
    """Correlations that are positive where the signs are right, and whose they are."""
    turned = {name: sign * slow[name] for name, sign in signs.items()}
    if all(name in turned for name in WHEEL_CHANNELS):
        fl, fr, rl, rr = (turned[name] for name in WHEEL_CHANNELS)
        for one, other in pairs:
            yield (one, other), _told(turned[one], turned[other])
        planes = (fl + fr + rl + rr, rl + rr - fl - fr, fl + rl - fr - rr)
        for name, plane in zip(OUTPUT_CHANNELS, planes, strict=True):
            if name in turned:
                yield (name, *WHEEL_CHANNELS), _told(turned[name], plane)
        road = [planes[1]]
    else:
        road = []
    if "chassis.a_x" in turned and "speed" in slow:
        yield ("chassis.a_x",), _told(turned["chassis.a_x"], slow["speed"])
    if "chassis.a_x" in turned and "chassis.pitch" in turned:
        squat, a_x = (_without(turned[name], road) for name in ("chassis.pitch", "chassis.a_x"))
        if np.std(squat) >= MOVES["chassis.pitch"]:
            yield ("chassis.a_x", "chassis.pitch"), -_told(squat, a_x)


def _without(values: Array, others: Sequence[Array]) -> Array:
    """What of a motion (samples,) is no multiple of others."""
    for one in others:
        size = float(one @ one)
        values = values - (float(one @ values) / size if size else 0.0) * one
    return values


def _told(one: Array, other: Array) -> float:
    """The correlation of two motions about zero, 0 where it is too weak to tell anything."""
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    found = float(one @ other) / size if size else 0.0
    return found if abs(found) >= TELLS else 0.0
