"""The steps that a recording calls for, by what it has and what an identification lacks."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..channels import INPUT_CHANNELS, OUTPUT_CHANNELS, channel
from ..errors import ConditioningError
from ..filters import PAD_PERIODS, is_uniform
from ..frames import CORNERS, Corner
from ..known_band import TIMES_LOWEST
from ..run import Run
from ..spikes import spike_samples
from ..units import listed
from ..vehicle import Vehicle
from .calibration import Rest, speeds, standstill
from .chain import Step, condition
from .delay import Delay
from .lateness import find_lateness
from .motion import TARGETS, Angles, Displacement, Gravity, Speed
from .rims import RimFromTravel
from .sampling import Despike, Fill, Resample

FASTEST, RATE = 400.0, 200.0
"""Samples a second beyond which a record is thinned out, and to how many."""

LOWEST, HIGHEST, CROSSOVER = 0.3, 50.0, 0.2
"""Band of displacements and crossover of angles, Hz, where the record allows them."""

ANGLES: tuple[tuple[Literal["pitch", "roll"], str], ...] = (
    ("pitch", "chassis.body_a_x"),
    ("roll", "chassis.body_a_y"),
)
"""Angles, and the accelerometer that holds each to gravity."""


@dataclass(frozen=True, slots=True)
class Suggestion:
    """Steps for a run.

    reasons : a sentence for each step
    lacks : what an identification still lacks after them, each with what would make it
    output_highpass_hz : what to compare the run above, None for everything
    """

    steps: tuple[Step, ...]
    reasons: tuple[str, ...]
    lacks: tuple[str, ...]
    output_highpass_hz: float | None


def suggest(run: Run, vehicle: Vehicle | None = None) -> Suggestion:
    """The steps that a recording calls for; none for one that has all in order.

    A channel that is recorded is never made anew. Without a vehicle no wheel comes from a
    potentiometer.
    """
    chain = _Chain(run, vehicle)
    chain.mend()
    chain.bring_in_time()
    chain.count_from_rest()
    chain.drive()
    chain.turn()
    chain.upright()
    chain.body()
    chain.wheels()
    return Suggestion(
        tuple(chain.steps),
        tuple(chain.reasons),
        chain.lacks(),
        TIMES_LOWEST * max(chain.lows) if chain.lows else None,
    )


class _Chain:
    """Steps gathered one after the other, and what the run has after them."""

    def __init__(self, run: Run, vehicle: Vehicle | None):
        self.run, self.vehicle = run, vehicle
        self.has = set(run.columns)
        self.steps: list[Step] = []
        self.reasons: list[str] = []
        self.lows: list[float] = []
        self._measure(run)
        self.rate = (len(run.time) - 1) / run.duration

    def add(self, step: Step, reason: str, *makes: str) -> None:
        """One more step, and the channels that it makes."""
        self.steps.append(step)
        self.reasons.append(f"{step.kind}: {reason}")
        self.has.update(makes)

    def _measure(self, run: Run) -> None:
        """Where the car stands, and from which frequencies on the record is long enough."""
        self.standing = standstill(run)
        longest = float(np.ceil(100.0 * PAD_PERIODS / run.duration) / 100.0)
        self.low, self.crossover = max(LOWEST, longest), max(CROSSOVER, longest)

    def mend(self) -> None:
        """Gaps, spikes and sampling."""
        run = self.run
        gaps = [name for name in run.columns if not np.all(np.isfinite(run[name]))]
        if gaps:
            self.add(Fill(), f"{gaps[0]} has gaps.")
        spiked = [name for name in run.columns if spike_samples(channel(name), run[name]).size]
        if spiked:
            self.add(Despike(tuple(spiked)), f"{spiked[0]} has spikes.")
        if self.rate > FASTEST:
            reason = f"{self.rate:.4g} samples a second are more than a ride model follows."
            self.add(Resample(RATE), reason)
            self.rate = RATE
        elif not is_uniform(run.time):
            even = float(max(1, round(self.rate)))
            self.add(Resample(even), "the samples are not evenly spaced.")

    def bring_in_time(self) -> None:
        """A speed or an acceleration that is clearly late against the accelerometer."""
        gyro = "chassis.pitch" not in self.has and "chassis.pitch_rate" in self.has
        by_speed = "chassis.a_x" not in self.has
        if not gyro or (by_speed and "chassis.v_x" not in self.has):
            return
        try:
            speed = [Speed(acceleration=True)] if by_speed else []
            late = find_lateness(condition(self.run, [*self.steps, *speed]), self.crossover)
        except ConditioningError:
            # The step that cannot be done will say so itself.
            return
        if late is not None:
            step = Delay(late.channel, seconds=round(late.lag.seconds, 3))
            self.add(step, f"without it {late.seen}.")
            self._measure(condition(self.run, self.steps))

    def count_from_rest(self) -> None:
        """Bias of raw sensors."""
        sensors = ("body_a_", "_rate", "chassis.a_z", "wheel.", "travel")
        raw = [
            name
            for name in self.run.columns
            if any(part in name for part in sensors) and not name.endswith((".z", ".speed"))
        ]
        if self.standing is not None and raw:
            begin, end = (round(one, 3) for one in self.standing)
            reason = f"the car stands from {begin:g} to {end:g} s, and {raw[0]} may have a bias."
            if not speeds(self.run):
                reason = (
                    f"no speed is recorded; that the car stands from {begin:g} to {end:g} s, where"
                    f" every channel is quiet, is assumed, and {raw[0]} may have a bias. Leave this"
                    " step out where it drives smoothly there."
                )
            self.add(Rest(interval=(begin, end)), reason)

    def drive(self) -> None:
        """Speed, and the slow part of a_x."""
        names = [name for corner in CORNERS if (name := f"wheel.{corner}.speed") in self.has]
        slow = "chassis.a_x" not in self.has
        made = ("chassis.a_x",) if slow else ()
        if "chassis.v_x" not in self.has and names:
            self.add(Speed("wheels", slow), f"{names[0]} gives the speed.", "chassis.v_x", *made)
        elif slow and "chassis.v_x" in self.has:
            self.add(Speed(acceleration=True), "chassis.v_x gives the slow part of a_x.", *made)

    def turn(self) -> None:
        """Pitch and roll from gyros."""
        for angle, sensor in ANGLES:
            target, rate = f"chassis.{angle}", f"chassis.{angle}_rate"
            if target in self.has or rate not in self.has:
                continue
            if sensor in self.has:
                step = Angles(angle, True, self.crossover)
                self.add(step, f"{rate} and {sensor} give {target}.", target)
            elif self.standing is not None:
                step = Angles(angle, False, 0.0)
                self.add(step, f"{rate}, its bias known from rest, gives {target}.", target)
            else:
                step = Angles(angle, False, self.crossover)
                self.add(step, f"{rate} gives {target} above {self.crossover:g} Hz.", target)
                self.lows.append(self.crossover)

    def upright(self) -> None:
        """Inertial accelerations from body-fixed ones."""
        made = {"chassis.a_x"} | ({"chassis.a_z"} if "chassis.body_a_z" in self.has else set())
        wanted = made - set(self.run.columns)
        if wanted and {"chassis.body_a_x", "chassis.pitch"} <= self.has:
            self.add(
                Gravity(),
                "a body-fixed accelerometer holds 0.17 m/s2 of gravity a degree of pitch.",
                *made,
            )

    def body(self) -> None:
        """z from its acceleration."""
        if "chassis.z" not in self.has and "chassis.a_z" in self.has:
            self._integrate("chassis.a_z")

    def wheels(self) -> None:
        """The wheel centres by potentiometers, else by hub accelerometers."""
        lacking: list[Corner] = [one for one in CORNERS if f"wheel.{one}.z" not in self.has]
        by_pot: tuple[Corner, ...] = tuple(
            c for c in lacking if f"suspension.{c}.travel" in self.has
        )
        if by_pot and self.vehicle is not None and self.has.issuperset(OUTPUT_CHANNELS):
            self.add(
                RimFromTravel(by_pot),
                "travel and the body's motion give the wheel centres.",
                *(f"wheel.{corner}.z" for corner in by_pot),
            )
        hubs = [f"wheel.{c}.a_z" for c in CORNERS if f"wheel.{c}.z" not in self.has]
        if by_hub := [name for name in hubs if name in self.has]:
            self._integrate(*by_hub)

    def _integrate(self, *names: str) -> None:
        targets = [TARGETS[name] for name in names]
        high = min(HIGHEST, 0.2 * self.rate)
        give = "give" if len(names) > 1 else "gives"
        reason = f"{listed(names)} {give} {listed(targets)} in a band."
        self.add(Displacement(names, (self.low, high)), reason, *targets)
        self.lows.append(self.low)

    def lacks(self) -> tuple[str, ...]:
        """What is still missing, with the remedy."""
        found = [f"{name}: {self._remedy(name)}" for name in INPUT_CHANNELS if name not in self.has]
        if not self.has & set(OUTPUT_CHANNELS):
            found.append("chassis.z, .pitch or .roll: record a gyro or a body-fixed accelerometer.")
        return tuple(found)

    def _remedy(self, name: str) -> str:
        if name == "chassis.a_x":
            return "record chassis.body_a_x with a pitch gyro, or chassis.v_x."
        corner = name.split(".")[1]
        travel = f"suspension.{corner}.travel"
        if travel in self.has and self.vehicle is None:
            return f"give a vehicle, with which {travel} tells it."
        return f"record {travel} beside z, pitch and roll, or wheel.{corner}.a_z."
