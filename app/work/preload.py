"""What simulators have from their first moment on: imported by the process they are forked from.

Where the cache on disk is cold this compiles, which takes half a minute. What jobs are checked by
is left out: nobody waits for a slider because of it.
"""

from ..compile import load_all
from ..simulators import simulator
from . import simulate

__all__ = ["simulate", "simulator"]

load_all()
