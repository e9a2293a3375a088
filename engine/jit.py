"""The two ways this project compiles a function, and where the compiled code is kept.

`inlined` is for the physics: small pure functions of numbers and NamedTuples, forced into their
caller so that a loop over cars around them becomes vector code. `compiled` is for entry points:
cached on disk, running without Python's lock.

Numba's cache looks only at the file of the function itself and would serve stale code after an
edit of a helper elsewhere; the cache folder is therefore named by a hash of all kernel sources.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import numba
from numba.core import config

# NaN and infinity keep their meaning: a diverged car must show. Divisions follow IEEE, without
# the branch that Python's ZeroDivisionError would put into every loop.
ARITHMETIC = {"fastmath": {"reassoc", "nsz", "arcp", "contract", "afn"}, "error_model": "numpy"}


def source_hash() -> str:
    """Short hash over the sources that decide what the compiled code does."""
    here = Path(__file__).resolve().parent
    digest = hashlib.sha256(numba.__version__.encode())
    constants = here / "frames.py"
    for source in [Path(__file__), constants, *sorted((here / "kernels").glob("*.py"))]:
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """First writable place for compiled code: RIDETUNE_CACHE, the user's cache, a temporary one."""
    name = f"kernels-{source_hash()}"
    stated = os.environ.get("RIDETUNE_CACHE")
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for parent in [stated, os.path.join(user, "ridetune")]:
        if not parent:
            continue
        folder = Path(parent) / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return Path(tempfile.mkdtemp(prefix=f"ridetune-{name}-"))


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
