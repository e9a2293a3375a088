"""What is asked of the sensors of an identification: by channel and quantity a number, or "fit".

    {"chassis.z": {"delay": 0.005, "gain": "fit"}, "chassis.a_x": {"bias": "fit"}}

Gain and delay belong to a sensor and are shared by the runs; a bias, which changes whenever the
sensor is zeroed, is found for each run by itself.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

from ..channels import (
    INPUT_CHANNELS,
    LARGEST_NOISE,
    OUTPUT_CHANNELS,
    SMALLEST_NOISE,
    WHEEL_CHANNELS,
    channel,
    near_channel,
)
from ..errors import ProblemError
from .sensing import Reading
from .variables import Variable

SENSOR_CHANNELS = (*OUTPUT_CHANNELS, *INPUT_CHANNELS)
"""Those that an identification compares, and those that drive it."""

NOMINAL: Mapping[str, float] = {"delay": 0.0, "gain": 1.0, "bias": 0.0, "sign": 1.0}
"""Of an ideal sensor; where a fitted quantity starts."""

QUANTITIES = (*NOMINAL, "noise")
FIT = "fit"

GAINS = (0.5, 2.0)
DELAYS = (-0.1, 0.1)
"""Bounds of a fitted gain and delay, s, and ..."""

SHARE_OF_LARGEST = 0.1
"""... those of a bias, as a share of the largest value of a real recording (`channels`)."""

LONGEST_DELAY = 0.5
SMALLEST_GAIN, LARGEST_GAIN = 1e-6, 1e6
LARGEST_BIAS = 1e6
"""What a fixed quantity may be."""


@dataclass(frozen=True, slots=True)
class SensorVariable(Variable):
    """A quantity of a sensor that is found with the parameters; `run` where it is one run's own."""

    channel: str
    quantity: str
    run: str | None

    @property
    def unit(self) -> str:
        """SI unit of the quantity."""
        return {"gain": "1", "delay": "s"}.get(self.quantity, channel(self.channel).unit)


@dataclass(frozen=True, slots=True)
class SensorModel:
    """What is known of the sensors, and what is to be found.

    fixed : by channel and quantity, SI;  fitted : by channel, quantities
    """

    fixed: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    fitted: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __contains__(self, name: str) -> bool:
        """Whether anything but its noise is said of a channel's sensor."""
        told = {*self.fixed.get(name, ()), *self.fitted.get(name, ())}
        return bool(told - {"noise"})

    @property
    def asked(self) -> dict[str, dict[str, float | str]]:
        """The same as it can be asked for again."""
        return {
            name: {
                quantity: self.fixed[name][quantity] if quantity in known else FIT
                for quantity in QUANTITIES
                if quantity in (known := self.fixed.get(name, {}))
                or quantity in self.fitted.get(name, ())
            }
            for name in SENSOR_CHANNELS
            if name in self.fixed or name in self.fitted
        }

    @property
    def unzeroed(self) -> frozenset[str]:
        """Channels whose bias is to be found."""
        return frozenset(name for name, asked in self.fitted.items() if "bias" in asked)

    def reading(self, name: str, found: Mapping[str, float] | None = None) -> Reading:
        """The sensor of a channel, with fitted quantities as found, else ideal."""
        one = {**NOMINAL, **self.fixed.get(name, {}), **(found or {})}
        return Reading(one["sign"] * one["gain"], one["bias"], one["delay"])

    def readings(self) -> dict[str, Reading]:
        """Those of all channels by what is fixed."""
        return {name: self.reading(name) for name in SENSOR_CHANNELS if name in self}

    def noise(self) -> dict[str, float]:
        """Standard deviation by channel where it is fixed."""
        return {name: one["noise"] for name, one in self.fixed.items() if "noise" in one}

    @property
    def finds_noise(self) -> bool:
        """Whether the noise of any channel is to be found."""
        return any(self.fits_noise(name) for name in self.fitted)

    def fits_noise(self, name: str) -> bool:
        """Whether the noise of a channel is to be found."""
        return "noise" in self.fitted.get(name, ())

    def variables(self, runs: Sequence[tuple[str, Iterable[str]]]) -> tuple[SensorVariable, ...]:
        """What is to be found beside the parameters.

        runs : their names and the channels that they compare
        Raises ProblemError for a channel that none of them compares.
        """
        found: list[SensorVariable] = []
        for name in SENSOR_CHANNELS:
            having = [run for run, seen in runs if name in INPUT_CHANNELS or name in seen]
            for quantity in self.fitted.get(name, ()):
                if not having:
                    raise ProblemError(
                        f"sensor.{name}.{quantity} is to be fitted, but no run compares {name}; "
                        "leave it out."
                    )
                lower, upper = _bounds(name, quantity)
                found += [
                    SensorVariable(
                        name=f"sensor.{name}.{quantity}",
                        start=NOMINAL[quantity],
                        lower=lower,
                        upper=upper,
                        channel=name,
                        quantity=quantity,
                        run=run,
                    )
                    for run in (having if quantity == "bias" else [None])
                    if quantity != "noise"
                ]
        return tuple(found)


def sensor_model(
    given: Mapping[str, Mapping[str, Any]],
    *,
    fit_noise: bool = False,
    biased: bool = True,
) -> SensorModel:
    """The model of what is given by channel and quantity, or one sentence on what is wrong with it.

    fit_noise : find that of every compared channel for which none is fixed
    biased : whether a constant is compared; a high-pass takes it off
    """
    if strangers := [name for name in given if name not in SENSOR_CHANNELS]:
        raise ProblemError(_unknown_channel(strangers[0]))
    fixed: dict[str, dict[str, float]] = {}
    fitted: dict[str, tuple[str, ...]] = {}
    for name in SENSOR_CHANNELS:
        asked = given.get(name, {})
        if not isinstance(asked, Mapping):
            raise ProblemError(
                f'sensor.{name} is {asked!r}; give its quantities, e.g. {{"delay": 0.005}}.'
            )
        for quantity, value in asked.items():
            _check(name, quantity, value, biased)
        if known := {one: float(asked[one]) for one in QUANTITIES if asked.get(one, FIT) != FIT}:
            fixed[name] = known
        noisy = fit_noise and name in OUTPUT_CHANNELS and "noise" not in asked
        wanted = (one for one in QUANTITIES if asked.get(one) == FIT or (noisy and one == "noise"))
        if quantities := tuple(wanted):
            fitted[name] = quantities
    return SensorModel(fixed, fitted)


def asked_in(fit: Mapping[str, Any]) -> dict[str, dict[str, float | str]]:
    """What a fit, as JSON, was asked of the sensors, but for the noise that it found."""
    asked: dict[str, dict[str, float | str]] = {
        name: dict(one) for name, one in fit.get("fixed_sensors", {}).items()
    }
    for one in fit.get("sensors", ()):
        asked.setdefault(one["channel"], {})[one["quantity"]] = FIT
    return asked


def readings_in(fit: Mapping[str, Any], run: str | None) -> dict[str, Reading]:
    """The sensors that a fit, as JSON, knows for one of its runs, or for another one (None), of
    whose biases it knows nothing; none where it is from before there were sensors.
    """
    told = {name: dict(one) for name, one in fit.get("fixed_sensors", {}).items()}
    for one in fit.get("sensors", ()):
        if one["run"] in (None, run):
            told.setdefault(one["channel"], {})[one["quantity"]] = one["value"]
    model = SensorModel(told)
    return model.readings()


def sensor_path(path: str) -> tuple[str, str]:
    """Channel and quantity out of CHANNEL.QUANTITY, which may begin with "sensor."."""
    name, dot, quantity = path.removeprefix("sensor.").rpartition(".")
    if not dot or not name:
        raise ProblemError(
            f"No sensor is called {path!r}; write a channel and a quantity, e.g. chassis.z.gain."
        )
    if name not in SENSOR_CHANNELS:
        raise ProblemError(_unknown_channel(name))
    if quantity not in QUANTITIES:
        raise ProblemError(_unknown_quantity(name, quantity))
    return name, quantity


def _unknown_channel(name: str) -> str:
    near = near_channel(name)
    hint = (
        f"did you mean {near}?"
        if near in SENSOR_CHANNELS and near != name
        else f"there are {', '.join(SENSOR_CHANNELS)}."
    )
    return f"An identification knows no sensor of {name!r}; {hint}"


def _unknown_quantity(name: str, quantity: str) -> str:
    near = get_close_matches(quantity, QUANTITIES, n=1)
    hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(QUANTITIES)}."
    return f"The sensor of {name} has no {quantity!r}; {hint}"


def _check(name: str, quantity: str, value: Any, biased: bool) -> None:
    """Raise ProblemError for a quantity that cannot be had."""
    if quantity not in QUANTITIES:
        raise ProblemError(_unknown_quantity(name, quantity))
    path = f"sensor.{name}.{quantity}"
    if quantity == "noise" and name not in OUTPUT_CHANNELS:
        raise ProblemError(
            f"{path} is given, but noise counts only where model and measurement are compared: in "
            f"{', '.join(OUTPUT_CHANNELS)}; leave it out."
        )
    if value == FIT:
        _check_fitted(name, quantity, path, biased)
        return
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value):
        raise ProblemError(f'{path} is {value!r}; give a finite number or "fit".')
    lowest, highest, what = {
        "delay": (-LONGEST_DELAY, LONGEST_DELAY, "a time in s"),
        "gain": (SMALLEST_GAIN, LARGEST_GAIN, "a factor; a turned sensor has the sign -1"),
        "bias": (-LARGEST_BIAS, LARGEST_BIAS, f"a number in {channel(name).unit}"),
        "sign": (-1.0, 1.0, "1, or -1 for a turned sensor"),
        "noise": (SMALLEST_NOISE, LARGEST_NOISE, f"a standard deviation in {channel(name).unit}"),
    }[quantity]
    if not lowest <= value <= highest or (quantity == "sign" and abs(value) != 1.0):
        span = "" if quantity == "sign" else f", from {lowest:g} to {highest:g}"
        raise ProblemError(f"{path} is {value:g}; give {what}{span}.")


def _check_fitted(name: str, quantity: str, path: str, biased: bool) -> None:
    if quantity == "sign":
        raise ProblemError(f"{path} cannot be fitted; fix it at 1 or -1.")
    if quantity == "delay" and name in WHEEL_CHANNELS:
        raise ProblemError(
            f"{path} cannot be fitted, since a wheel's delay acts through its second derivative; "
            'find it by conditioning (the step "delay") and fix it here.'
        )
    if quantity == "bias" and name in OUTPUT_CHANNELS and not biased:
        raise ProblemError(
            f"{path} cannot be fitted behind the high-pass output_highpass_hz, which takes a "
            "constant off; leave one of the two out."
        )


def _bounds(name: str, quantity: str) -> tuple[float, float]:
    if quantity == "gain":
        return GAINS
    if quantity == "delay":
        return DELAYS
    most = SHARE_OF_LARGEST * channel(name).largest
    return -most, most


def described(one: SensorVariable) -> str:
    """A quantity as sentences name it."""
    return one.name if one.run is None else f"{one.name} of run {one.run}"
