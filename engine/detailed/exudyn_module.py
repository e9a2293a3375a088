"""The one place that imports Exudyn, when it is first needed."""

import sys
from contextlib import redirect_stdout
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from io import StringIO
from threading import Lock
from typing import Any

from ..errors import SimulationError
from ..extras import how_to_install

_IMPORTING = Lock()
"""Standard output is one for all threads: two that turn it aside would not both turn it back."""


def missing_exudyn() -> str:
    """What to do where Exudyn is missing, a sentence; empty where it is installed."""
    if find_spec("exudyn") is not None:
        return ""
    how = how_to_install("detailed")
    return (
        f"The detailed car is solved by Exudyn, which is not installed; {how}, and start a running"
        " service again."
    )


def require_exudyn() -> tuple[Any, Any]:
    """The modules exudyn and exudyn.itemInterface, without what they print.

    Exudyn's fast build is asked for, which checks no ranges. Raises SimulationError with the way
    to install it where it is missing.
    """
    if said := missing_exudyn():
        raise SimulationError(said)
    with _IMPORTING:
        return _imported()


@cache
def _imported() -> tuple[Any, Any]:
    if "exudyn" not in sys.modules:
        sys.exudynFast = True  # pyright: ignore[reportAttributeAccessIssue]  # read by the import
    with redirect_stdout(StringIO()):
        exudyn, items = import_module("exudyn"), import_module("exudyn.itemInterface")
    exudyn.config.printToConsole = False
    return exudyn, items
