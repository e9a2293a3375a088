"""The two ways this project compiles a function.

`inlined` is for the physics: small pure functions of numbers and NamedTuples, forced into their
caller so that a loop over cars around them becomes vector code. `compiled` is for entry points:
cached on disk, running without Python's lock.
"""

from collections.abc import Callable
from typing import Any, NoReturn

import numba
from numba.core import config

from .kernel_cache import cache_folder

# NaN and infinity keep their meaning: a diverged car must show. Divisions follow IEEE, without
# the branch that Python's ZeroDivisionError would put into every loop.
ARITHMETIC = {"fastmath": {"reassoc", "nsz", "arcp", "contract", "afn"}, "error_model": "numpy"}


# Numba makes its settings at run time, out of sight of the type checker.
config.CACHE_DIR = str(cache_folder())  # pyright: ignore[reportAttributeAccessIssue]

compiled: Callable[[Callable], Any] = numba.njit(cache=True, nogil=True, **ARITHMETIC)

# Without what Python needs to call them, a hundred small functions compile in half the time.
_WITHIN_KERNELS = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def inlined(function: Callable) -> Any:
    """Compile a function for use within others; from Python it raises TypeError."""
    dispatcher: Any = numba.njit(**_WITHIN_KERNELS, **ARITHMETIC)(function)
    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]
        return dispatcher

    def remember(result: Any) -> None:
        dispatcher.overloads[tuple(result.signature.args)] = result

    def refuse(*_: Any, **__: Any) -> NoReturn:
        raise TypeError(f"{function.__name__} works within kernels only; compile what calls it.")

    # Numba would jump to the wrapper that is not there.
    dispatcher.add_overload, dispatcher._compile_for_args = remember, refuse
    return dispatcher
