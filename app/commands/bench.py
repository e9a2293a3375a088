"""`ridetune bench`: how fast the engine and its peers are on this machine, as one table."""

import json
import sys
from argparse import Namespace
from collections.abc import Sequence
from difflib import get_close_matches

from ..bench.run import ROWS, run
from ..bench.startup import STARTS
from ..bench.table import RIGHT, legend, preface, report_to_json, table
from .arguments import ArgumentError
from .output import print_table, require_place, write_file


def bench(options: Namespace) -> None:
    """Measure, print the table, write it as JSON."""
    names = _rows(options.only, options.quick)
    require_place(options.output, ())
    report = run(names, options.quick, lambda what: _show(f"Measuring {what}."))
    for line in preface(report):
        print(line)
    print()
    print_table(table(report), right=RIGHT)
    print()
    for line in legend(report):
        print(line)
    if options.output:
        write_file(options.output, json.dumps(report_to_json(report), indent=2) + "\n")


def _rows(only: Sequence[str], quick: bool) -> list[str]:
    """Names of the rows to measure: those asked for, else all, without start-up when in haste."""
    for name in only:
        if name not in ROWS:
            near = get_close_matches(name, ROWS, n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(ROWS)}."
            raise ArgumentError(f"--only {name}: there is no row of that name; {hint}")
    return list(only) or [name for name in ROWS if not (quick and name in STARTS)]


def _show(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
