"""What can be seen wrong with a recording before any model: gaps, rest values, a_x against v_x.

Every finding is a sentence naming run and channel; none of them stops anything, but a fault in
what drives the model leaves nothing to be learnt from the run.
"""

import math
from collections.abc import Set as AbstractSet
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..channels import (
    INPUT_CHANNELS,
    OUTPUT_CHANNELS,
    WHEEL_CHANNELS,
    channel,
)
from ..filters import low_pass, too_coarse
from ..frames import CORNERS, GRAVITY
from ..run import Run
from ..spikes import spikes
from ..vehicle import Vehicle
from ..wheel_plane import plane_on_wheels
from .wheel_order import exchanged_wheels
from .wheel_unit import wheels_too_small

REST_WINDOW = 0.5
"""The start of a record looked at for rest, s."""

REST_LIMITS = {
    **{f"wheel.{corner}.z": 2e-3 for corner in CORNERS},
    "chassis.z": 2e-3,
    "chassis.pitch": math.radians(0.1),
    "chassis.roll": math.radians(0.1),
    "chassis.a_x": 0.1,
}
"""The rest value that passes, by channel, SI."""

STILL_CHANNELS = (*(f"wheel.{corner}.z" for corner in CORNERS), "chassis.a_x")
"""Channels that tell a standing car from a rolling one by how much they move."""

STILL = 0.1
"""Speed below which a car stands, m/s."""

SLOW = 1.0
"""a_x and v_x are compared below this frequency, Hz."""

SLOW_MOTION, SLOW_SHARE = 1e-3, 0.3
"""Standard deviation below 1 Hz, m and as a share of the whole, from which a wheel moves slowly."""

VARIES = 0.2
"""dv_x/dt must vary by this much, m/s2 rms, to be held against a_x."""

ALIKE = 0.8
"""Correlation of the two below which one of them is noise and nothing is said."""

LEAST_SLOPE, MOST_SLOPE = 0.35, 2.5
"""dv_x/dt over a_x between which both are believed: a body-fixed a_x contains some gravity."""

MISTAKEN_UNITS = (
    (GRAVITY, "chassis.a_x", "g", "m/s^2"),
    (1.0 / GRAVITY, "chassis.a_x", "m/s^2", "g"),
    (3.6, "chassis.v_x", "km/h", "m/s"),
    (1.0 / 3.6, "chassis.v_x", "m/s", "km/h"),
)
"""dv_x/dt over a_x that a mistaken unit makes, whose, the unit of its numbers and its header's."""

UNIT_SPREAD = 1.3
"""Factor around such a ratio that counts."""


Array = NDArray[np.float64]


class Finding(NamedTuple):
    """A sentence, and whether what drives the model is wrong by it."""

    sentence: str
    fault: bool


def check_recording(run: Run) -> list[Finding]:
    """Findings about one run that has the channels of the rims mode."""
    return [
        *(Finding(sentence, False) for sentence in _gaps(run)),
        *(
            Finding(sentence, True)
            for name in INPUT_CHANNELS
            for sentence in spikes(channel(name), run.time, run[name])
        ),
        *_acceleration_against_speed(run),
        *(Finding(sentence, True) for sentence in _one_wheel_turned_over(run)),
        *(Finding(sentence, True) for sentence in wheels_too_small(run)),
    ]


def check_on_car(
    run: Run,
    standing: bool,
    rises: Array | None,
    vehicle: Vehicle,
    unzeroed: AbstractSet[str] = frozenset(),
) -> list[Finding]:
    """Findings about such a run once it is known which car follows it.

    standing : of `stands`; rises : of `wheel_order.wheel_rises`
    unzeroed : channels whose rest values are to be found, so that they may have any
    """
    rest_values = _rest_values(run, vehicle, unzeroed) if standing else []
    exchanged = [] if rises is None else exchanged_wheels(run, rises, vehicle.wheelbase)
    return [
        *(Finding(sentence, False) for sentence in rest_values),
        *(Finding(sentence, True) for sentence in exchanged),
    ]


def _gaps(run: Run) -> list[str]:
    steps = np.diff(run.time)
    widest = int(np.argmax(steps))
    if steps[widest] <= max(0.05, 10.0 * float(np.median(steps))):
        return []
    return [
        f"Run {run.name} has no samples between {run.time[widest]:.2f} and "
        f"{run.time[widest + 1]:.2f} s; the wheels' motion there is a guess, so cut the run."
    ]


def stands(run: Run) -> bool:
    """Whether the car stands at the start of the record, neither a wheel nor a_x moving.

    A speed that is recorded stays near zero.
    """
    start = _start(run)
    rolling = "chassis.v_x" in run and bool(np.any(np.abs(run["chassis.v_x"][start]) > STILL))
    return not rolling and all(
        np.std(run[name][start]) <= REST_LIMITS[name] for name in STILL_CHANNELS
    )


def _start(run: Run) -> NDArray[np.bool_]:
    return run.time - run.time[0] <= REST_WINDOW


def _rest_values(run: Run, vehicle: Vehicle, unzeroed: AbstractSet[str]) -> list[str]:
    """Channels of a standing car that do not read what its wheels put them at, and a_x not zero."""
    start = _start(run)
    on_wheels = _plane(vehicle, [np.mean(run[name][start]) for name in WHEEL_CHANNELS])
    expected = dict(zip(OUTPUT_CHANNELS, on_wheels, strict=True)) | {"chassis.a_x": 0.0}
    if not unzeroed.isdisjoint(WHEEL_CHANNELS):  # which are what the body stands on
        unzeroed = unzeroed | set(OUTPUT_CHANNELS)
    readings = []
    for name, value in expected.items():
        if name in unzeroed:
            continue
        rest = float(np.mean(run[name][start])) if name in run else value
        if abs(rest - value) > REST_LIMITS[name]:
            shown = channel(name)
            read, put = (
                f"{round(shown.display_factor * one, 3) + 0.0:.3g}" for one in (rest, value)
            )
            readings.append(f"{name} reads {read} instead of {put} {shown.display_unit}")
    if not readings:
        return []
    return [
        f"Run {run.name} starts at rest on its wheels, yet there {', '.join(readings)}; the model "
        "counts from rest, so subtract the rest values of the body and of the wheels."
    ]


def _plane(vehicle: Vehicle, heights: list[np.floating]) -> list[float]:
    """z, pitch and roll of a vehicle's body on four wheel centres' heights, m."""
    front, rear = vehicle.front, vehicle.rear
    x = np.array([front.cg_distance] * 2 + [-rear.cg_distance] * 2)
    y = np.array([side * 0.5 * axle.track for axle in (front, rear) for side in (1.0, -1.0)])
    return plane_on_wheels(x, y, np.array(heights, dtype=np.float64)).tolist()


def _acceleration_against_speed(run: Run) -> list[Finding]:
    """Fits dv_x/dt = c + s a_x, both below 1 Hz; s is 1 when sign and unit are right.

    Only the sense of rolling resistance depends on v_x, so that a wrong v_x is no fault, nor is a
    difference of which nobody knows whose it is.
    """
    if "chassis.v_x" not in run or too_coarse(float(np.mean(np.diff(run.time))), SLOW):
        return []
    slow = low_pass(run.time, np.column_stack([run["chassis.v_x"], run["chassis.a_x"]]), SLOW)
    gained, a_x = np.gradient(slow[:, 0], run.time), slow[:, 1]
    if np.std(gained) < VARIES or np.std(a_x) == 0.0:
        return []
    alike = float(np.corrcoef(gained, a_x)[0, 1])
    if abs(alike) < ALIKE:
        return []
    slope = alike * float(np.std(gained) / np.std(a_x))
    if slope < -LEAST_SLOPE:
        return [_opposed(run, float(np.mean(slow[:, 0])))]
    if LEAST_SLOPE < slope < MOST_SLOPE:
        return []
    changes = f"In run {run.name} chassis.v_x changes {slope:.3g} times as fast as chassis.a_x says"
    for factor, name, numbers, header in MISTAKEN_UNITS:
        if 1.0 / UNIT_SPREAD < slope / factor < UNIT_SPREAD:
            doubt = f"the numbers of {name} are probably in {numbers} under a header that says"
            return [
                Finding(f"{changes}; {doubt} {header}: correct the header.", name == "chassis.a_x")
            ]
    return [Finding(f"{changes}; check the units of both.", False)]


def _opposed(run: Run, mean_speed: float) -> Finding:
    """a_x against the change of v_x: a car driving forwards has its v_x right."""
    against = f"In run {run.name} chassis.a_x runs against the change of chassis.v_x"
    if mean_speed < 0.0:
        return Finding(
            f"{against}, which says that the car drives backwards; if it does not, "
            "multiply chassis.v_x by -1.",
            False,
        )
    return Finding(f"{against}; its sign is probably wrong: multiply chassis.a_x by -1.", True)


def _one_wheel_turned_over(run: Run) -> list[str]:
    """An axle whose wheels go against each other while those of the other go together.

    Below 1 Hz a road that has anything there lifts left and right alike; a rig that rolls or warps
    the car turns both axles.
    """
    wheels = [f"wheel.{corner}.z" for corner in CORNERS]
    if too_coarse(float(np.mean(np.diff(run.time))), SLOW):
        return []
    heights = np.column_stack([run[name] for name in wheels])
    slow = low_pass(run.time, heights, SLOW)
    slow = slow - slow.mean(axis=0)
    if np.any(np.std(slow, axis=0) < np.maximum(SLOW_MOTION, SLOW_SHARE * np.std(heights, axis=0))):
        return []
    size = np.linalg.norm(slow, axis=0)
    together = [
        float(slow[:, left] @ slow[:, left + 1]) / (size[left] * size[left + 1]) for left in (0, 2)
    ]
    axle = int(np.argmin(together))
    if together[axle] > -0.5 or together[1 - axle] < 0.5:
        return []
    first, second = wheels[2 * axle : 2 * axle + 2]
    return [
        f"In run {run.name} {first} and {second} run against each other while the other axle's "
        "wheels go together; one of them has the wrong sign: multiply it by -1."
    ]
