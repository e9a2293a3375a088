"""`ridetune bench`: how fast the engine and its peers, or the service, are on this machine."""

import json
import sys
from argparse import Namespace
from collections.abc import Collection, Sequence
from difflib import get_close_matches
from typing import Any

from ..bench import run as engine
from ..bench import table as engine_table
from ..bench.service import run as service
from ..bench.startup import STARTS
from .arguments import ArgumentError
from .output import print_table, require_place, write_file


def bench(options: Namespace) -> None:
    """Measure, print the table, write it as JSON."""
    measured, shown = (service, service) if options.service else (engine, engine_table)
    names = _rows(options.only, measured.ROWS, options.quick)
    require_place(options.output, ())
    report: Any = measured.run(names, options.quick, lambda what: _show(f"Measuring {what}."))
    for line in shown.preface(report):
        print(line)
    print()
    print_table(shown.table(report), right=shown.RIGHT)
    print()
    for line in shown.legend(report):
        print(line)
    if options.output:
        write_file(options.output, json.dumps(shown.report_to_json(report), indent=2) + "\n")


def _rows(only: Sequence[str], known: Collection[str], quick: bool) -> list[str]:
    """Names of the rows to measure: those asked for, else all, without start-up when in haste."""
    for name in only:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}."
            raise ArgumentError(f"--only {name}: there is no row of that name; {hint}")
    return list(only) or [name for name in known if not (quick and name in STARTS)]


def _show(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
