"""One run of the measurements of the service, and its table."""

import asyncio
import os
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from textwrap import wrap
from typing import Any

from .. import machine
from ..table import LINE
from . import costs, waiting
from .figure import Figure, Measured
from .pace import QUICK, THOROUGH, Pace

ROWS: Mapping[str, Callable[[Pace], Awaitable[Measured]]] = {
    "slider": waiting.slider,
    "hello": waiting.hello,
    "restart": waiting.restart,
    "idle": costs.idle,
    "session": costs.session,
    "move": costs.slider_move,
    "identification-job": costs.identify,
    "sweep-job": costs.swept,
    "stream": costs.stream,
    "upload": costs.upload,
}
"""Every row by name, in the order of the table."""

HEAD = ("row", "figure", "value", "target", "met")
RIGHT = (2, 3)
UNITS = (("G", 1e9), ("M", 1e6), ("k", 1e3), ("", 1.0))


@dataclass(frozen=True)
class ServiceReport:
    """Everything one run measured, rows by name."""

    machine: Mapping[str, Any]
    rows: Mapping[str, Measured]


def run(names: Sequence[str], quick: bool, tell: Callable[[str], None]) -> ServiceReport:
    """Measure the rows of those names in the order of the table, telling which before each.

    quick : for a shorter time, with fewer sessions
    """
    pace, rows = QUICK if quick else THOROUGH, {}
    for name, measure in ROWS.items():
        if name in names:
            tell(name)
            load, began, spent = os.getloadavg()[0], time.perf_counter(), time.process_time()
            found = asyncio.run(_awaited(measure(pace)))
            share = (time.process_time() - spent) / (time.perf_counter() - began)
            rows[name] = replace(found, load=load, generator=share)
    return ServiceReport(machine.describe(), rows)


async def _awaited(measured: Awaitable[Measured]) -> Measured:
    return await measured


def table(report: ServiceReport) -> list[tuple[str, ...]]:
    """Head and rows as text."""
    lines: list[tuple[str, ...]] = [HEAD]
    for name, row in report.rows.items():
        for number, figure in enumerate(row.figures):
            lines.append(("" if number else name, figure.name, *_cells(figure)))
    return lines


def _cells(figure: Figure) -> tuple[str, str, str]:
    target = ""
    if figure.most is not None:
        target = f"< {_shown(figure.most, figure.unit)}"
    elif figure.least is not None:
        target = f"> {_shown(figure.least, figure.unit)}"
    met = {True: "yes", False: "no", None: ""}[figure.met]
    return _shown(figure.value, figure.unit), target, met


def _shown(value: float, unit: str) -> str:
    """Three digits in a unit that suits."""
    if unit == "B":
        prefix, factor = next((one for one in UNITS if abs(value) >= one[1]), UNITS[-1])
        return f"{value / factor:.3g} {prefix}B"
    if unit == "s" and abs(value) < 1:
        return f"{1e3 * value:.3g} ms"
    if unit == "1/s":
        return f"{value:.0f} /s"
    return f"{value:.3g} {unit}".strip()


def preface(report: ServiceReport) -> list[str]:
    """Lines that say what the figures were measured on."""
    known = report.machine
    versions = ", ".join(f"{name} {number}" for name, number in known["versions"].items())
    return [f"{known['processor']}, {known['cores']} cores, {known['system']}.", f"{versions}."]


def legend(report: ServiceReport) -> list[str]:
    """Lines that say what each row is, and what else the machine did."""
    sentences = [
        f"{name}: {row.what}. Load average before: {row.load:.1f}; the bench itself took"
        f" {row.generator:.0%} of a core."
        for name, row in report.rows.items()
    ]
    return [line for sentence in sentences for line in wrap(sentence, LINE)]


def report_to_json(report: ServiceReport) -> dict[str, Any]:
    """The same as numbers, SI."""
    return {
        "machine": dict(report.machine),
        "rows": [
            {
                "name": name,
                "what": row.what,
                "load_average": row.load,
                "generator_share": row.generator,
                "figures": [{**asdict(figure), "met": figure.met} for figure in row.figures],
            }
            for name, row in report.rows.items()
        ],
    }
