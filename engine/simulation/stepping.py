"""The integrator's steps and what acts on the car during each of them.

A step never straddles a sample, a knot of a torque or a jump: boundaries are laid at all of them
and each interval between two is divided evenly. Inputs are evaluated at the beginning, middle and
end of every step, at its ends from inside the step.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ..demand import Demand
from ..errors import SimulationError
from ..remembered import Remembered
from ..roads.road import Road
from .step_limits import LONGEST_SAMPLE_STEP, LONGEST_STEP, SHORTEST_STEP

MOST_MEMORY = 1e9
"""Refused above: bytes of everything that is kept of one car's steps and samples."""

STEP_BYTES, SAMPLE_BYTES = 800, 2500
"""Memory of one step (what acts at its three stages) and of one sample (states, outputs and
channels of both kinds of model)."""

_SAME_INSTANT = 1e-9


@dataclass(frozen=True, eq=False)
class FreeInputs:
    """What drives the free car (road and posts modes), ready for the kernels.

    time (S,) : sample times, s
    steps (n,) : step lengths, s
    samples (n + 1,) : index of the sample before step k, or -1
    stage_inputs (n, 3, 16) : post heights, post rates, drive and brake torques of four corners
    sample_inputs (S, 16) : the same at the samples
    road : both profiles
    initial_speed : m/s
    """

    time: NDArray[np.float64]
    steps: NDArray[np.float64]
    samples: NDArray[np.int64]
    stage_inputs: NDArray[np.float64]
    sample_inputs: NDArray[np.float64]
    road: Road
    initial_speed: float


_PREPARED: Remembered[Any, FreeInputs] = Remembered(4_000_000)
"""The last inputs, by demand and steps; sizes in numbers."""


def prepare_free(demand: Demand, step: float, sample_step: float) -> FreeInputs:
    """Steps no longer than `step` and samples every `sample_step` over a demand's duration.

    Raises SimulationError for a step, a sampling or an amount of memory outside what is accepted.
    """
    inputs = _PREPARED.get((demand, step, sample_step))
    if inputs is None:
        inputs = _prepare(demand, step, sample_step)
        size = inputs.stage_inputs.size + inputs.sample_inputs.size + demand.size
        _PREPARED.keep((demand, step, sample_step), inputs, size)
    return inputs


def _prepare(demand: Demand, step: float, sample_step: float) -> FreeInputs:
    _check_number("step", step, SHORTEST_STEP, LONGEST_STEP)
    _check_number("sample_step", sample_step, SHORTEST_STEP, LONGEST_SAMPLE_STEP)
    if not (math.isfinite(demand.duration) and demand.duration >= sample_step):
        raise SimulationError(
            f"duration is {demand.duration} s; it must cover at least one sample step of"
            f" {sample_step} s."
        )
    steps, samples = demand.duration / min(step, sample_step), demand.duration / sample_step
    memory = STEP_BYTES * steps + SAMPLE_BYTES * samples
    if memory > MOST_MEMORY:
        raise SimulationError(
            f"{demand.duration:g} s in {steps:.3g} steps with {samples:.3g} samples take"
            f" {memory / 1e9:.3g} GB of memory, {MOST_MEMORY / 1e9:g} GB are accepted; take a"
            " longer step, fewer samples or a shorter duration."
        )
    count = math.floor(demand.duration / sample_step + _SAME_INSTANT)
    time = sample_step * np.arange(count + 1, dtype=np.float64)
    boundaries, sampled = _boundaries(time, np.union1d(demand.drive.knots, demand.brake.knots))
    lengths = np.diff(boundaries)
    parts = np.ceil(lengths / step - _SAME_INSTANT).astype(np.int64)
    steps = np.repeat(lengths / parts, parts)
    first_step = np.concatenate([[0], np.cumsum(parts)])
    samples = np.full(steps.size + 1, -1, dtype=np.int64)
    samples[first_step[sampled]] = np.arange(time.size)
    within = np.arange(steps.size) - np.repeat(first_step[:-1], parts)
    begin = np.repeat(boundaries[:-1], parts) + within * steps
    acting = _Acting(demand)
    stages = np.empty((steps.size, 3, 16))
    stages[:, 0] = acting(begin, "right")
    stages[:, 1] = acting(begin + 0.5 * steps, "right")
    stages[:, 2] = acting(begin + steps, "left")
    return FreeInputs(
        time,
        steps,
        samples,
        stages,
        acting(time, "left"),
        demand.road or Road.flat(),
        demand.initial_speed,
    )


def _check_number(name: str, value: float, lower: float, upper: float) -> None:
    if not lower <= value <= upper:
        raise SimulationError(f"{name} is {value} s; give one between {lower:g} s and {upper:g} s.")


def _boundaries(
    time: NDArray[np.float64], knots: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Sample times and the knots between them, and which of them are samples."""
    inside = knots[(knots > time[0]) & (knots < time[-1])]
    nearest = time[np.clip(np.searchsorted(time, inside), 1, time.size - 1)]
    before = time[np.clip(np.searchsorted(time, inside) - 1, 0, time.size - 1)]
    apart = np.minimum(np.abs(nearest - inside), np.abs(inside - before)) > _SAME_INSTANT
    boundaries = np.union1d(time, inside[apart])
    return boundaries, np.searchsorted(boundaries, time)


class _Acting:
    """What a demand does to the car at any time."""

    def __init__(self, demand: Demand):
        self.torques = (demand.drive, demand.brake)
        self.posts = demand.posts
        if self.posts is not None:
            self.height = CubicSpline(self.posts.time, self.posts.height)
            self.rate = self.height.derivative()

    def __call__(self, time: NDArray[np.float64], side) -> NDArray[np.float64]:
        """Post heights, their rates, drive and brake torques at given times, (n, 16)."""
        acting = np.zeros((time.size, 16))
        if self.posts is not None:
            held = np.clip(time, self.posts.time[0], self.posts.time[-1])
            acting[:, :4] = self.height(held)
            acting[:, 4:8] = np.where((held == time)[:, np.newaxis], self.rate(held), 0.0)
        # Rounding must not carry a stage across the jump at its step's end.
        nudge = -_SAME_INSTANT if side == "left" else _SAME_INSTANT
        for torque, columns in zip(self.torques, (slice(8, 12), slice(12, 16)), strict=True):
            if np.any(torque.values):
                acting[:, columns] = torque.at(time + nudge, side)
        return acting
