"""What is written in arguments: NAME=VALUE, NAME=LOW:HIGH, NAME=LOW:HIGH:COUNT,
NAME=VALUE~DEVIATION, CHANNEL.QUANTITY=VALUE, [RUN=]BEGIN:END, [RUN=]FILE, a frequency, a whole
number.
"""

import math
from argparse import Namespace
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...engine.errors import RideError
from ...engine.identification.loss import Loss
from ...engine.identification.sensor_model import FIT, sensor_path
from ...engine.parameters import number_path, parameter
from ...engine.simulation.braking import Interval
from ...engine.simulation.rims_settings import RimsSettings
from ...engine.sweeps.designs import Spaced

VALUE = "NAME=VALUE in SI units"
LIMITS = "NAME=LOW:HIGH in SI units"
PRIOR = "NAME=VALUE~DEVIATION in SI units, or ~PERCENT%"
SENSOR = "CHANNEL.QUANTITY=VALUE in SI units"
LEVELS = "NAME=LOW:HIGH:COUNT or NAME=V1,V2,... in SI units"
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


def priors(assignments: Iterable[str]) -> dict[str, tuple[float, float]]:
    """(mean, standard deviation) by parameter, out of NAME=VALUE~DEVIATION or ~PERCENT%."""
    known = {}
    for assignment in assignments:
        argument = f"--prior {assignment}"
        name, text = _assigned(assignment, argument, PRIOR, known)
        first, tilde, second = text.partition("~")
        if not tilde:
            raise ArgumentError(f"{argument} lacks a standard deviation; write {PRIOR}.")
        mean = _number(first, argument, PRIOR)
        if second.endswith("%"):
            known[name] = mean, 0.01 * _number(second[:-1], argument, PRIOR) * abs(mean)
        else:
            known[name] = mean, _number(second, argument, PRIOR)
    return known


def sensors(options: Namespace) -> dict[str, dict[str, float | str]]:
    """What is known and what is to be found of sensors, by channel and quantity."""
    told: dict[str, dict[str, float | str]] = {}
    for argument, path, value in (
        *(_fixed_sensor(assignment) for assignment in options.sensor),
        *((f"--fit-sensor {path}", path, FIT) for path in options.fit_sensor),
    ):
        name, quantity = sensor_path(path)
        of_channel = told.setdefault(name, {})
        if quantity in of_channel:
            raise ArgumentError(f"{argument} sets {name}.{quantity} a second time; set it once.")
        of_channel[quantity] = value
    return told


def _fixed_sensor(assignment: str) -> tuple[str, str, float]:
    """The argument, the sensor's path and the value of CHANNEL.QUANTITY=VALUE."""
    argument = f"--sensor {assignment}"
    path, _, text = assignment.partition("=")
    if not (path and text):
        raise ArgumentError(f"{argument} sets no quantity of a sensor; write {SENSOR}.")
    return argument, path, _number(text, argument, SENSOR)


def loss(options: Namespace) -> Loss:
    """How much a residual counts."""
    if options.loss_scale is None:
        return Loss(options.loss or "linear")
    if options.loss in (None, "linear"):
        raise ArgumentError("--loss-scale needs a loss that bends; add e.g. --loss huber.")
    argument = f"--loss-scale {options.loss_scale}"
    return Loss(options.loss, _number(options.loss_scale, argument, "a number of noises"))


def ranges(assignments: Iterable[str]) -> dict[str, tuple[float, float]]:
    """(low, high) by path of any number of a vehicle, out of NAME=LOW:HIGH."""
    limits = {}
    for assignment in assignments:
        argument = f"--range {assignment}"
        name, text = _assigned(assignment, argument, LIMITS, limits, number_path)
        limits[name] = _two_numbers(text, argument, LIMITS)
    return limits


def levels(assignments: Iterable[str]) -> dict[str, Spaced | list[float]]:
    """Levels by path of any number of a vehicle, out of NAME=LOW:HIGH:COUNT or NAME=V1,V2,..."""
    found: dict[str, Spaced | list[float]] = {}
    for assignment in assignments:
        argument = f"--levels {assignment}"
        name, text = _assigned(assignment, argument, LEVELS, found, number_path)
        match text.split(":"):
            case [low, high, count]:
                first, last = (_number(end, argument, LEVELS) for end in (low, high))
                found[name] = Spaced(first, last, whole(count, argument, LEVELS))
            case [values]:
                found[name] = [_number(value, argument, LEVELS) for value in values.split(",")]
            case _:
                raise ArgumentError(f"{argument} lacks a count; write {LEVELS}.")
    return found


def band(text: str) -> tuple[float, float]:
    """Lowest and highest spatial frequency out of LOW:HIGH."""
    return _two_numbers(text, f"--band {text}", "LOW:HIGH in cycle/m")


def whole(text: str, argument: str, form: str) -> int:
    """A whole number, which may be written like 1e6; other arguments as of a number's."""
    with suppress(ValueError):
        return int(text)
    number = _number(text, argument, form)
    if number % 1.0:
        raise ArgumentError(f"{argument}: {text!r} is not a whole number; write {form}.")
    return int(number)


def rims_settings(options: Namespace) -> RimsSettings:
    """How the recordings are prepared, as far as the options tell."""
    told: dict[str, Any] = {}
    for field in ("a_x_cutoff", "rim_cutoff", "output_cutoff", "output_highpass"):
        text = getattr(options, field)
        if text is not None:
            argument = f"--{field.replace('_', '-')} {text}"
            told[f"{field}_hz"] = None if text == "none" else _number(text, argument, FREQUENCY)
    for field in ("initial_state", "step"):
        if getattr(options, field) is not None:
            told[field] = getattr(options, field)
    return RimsSettings(**told)


def braking(marks: Iterable[str], paths: Sequence[str]) -> dict[int, tuple[Interval, ...]]:
    """Braking by a run's place in `paths`, out of [RUN=]BEGIN:END and [RUN=]none.

    RUN is a recording's path as it was given, or the file's name where only one has it.
    """
    marked: dict[int, list[str]] = {}
    for mark in marks:
        name = mark.rpartition("=")[0]
        if not name and len(paths) > 1:
            raise ArgumentError(f"--braking {mark} names no run of several; write RUN={mark}.")
        place = place_of(name, paths, f"--braking {mark}") if name else 0
        marked.setdefault(place, []).append(mark)
    return {place: _intervals(of_run, paths[place]) for place, of_run in marked.items()}


def mappings(given: Iterable[str], paths: Sequence[str]) -> list[str | None]:
    """The mapping's file of each run in `paths`, out of RUN=FILE and, for all others, FILE."""
    of_run: dict[int, str] = {}
    others: str | None = None
    for text in given:
        argument = f"--mapping {text}"
        name, file = run_and_file(text)
        if name == "" or not file:
            raise ArgumentError(f"{argument} names no run or no file; write FILE or RUN=FILE.")
        place = None if name is None else place_of(name, paths, argument)
        if others is not None if place is None else place in of_run:
            raise ArgumentError(
                f"{argument} is a second mapping of {name or 'the same runs'}; give one, as FILE "
                "for all runs or as RUN=FILE."
            )
        if place is None:
            others = file
        else:
            of_run[place] = file
    return [of_run.get(place, others) for place in range(len(paths))]


def run_and_file(text: str) -> tuple[str | None, str]:
    """The run (None untold) and the file of [RUN=]FILE: of a file that is there the whole name
    counts, whatever = is in it.
    """
    if "=" not in text or Path(text).is_file():
        return None, text
    parts = text.split("=")
    ways = [("=".join(parts[:k]), "=".join(parts[k:])) for k in range(1, len(parts))]
    return next((way for way in ways if Path(way[1]).is_file()), ways[-1])


def place_of(name: str, paths: Sequence[str], argument: str) -> int:
    """Where in `paths` the run is that an argument names."""
    known = ", ".join(paths)
    if Path(name) in (given := [Path(path) for path in paths]):
        return given.index(Path(name))
    called = [place for place, path in enumerate(given) if path.name == name]
    if not called:
        raise ArgumentError(f"{argument}: there is no run {name}; there are {known}.")
    if len(called) > 1:
        raise ArgumentError(
            f"{argument}: several runs are called {name}; name it by its path, one of {known}."
        )
    return called[0]


def _intervals(marks: Sequence[str], path: str) -> tuple[Interval, ...]:
    """All that is marked in one run."""
    texts = [mark.rpartition("=")[2] for mark in marks]
    if "none" not in texts:
        return tuple(
            _two_numbers(text, f"--braking {mark}", INTERVAL)
            for text, mark in zip(texts, marks, strict=True)
        )
    if set(texts) != {"none"}:
        raise ArgumentError(
            f"--braking marks {path} with none and with an interval; leave out one of them."
        )
    return ()


def _identified(name: str) -> str:
    """Path of a parameter of an identification."""
    return parameter(name).name


def _assigned(
    assignment: str,
    argument: str,
    form: str,
    earlier: Iterable[str],
    path: Callable[[str], str] = _identified,
) -> tuple[str, str]:
    """The parameter that is set, by its `path`, and to what; each is set once."""
    name, _, text = assignment.partition("=")
    if not (name and text):
        raise ArgumentError(f"{argument} sets no parameter; write {form}.")
    name = path(name)
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
