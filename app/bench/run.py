"""One run of the benchmark: which rows there are and how they are measured one after another."""

from collections.abc import Callable, Mapping, Sequence

from . import machine
from .cases import CASES, Case
from .peers import PEERS
from .startup import STARTS
from .table import Report
from .workbench import Workbench

ROWS: Mapping[str, Case] = {**CASES, **PEERS, **STARTS}
"""Every row by name, in the order of the table."""


def run(names: Sequence[str], quick: bool, tell: Callable[[str], None]) -> Report:
    """Measure the rows of those names in the order of the table, telling which before each.

    quick : fewer repetitions
    """
    bench = Workbench(quick)
    tell("the peak of the processor and the operations of a right-hand side")
    peak, operations = bench.peak, bench.operations
    rows = {}
    for name, measure in ROWS.items():
        if name in names:
            tell(name)
            rows[name] = measure(bench)
    return Report(machine.describe(), peak, operations, rows)
