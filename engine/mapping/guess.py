"""Which column is which channel: every pair is scored, and the columns are handed out so that the
scores are greatest together and no channel is given twice.

A score is how well the name fits (`patterns`) times what unit and numbers leave of it (`sizes`).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..channels import ChannelInfo, channel, find_channel
from ..csv_table import split_title
from ..formats.table import Column
from ..units import plain_unit
from .mapping import ChannelMapping, MappedColumn, Places, told_apart
from .names import readings
from .numbers import Statistics
from .patterns import MEASURES, fits
from .signs_stated import stated_sign
from .sizes import (
    UPRIGHT,
    TakenUnit,
    differ,
    measured_by,
    reads_gravity,
    size_of,
    taken_unit,
)

THRESHOLD = 0.45
"""Confidence from which a column is proposed as a channel."""

CANDIDATE, MOST_CANDIDATES = 0.15, 4
"""Confidence from which a channel is offered for a column, and how many are."""

NEVER_CHANGES = 0.7
"""What is left of the confidence in a column that never changes."""

OTHER_UNIT = 0.75
"""Confidence in a template's unit where the file states another one."""

FITS_AS_WELL = 0.05
"""Difference in confidence by which a second column fits a channel as well."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A channel that a column may be.

    confidence : from 0 to 1;  reason : what speaks for it and what against, in words
    doubted : whether the unit is another one than the file states
    """

    channel: str
    unit: str
    sign: int
    confidence: float
    reason: str
    doubted: bool = False


@dataclass(frozen=True, slots=True)
class Guess:
    """What is proposed for a file.

    chosen : by column, what it is proposed as
    candidates : for each column what it may be, the likeliest first
    warnings : sentences about what needs a look
    """

    mapping: ChannelMapping
    chosen: Mapping[int, Candidate]
    candidates: tuple[tuple[Candidate, ...], ...]
    warnings: tuple[str, ...]

    def flipped(self, channels: Collection[str]) -> "Guess":
        """With the signs of some channels turned over."""
        chosen = {
            index: replace(one, sign=-one.sign) if one.channel in channels else one
            for index, one in self.chosen.items()
        }
        return replace(self, mapping=self.mapping.flipped(channels), chosen=chosen)


def named_like_channels(columns: Sequence[Column]) -> list[int]:
    """Columns whose names alone make them a candidate: those whose numbers need a look."""
    return [index for index, one in enumerate(columns) if _candidates(one, None, False)]


def guess(
    columns: Sequence[Column], known: Mapping[int, Statistics], *, clocks_told: bool = False
) -> Guess:
    """What the columns of a file probably are.

    known : what the numbers of a column say, for those whose numbers were looked at
    clocks_told : whether the file tells which column is the time of which, so that none needs to be
        mapped as time
    """
    clocks = {one.clock for one in columns if one.clock is not None}
    candidates = [
        _candidates(one, known.get(index), index in clocks) for index, one in enumerate(columns)
    ]
    for index in clocks if clocks_told else ():
        candidates[index] = []
    columns = told_apart(columns)
    chosen = _body_fixed(_assigned(candidates), candidates)
    for index, one in chosen.items():
        rivals = [
            columns[other].name
            for other, offered in enumerate(candidates)
            if other not in chosen
            and any(
                rival.channel == one.channel and rival.confidence > one.confidence - FITS_AS_WELL
                for rival in offered
            )
        ]
        if rivals and one.channel != "time":
            also = f"{one.reason}; {', '.join(rivals[:3])} fit{'s' * (len(rivals) == 1)} as well"
            less = max(THRESHOLD, 0.85 * one.confidence)
            chosen[index] = replace(one, confidence=less, reason=also)
    mapping = ChannelMapping(
        tuple(_entry(columns[index], chosen[index]) for index in sorted(chosen))
    )
    return Guess(
        mapping,
        chosen,
        tuple(tuple(offered[:MOST_CANDIDATES]) for offered in candidates),
        tuple(_warnings(columns, known, chosen)),
    )


def chosen_by_hand(column: Column, known: Statistics | None, name: str) -> Candidate:
    """A column as the channel that a person chose for it, whatever it is called: in a unit and with
    a sign by the rules of a guess.
    """
    info, (bare, stated) = channel(name), _stated_unit(column)
    ending = tuple(dict.fromkeys(unit for one in readings(bare) for unit in one.ending))
    taken = taken_unit(info, stated, ending, known, "choice")
    return _candidate(info, 1.0, taken, column, known)


def with_template(
    found: Guess,
    columns: Sequence[Column],
    known: Mapping[int, Statistics],
    template: ChannelMapping,
) -> Guess:
    """A guess with the mapping of a template that fits the columns in place of the guessed one.

    Doubted are the units where the file states another one: the template may come from a file in
    other units, or from a person who knows that the header lies.
    """
    chosen, said, places = {}, [], Places(columns)
    for one in template.columns:
        [index] = places.of(one.column, one.group)
        reason = "template" + (f"; {one.note}" if one.note else "")
        sure = Candidate(one.channel, one.unit, one.sign, 1.0, reason)
        chosen[index] = sure
        stated = _stated_unit(columns[index])[1]
        if stated and differ(stated, one.unit, channel(one.channel).unit):
            why = f"{reason}; the file states {stated}"
            chosen[index] = replace(sure, confidence=OTHER_UNIT, reason=why, doubted=True)
            said.append(
                f"{one.column} is in {stated} by the file, but the template takes {one.channel}"
                f" in {one.unit}; see which of them holds."
            )
    said += _warnings(columns, known, chosen)
    return replace(found, mapping=template, chosen=chosen, warnings=tuple(said))


def _stated_unit(column: Column) -> tuple[str, str]:
    """A column's name without its unit, and that unit, plain."""
    name, unit = column.name, column.unit
    if not unit:
        name, unit = split_title(name)
    return name, plain_unit(unit)


def _entry(column: Column, one: Candidate) -> MappedColumn:
    return MappedColumn(column.name, one.channel, one.unit, column.group, one.sign, note=one.reason)


def _candidates(column: Column, known: Statistics | None, clock: bool) -> list[Candidate]:
    """What a column may be, the likeliest first; nothing where it holds no number."""
    if known is not None and known.empty:
        return []
    name, stated = _stated_unit(column)
    own = find_channel(name.strip().lower())
    found: dict[str, tuple[float, tuple[str, ...]]] = {}
    if own is not None:
        found[own.name] = (1.0, ())
    else:
        for reading in readings(name):
            measured = MEASURES.get(measured_by(stated or next(iter(reading.ending), "")), "")
            # Also as if there were no unit: a header may state a wrong one.
            for one, fit in (*fits(reading, measured), *(fits(reading, "") if stated else ())):
                if fit > found.get(one, (0.0, ()))[0]:
                    found[one] = (fit, reading.ending)
    if clock and (own is None or own.name == "time"):
        found = {"time": (1.0, ())}
    made = [
        _candidate(
            channel(one), fit, taken_unit(channel(one), stated, ending, known), column, known
        )
        for one, (fit, ending) in found.items()
    ]
    if own is None and known is not None:
        made = _with_or_without_gravity(made, known)
    likely = [one for one in made if one.confidence >= CANDIDATE]
    return sorted(likely, key=lambda one: -one.confidence)


def _candidate(
    info: ChannelInfo, fit: float, unit: TakenUnit, column: Column, known: Statistics | None
) -> Candidate:
    confidence, reason = fit * unit.belief, unit.reason
    if known is not None and known.constant and info.name != "time":
        confidence, reason = NEVER_CHANGES * confidence, f"{reason}; it never changes"
    sign, words = stated_sign(info.name, column.comment, column.name)
    if sign < 0:
        reason = f"{reason}; turned over, since it says '{words}'"
    elif known is not None and _hangs(info, unit.unit, known):
        sign, reason = -1, f"{reason}; turned over, since it reads gravity as {known.median:.4g}"
    return Candidate(info.name, unit.unit, sign, round(confidence, 3), reason, unit.doubted)


def _hangs(info: ChannelInfo, unit: str, known: Statistics) -> bool:
    """Whether a column is an accelerometer that reads gravity upside down."""
    return size_of(info.name) is UPRIGHT and known.median < 0.0 and reads_gravity(known, unit)


def _with_or_without_gravity(made: Sequence[Candidate], known: Statistics) -> list[Candidate]:
    """Of a body's vertical acceleration with gravity and without, the one that the numbers are."""
    with_gravity = next((one for one in made if one.channel == "chassis.body_a_z"), None)
    if with_gravity is None:
        return list(made)
    upright = reads_gravity(known, with_gravity.unit)
    wrong = "chassis.a_z" if upright else "chassis.body_a_z"
    return [one for one in made if one.channel != wrong]


def _assigned(candidates: Sequence[Sequence[Candidate]]) -> dict[int, Candidate]:
    """Columns with the channels they are proposed as, greatest in sum, each channel once."""
    likely = {
        (index, one.channel): one
        for index, offered in enumerate(candidates)
        for one in offered
        if one.confidence >= THRESHOLD
    }
    rows = sorted({index for index, _ in likely})
    names = sorted({name for _, name in likely})
    if not likely:
        return {}
    # What is not likely gains nothing, and of equals the first column comes first.
    gain = np.zeros((len(rows), len(names)))
    for (index, name), one in likely.items():
        gain[rows.index(index), names.index(name)] = one.confidence - 1e-6 * index / (1 + rows[-1])
    chosen = {}
    for row, column in zip(*linear_sum_assignment(gain, maximize=True), strict=True):
        if gain[row, column] > 0.0:
            chosen[rows[row]] = likely[rows[row], names[column]]
    return dict(sorted(chosen.items()))


def _body_fixed(
    chosen: dict[int, Candidate], candidates: Sequence[Sequence[Candidate]]
) -> dict[int, Candidate]:
    """With a_x as that of a body-fixed accelerometer, where it stands beside one that reads gravity
    and a gyro, of which conditioning makes the pitch that takes gravity off.
    """
    has = {one.channel for one in chosen.values()}
    is_raw = {"chassis.body_a_z", "chassis.pitch_rate"} <= has and "chassis.pitch" not in has
    if not is_raw or "chassis.body_a_x" in has:
        return chosen
    for index, one in chosen.items():
        if one.channel == "chassis.a_x":
            for other in candidates[index]:
                if other.channel == "chassis.body_a_x":
                    why = f"{other.reason}; beside a vertical one that reads gravity"
                    raw_one = replace(other, reason=why, confidence=one.confidence)
                    return {**chosen, index: raw_one}
    return chosen


def _warnings(
    columns: Sequence[Column],
    known: Mapping[int, Statistics],
    chosen: Mapping[int, Candidate],
) -> list[str]:
    """Sentences about units that lie, stand-ins, gaps, clipping and constant columns."""
    said = []
    if all(one.channel == "time" for one in chosen.values()):
        said.append("No column is taken for a channel by its name; map some by hand.")
    for index, one in chosen.items():
        name, numbers = columns[index].name, known.get(index)
        if "lies:" in one.reason or ", but " in one.reason:
            said.append(f"{name} is taken as {one.channel} in {one.unit}: {one.reason}.")
        if one.sign < 0 and "turned over, " in one.reason:
            why = one.reason.partition("; turned over, ")[2]
            said.append(f"{name} is taken as {one.channel} turned over, {why}; look at its sign.")
        if numbers is None:
            continue
        for value, samples in numbers.stand_ins:
            said.append(
                f"{name} is {value:g} in {samples} samples, far outside the rest; if that stands"
                f" for nothing measured, give {value:g} as missing."
            )
        if numbers.missing:
            said.append(f"{name} has no number in {numbers.missing} of {numbers.samples} samples.")
        for end in numbers.clipped:
            said.append(f"{name} stays at {end:g} again and again; it is probably clipped there.")
        if numbers.constant and one.channel != "time":
            said.append(f"{name} never changes.")
    return said
