"""The columns of an uploaded file as the REST interface shows them, with what they may be."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from ..errors import InvalidRequest
from ..frames import clean

if TYPE_CHECKING:
    from ...engine.formats.child import ChildTable
    from ...engine.formats.table import Column, Table
    from ...engine.mapping.numbers import Statistics
    from ...engine.mapping.survey import Survey


def columns_to_json(found: "Survey", mapping: Mapping[str, Any] | None) -> dict[str, Any]:
    """All columns with guess and candidates; the mapping that is proposed, and that which holds.

    mapping : that of the measurement, if it has one
    """
    from ...engine.mapping.mapping import mapping_to_json

    return clean(
        {
            "kind": found.kind,
            "columns": [_column(found, index) for index in range(len(found.columns))],
            "proposed": mapping_to_json(found.guess.mapping),
            "template": found.template or None,
            "mapping": mapping,
            "warnings": list(found.warnings),
        }
    )


def _column(found: "Survey", index: int) -> dict[str, Any]:
    column, chosen = found.columns[index], found.guess.chosen.get(index)
    return {
        "index": index,
        "name": column.name,
        "group": column.group,
        "unit": column.unit,
        "comment": column.comment,
        "samples": column.samples,
        "clock": column.clock,
        "step": column.step,
        **_numbers(found.known.get(index)),
        "guess": None if chosen is None else asdict(chosen),
        "candidates": [asdict(one) for one in found.guess.candidates[index]],
    }


def _numbers(known: "Statistics | None") -> dict[str, Any]:
    """What a column's numbers say; null where they were not looked at."""
    if known is None:
        return {"minimum": None, "maximum": None, "constant": None, "gaps": None, "stand_ins": []}
    return {
        "minimum": known.minimum,
        "maximum": known.maximum,
        "constant": known.constant,
        "gaps": known.missing,
        "stand_ins": [one._asdict() for one in known.stand_ins],
    }


def candidate_to_json(found: "Survey", index: int, channel: str) -> dict[str, Any]:
    """A column as the channel that a person chose for it."""
    from ...engine.mapping.guess import chosen_by_hand

    _require_column(found.columns, index)
    return asdict(chosen_by_hand(found.columns[index], found.known.get(index), channel))


def _require_column(columns: "Sequence[Column]", index: int) -> None:
    if not 0 <= index < len(columns):
        raise InvalidRequest(
            f"There is no column {index}; they go from 0 to {len(columns) - 1}.", field="index"
        )


def preview(table: "ChildTable", indices: Iterable[int], points: int) -> list[dict[str, Any]]:
    """Least and greatest value of some columns, in the file's numbers, over at most so many
    stretches. The child looks at the numbers; few of them come back.
    """
    shown = []
    for index in indices:
        _require_column(table.columns, index)
        seen, (unit, factor) = table.envelope(index, points), _clock_unit(table, index)
        shown.append(
            {
                "index": index,
                "name": table.columns[index].name,
                "unit": table.columns[index].unit,
                "time_unit": unit,
                "time": (factor * seen.time).tolist(),
                "minimum": seen.minimum.tolist(),
                "maximum": seen.maximum.tolist(),
            }
        )
    return clean(shown)


def _clock_unit(table: "Table", index: int) -> tuple[str, float]:
    """The unit in which a column's time is shown, and what its clock's numbers are multiplied by:
    s, else the clock's own unit, else the number of the sample.
    """
    from ...engine.units import UnitError, plain_unit, to_si

    column = table.columns[index]
    if column.clock is None:
        return ("sample" if column.step is None else "s"), 1.0
    unit = plain_unit(table.columns[column.clock].unit)
    if not unit:
        return "s", 1.0
    try:
        return "s", to_si(unit, "s")[0]
    except UnitError:
        return unit, 1.0
