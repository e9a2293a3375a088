"""What is written in arguments: NAME=VALUE, NAME=LOW:HIGH, [RUN=]BEGIN:END, a frequency."""

import math
from argparse import Namespace
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...engine.channels import Run
from ...engine.errors import RideError
from ...engine.parameters import parameter
from ...engine.rims_settings import RimsSettings

VALUE = "NAME=VALUE in SI units"
LIMITS = "NAME=LOW:HIGH in SI units"
FREQUENCY = "a frequency in Hz, or none"
INTERVAL = "BEGIN:END in seconds, or none"


class ArgumentError(RideError):
    """An argument cannot be read; the sentence begins with it as it was typed."""

    code = "argument"


def starts(assignments: Iterable[str]) -> dict[str, float]:
    """Values by parameter out of NAME=VALUE."""
    values = {}
    for assignment in assignments:
        argument = f"--start {assignment}"
        name, text = _assigned(assignment, argument, VALUE, values)
        values[name] = _number(text, argument, VALUE)
    return values


def bounds(assignments: Iterable[str]) -> dict[str, tuple[float, float]]:
    """(lower, upper) by parameter out of NAME=LOW:HIGH."""
    limits = {}
    for assignment in assignments:
        argument = f"--bounds {assignment}"
        name, text = _assigned(assignment, argument, LIMITS, limits)
        limits[name] = _two_numbers(text, argument, LIMITS)
    return limits


def rims_settings(options: Namespace) -> RimsSettings:
    """How the recordings are prepared, as far as the options tell."""
    told: dict[str, Any] = {}
    for field in ("a_x_cutoff", "rim_cutoff", "output_cutoff"):
        text = getattr(options, field)
        if text is not None:
            argument = f"--{field.replace('_', '-')} {text}"
            told[f"{field}_hz"] = None if text == "none" else _number(text, argument, FREQUENCY)
    for field in ("initial_state", "step"):
        if getattr(options, field) is not None:
            told[field] = getattr(options, field)
    return RimsSettings(**told)


def with_braking(runs: Sequence[Run], marks: Sequence[str] | None) -> list[Run]:
    """The runs with the braking that [RUN=]BEGIN:END or [RUN=]none marks."""
    marked: dict[str, list[tuple[float, float]]] = {}
    for mark in marks or ():
        argument = f"--braking {mark}"
        name, _, text = mark.rpartition("=")
        if not name and len(runs) > 1:
            raise ArgumentError(f"{argument} names no run of several; write RUN={mark}.")
        name = Path(name).name or runs[0].name
        if name not in (run.name for run in runs):
            known = ", ".join(run.name for run in runs)
            raise ArgumentError(f"{argument}: there is no run {name}; there are {known}.")
        intervals = marked.setdefault(name, [])
        if text != "none":
            intervals.append(_two_numbers(text, argument, INTERVAL))
    return [
        replace(run, braking=tuple(marked[run.name])) if run.name in marked else run for run in runs
    ]


def _assigned(assignment: str, argument: str, form: str, earlier: Iterable[str]) -> tuple[str, str]:
    """The parameter that is set, and to what; each is set once."""
    name, _, text = assignment.partition("=")
    if not (name and text):
        raise ArgumentError(f"{argument} sets no parameter; write {form}.")
    name = parameter(name).name
    if name in earlier:
        raise ArgumentError(f"{argument} sets {name} a second time; set it once.")
    return name, text


def _two_numbers(text: str, argument: str, form: str) -> tuple[float, float]:
    first, colon, second = text.partition(":")
    if not colon:
        raise ArgumentError(f"{argument} lacks a colon; write {form}.")
    return _number(first, argument, form), _number(second, argument, form)


def _number(text: str, argument: str, form: str) -> float:
    """A finite number; `argument` and its `form` are for the sentence that refuses another text."""
    with suppress(ValueError):
        if math.isfinite(number := float(text)):
            return number
    raise ArgumentError(f"{argument}: {text!r} is not a finite number; write {form}.")
