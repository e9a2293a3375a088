"""A run of the benchmark as a table for people and as JSON for programs."""

from collections.abc import Mapping
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

from .modes import FINER
from .row import Row

NORM = (
    "greatest over z, pitch and roll of max |difference| / max |reference from its start|, against"
    f" the same equations with {FINER} times shorter steps"
)
COUNTING = (
    "distinct additions, subtractions, multiplications, divisions and square roots of a right-hand"
    " side as it is written, counted by running it on traced numbers"
)

HEAD = (
    *("row", "time", "fastest", "ns/rhs", "x real time", "error", "peak", "x ours"),
    "what",
)
LINE = 100
"""Longest line of prose."""

RIGHT = range(1, 8)
"""Columns that are flush right."""


@dataclass(frozen=True)
class Report:
    """Everything one run measured.

    peak : floating-point operations a second a core can do at most
    operations : of a right-hand side by mode
    rows : by the names that --only takes
    """

    machine: Mapping[str, Any]
    peak: float
    operations: Mapping[str, int]
    rows: Mapping[str, Row]


def table(report: Report) -> list[tuple[str, ...]]:
    """Head and rows as text."""
    return [HEAD, *((name, *_cells(row, report.peak)) for name, row in report.rows.items())]


def _cells(row: Row, peak: float) -> tuple[str, ...]:
    timing = row.timing
    return (
        _duration(timing.median) if timing else "-",
        _duration(timing.fastest) if timing else "-",
        _number(row.nanoseconds, "{:.0f}"),
        _number(row.times_real_time, "{:.0f}"),
        _number(row.error, "{:.1e}"),
        _number(row.peak_share(peak), "{:.0%}"),
        _number(row.ratio, "{:.1f}"),
        row.what,
    )


def _number(value: float | None, form: str) -> str:
    return "" if value is None else form.format(value)


def _duration(seconds: float) -> str:
    """Three digits in s or ms."""
    return f"{seconds:.3g} s" if seconds >= 0.9995 else f"{1e3 * seconds:.3g} ms"


def preface(report: Report) -> list[str]:
    """Lines that say what the figures were measured on."""
    machine = report.machine
    versions = ", ".join(f"{name} {number}" for name, number in machine["versions"].items())
    return [
        f"{machine['processor']}, {machine['cores']} cores, {' '.join(machine['extensions'])},"
        f" {machine['system']}.",
        f"Peak of fused multiply-adds: {report.peak / 1e9:.1f} GFLOP/s a core.",
        f"{versions}.",
    ]


def legend(report: Report) -> list[str]:
    """Lines that say what the columns mean."""
    counted = ", ".join(f"{mode} {number}" for mode, number in report.operations.items())
    sentences = [
        "time, fastest: median and minimum of repetitions, on one core unless a row says so.",
        "ns/rhs: a right-hand side of one car. x real time: of all cars together.",
        f"error: {NORM}.",
        f"peak: share of the core's peak; {COUNTING}: {counted}.",
        "x ours: how many times longer than road-one, measured in turn with it.",
    ]
    return [line for sentence in sentences for line in wrap(sentence, LINE)]


def report_to_json(report: Report) -> dict[str, Any]:
    """The same as numbers: seconds, nanoseconds, shares and ratios; null where nothing applies."""
    return {
        "machine": dict(report.machine),
        "peak_flops": report.peak,
        "operations": {"counted": COUNTING, **report.operations},
        "error_norm": NORM,
        "rows": [
            {"name": name, **_row_to_json(row, report.peak)} for name, row in report.rows.items()
        ],
    }


def _row_to_json(row: Row, peak: float) -> dict[str, Any]:
    timing = row.timing
    return {
        "what": row.what,
        "seconds": timing.median if timing else None,
        "fastest_seconds": timing.fastest if timing else None,
        "repetitions": len(timing.repetitions) if timing else 0,
        "cars": row.cars,
        "simulated_seconds": row.seconds,
        "evaluations": row.evaluations,
        "ns_per_evaluation": row.nanoseconds,
        "times_real_time": row.times_real_time,
        "error": row.error,
        "peak_share": row.peak_share(peak),
        "times_ours": row.ratio,
    }
