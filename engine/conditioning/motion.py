"""Steps from accelerometers, gyros and speed to displacement, angles and inertial acceleration.

With e_X, e_Y, e_Z the inertial axes in the body's (docs/model.md, eq. 1) and (a_X, a_Y, a_Z) the
acceleration of a point, an accelerometer fixed there to the body reads

    (1)  f = a_X e_X + a_Y e_Y + (a_Z + g) e_Z

and therefore, p and r being pitch (nose down) and roll (left side up),

    (2)  a_X     =  f_x cos p + f_y sin p sin r + f_z sin p cos r
    (3)  a_Z + g = -f_x sin p + f_y cos p sin r + f_z cos p cos r

Without f_y the car does not accelerate sideways: f_y sin r + f_z cos r = f_z / cos r. Without f_z
it does not accelerate upwards either: a_X = (f_x + g sin p) / cos p. A sensor at P from the CG
reads w' x P + w x (w x P) more, w = (r', p' cos r, -p' sin r).
"""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from scipy.interpolate import CubicSpline

from ..errors import ConditioningError
from ..filters import in_band, low_pass, slow_part
from ..frames import CORNERS, GRAVITY
from ..run import Run
from ..vehicle import Range, Vehicle
from .done import (
    Array,
    Done,
    history,
    history_or,
    require,
    require_band,
    require_resolved,
    require_sampled,
)
from .lateness import find_lateness

TARGETS = {
    "chassis.a_z": "chassis.z",
    **{f"wheel.{corner}.a_z": f"wheel.{corner}.z" for corner in CORNERS},
}
"""The displacement that each accelerometer gives."""

MILLI_G = 1e-3 * GRAVITY


@dataclass(frozen=True, slots=True)
class Displacement:
    """Vertical accelerations integrated twice, in a band, zero-phase.

    channels : accelerations, of which `wheel.fl.a_z` becomes `wheel.fl.z`
    band_hz : lowest and highest frequency

    The acceleration less its mean is integrated as a cubic spline and goes through the filters of
    `filters`. These take off any straight line, so no constant of integration is left, and the
    result is what the same filters make of the true displacement. An error e of the acceleration at
    frequency f becomes e / (2 pi f)^2: 1 mg at 0.2 Hz is 6.2 mm.
    """

    kind: ClassVar[str] = "displacement"
    channels: tuple[str, ...]
    band_hz: Annotated[tuple[float, float], Range("Hz", 0.02, 1e4)] = (0.3, 50.0)

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run with the displacements."""
        if not self.channels:
            raise ConditioningError("no channel is named; name accelerations.")
        for name in self.channels:
            if name not in TARGETS:
                raise ConditioningError(
                    f"{name} does not become a displacement; choose from {', '.join(TARGETS)}."
                )
        require(run, self.channels)
        require_band(run, self.band_hz)
        low, high = self.band_hz
        found, noise = {}, {}
        for name in self.channels:
            values = history(run, name)
            twice = CubicSpline(run.time, values - np.mean(values)).antiderivative(2)(run.time)
            # The line goes for the sake of rounding alone.
            line = np.polyval(np.polyfit(run.time, twice, 1), run.time)
            found[TARGETS[name]] = in_band(run.time, twice - line, self.band_hz)
            if name in run.noise:
                noise[TARGETS[name]] = _integrated_noise(run, run.noise[name], self.band_hz)
        of_milli_g = MILLI_G / (2.0 * math.pi * low) ** 2
        numbers = {"of_1_mg_m": of_milli_g, **{f"noise.{name}": s for name, s in noise.items()}}
        return Done(
            found,
            numbers=numbers,
            band_hz=self.band_hz,
            sentences=(
                f"{', '.join(found)} from {low:g} to {high:g} Hz; an error of 1 mg at {low:g} Hz "
                f"is {1e3 * of_milli_g:.2g} mm.",
            ),
            noise=noise,
        )


def _integrated_noise(run: Run, noise: float, band: tuple[float, float]) -> float:
    """Standard deviation of white noise of an acceleration after two integrations in a band.

    Its density 2 h s^2 over the frequency, h the sample step, times |H|^2 / (2 pi f)^4.
    """
    low, high = band
    f = np.geomspace(0.05 * low, 0.5 / run.sample_step, 4000)
    # Of the squared amplitude; both filters run twice.
    kept = 1.0 / (1.0 + (low / f) ** 6) ** 2 / (1.0 + (f / high) ** 6) ** 2
    density = 2.0 * run.sample_step * noise**2 * kept / (2.0 * math.pi * f) ** 4
    return float(np.sqrt(np.trapezoid(density, f)))


@dataclass(frozen=True, slots=True)
class Angles:
    """Pitch or roll from its rate, held to gravity by an accelerometer.

    accelerometer : whether there is one; what it says of the angle below `crossover_hz` takes the
        place of what the integrated rate says
    crossover_hz : without an accelerometer what the integral holds above it is all there is; 0 for
        the bare integral, whose error is the bias of the gyro times the time

    The angle is g(t) + LP(s - g): g the integrated rate, s the angle by the accelerometer, LP the
    zero-phase low-pass of `filters`. A bias of the gyro is a line in g, which LP takes away whole.
    With a_X the car's acceleration and F = f_z / cos r, pitch and roll are by gravity

        (4)  p = atan2(a_X, G) - atan2(f_x, F),   G = sqrt(f_x^2 + F^2 - a_X^2)
        (5)  r = atan2(f_y, f_z)

    where f_z is g without its channel, a_X is 0 without `chassis.a_x`, and the car does not
    accelerate sideways.
    """

    kind: ClassVar[str] = "angles"
    angle: Literal["pitch", "roll"]
    accelerometer: bool = True
    crossover_hz: Annotated[float, Range("Hz", 0.0, 5.0)] = 0.2

    def __post_init__(self) -> None:
        """Refuse an accelerometer that would never be asked."""
        if self.accelerometer and self.crossover_hz == 0.0:
            raise ConditioningError(
                "crossover_hz is 0, below which the accelerometer would count; raise it, or set "
                "accelerometer to false."
            )

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run with the angle."""
        rate, target = f"chassis.{self.angle}_rate", f"chassis.{self.angle}"
        turned = CubicSpline(run.time, history(run, rate)).antiderivative()(run.time)
        low = self.crossover_hz
        if low == 0.0:
            sentence = (
                f"{target} is {rate} integrated from 0 at the start; a bias of 0.01 deg/s is "
                f"{0.01 * run.duration:.2g} deg at the end."
            )
            return Done({target: turned}, sentences=(sentence,))
        require_resolved(run, low, "crossover_hz")
        require_sampled(run, low, "crossover_hz")
        if not self.accelerometer:
            sentence = f"{target} is {rate} integrated, above {low:g} Hz alone."
            kept = in_band(run.time, turned, (low, None))
            return Done({target: kept}, band_hz=(low, None), sentences=(sentence,))
        steep, told = self._by_gravity(run)
        found = turned + slow_part(run.time, steep - turned, low)
        drift = float(np.polyfit(run.time, turned - steep, 1)[0])
        late = find_lateness(run, low) if self.angle == "pitch" else None
        return Done(
            {target: found},
            numbers={"gyro_bias_rad_s": drift},
            sentences=(
                f"{target} is {rate} integrated above {low:g} Hz, and by gravity below; {told}",
                f"The gyro's bias was {math.degrees(drift):.3g} deg/s.",
            ),
            warnings=() if late is None else (late.warning,),
        )

    def _by_gravity(self, run: Run) -> tuple[Array, str]:
        """The angle by the accelerometer, and what was taken for granted."""
        if self.angle == "roll":
            across, up = (
                history(run, "chassis.body_a_y"),
                history_or(run, "chassis.body_a_z", GRAVITY),
            )
            return np.arctan2(across, up), "no acceleration sideways is taken for granted."
        along, up = history(run, "chassis.body_a_x"), history_or(run, "chassis.body_a_z", GRAVITY)
        up = up / np.cos(history_or(run, "chassis.roll", 0.0))
        a_x = history_or(run, "chassis.a_x", 0.0)
        gravity = np.sqrt(np.maximum(along**2 + up**2 - a_x**2, (0.1 * GRAVITY) ** 2))
        if "chassis.a_x" in run:
            told = "the car's own acceleration is taken off by chassis.a_x."
        else:
            told = "there is no chassis.a_x, so 1 m/s2 of the car's own are 5.8 deg."
        return np.arctan2(a_x, gravity) - np.arctan2(along, up), told


@dataclass(frozen=True, slots=True)
class Gravity:
    """From the body-fixed accelerometer to the inertial acceleration of the CG.

    position : of the sensor from the CG in the body's axes, m
    rate_cutoff_hz : low-pass of the angular rates before they are differentiated

    Makes `chassis.a_x`, and `chassis.a_z` where there is `chassis.body_a_z`, by (2) and (3).
    """

    kind: ClassVar[str] = "gravity"
    position: Annotated[tuple[float, float, float], Range("m", -20.0, 20.0)] = (0.0, 0.0, 0.0)
    rate_cutoff_hz: Annotated[float, Range("Hz", 0.5, 200.0)] = 20.0

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run with the accelerations."""
        pitch, roll = history(run, "chassis.pitch"), history_or(run, "chassis.roll", 0.0)
        sp, cp, sr, cr = np.sin(pitch), np.cos(pitch), np.sin(roll), np.cos(roll)
        swing = self._swing(run, pitch, roll)
        along = history(run, "chassis.body_a_x") - swing[0]
        told, found = [], {}
        if "chassis.body_a_z" in run:
            up = history(run, "chassis.body_a_z") - swing[2]
            if "chassis.body_a_y" in run:
                raised = (history(run, "chassis.body_a_y") - swing[1]) * sr + up * cr
            else:
                raised = up / cr
                told.append("There is no chassis.body_a_y: no acceleration sideways is assumed.")
            found["chassis.a_x"] = along * cp + raised * sp
            found["chassis.a_z"] = raised * cp - along * sp - GRAVITY
        else:
            found["chassis.a_x"] = (along + GRAVITY * sp) / cp
            steepest = math.degrees(float(np.max(np.abs(pitch))))
            told.append(
                "There is no chassis.body_a_z: no acceleration upwards is assumed; 1 m/s2 of it at "
                f"{steepest:.2g} deg is {math.tan(math.radians(steepest)):.2g} m/s2."
            )
        removed = float(np.max(np.abs(found["chassis.a_x"] - history(run, "chassis.body_a_x"))))
        return Done(
            found,
            numbers={"removed_m_s2": removed},
            sentences=(f"Up to {removed:.3g} m/s2 of gravity and swing taken off a_x.", *told),
        )

    def _swing(self, run: Run, pitch: Array, roll: Array) -> Array:
        """Acceleration of the sensor against the CG in the body's axes, (3, samples)."""
        if not any(self.position):
            return np.zeros((3, len(run.time)))
        require_sampled(run, self.rate_cutoff_hz, "rate_cutoff_hz")
        rates = []
        for name, angle in (("pitch", pitch), ("roll", roll)):
            rate = f"chassis.{name}_rate"
            known = history(run, rate) if rate in run else CubicSpline(run.time, angle)(run.time, 1)
            rates.append(low_pass(run.time, known, self.rate_cutoff_hz))
        w = np.stack([rates[1], rates[0] * np.cos(roll), -rates[0] * np.sin(roll)])
        w_rate = CubicSpline(run.time, w, axis=1)(run.time, 1)
        place = np.array(self.position)[:, np.newaxis] * np.ones(len(run.time))
        return np.cross(w_rate, place, axis=0) + np.cross(w, np.cross(w, place, axis=0), axis=0)


@dataclass(frozen=True, slots=True)
class Speed:
    """The car's speed by its wheels, or its acceleration by its speed, or both.

    source : "wheels" for the mean of the undriven wheels' speeds (of all that there are where all
        are driven, or without a vehicle), "v_x" for `chassis.v_x` as it is
    acceleration : whether `chassis.a_x` is made of it, below `cutoff_hz`
    """

    kind: ClassVar[str] = "speed"
    source: Literal["wheels", "v_x"] = "v_x"
    acceleration: bool = False
    cutoff_hz: Annotated[float, Range("Hz", 0.2, 50.0)] = 2.0

    def apply(self, run: Run, vehicle: Vehicle | None) -> Done:
        """The run with the speed, the acceleration or both."""
        found, told = {}, []
        if self.source == "wheels":
            speed, which = self._of_wheels(run, vehicle)
            found["chassis.v_x"] = speed
            told.append(f"chassis.v_x is the mean of {', '.join(which)}.")
        elif self.acceleration:
            speed = history(run, "chassis.v_x")
        else:
            raise ConditioningError(
                'nothing is to be made; set source to "wheels", or acceleration to true.'
            )
        if not self.acceleration:
            return Done(found, sentences=tuple(told))
        require_sampled(run, self.cutoff_hz, "cutoff_hz")
        smooth = low_pass(run.time, speed, self.cutoff_hz)
        found["chassis.a_x"] = CubicSpline(run.time, smooth)(run.time, 1)
        told.append(f"chassis.a_x is the derivative of the speed below {self.cutoff_hz:g} Hz.")
        return Done(found, band_hz=(None, self.cutoff_hz), sentences=tuple(told))

    def _of_wheels(self, run: Run, vehicle: Vehicle | None) -> tuple[Array, list[str]]:
        driven = () if vehicle is None else vehicle.driven_corners
        names = [f"wheel.{corner}.speed" for corner in CORNERS]
        there = [name for name in names if name in run]
        if not there:
            require(run, names)
        rolling = [name for name in there if name.split(".")[1] not in driven] or there
        return np.mean([history(run, name) for name in rolling], axis=0), rolling
