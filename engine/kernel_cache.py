"""Where compiled kernels are kept on disk; asked without loading the compiler.

Numba's cache looks only at the file of the function itself and would serve stale code after an
edit of a helper elsewhere; the folder is therefore named by a hash of all kernel sources.
"""

import hashlib
import os
import tempfile
from importlib.metadata import version
from pathlib import Path


def source_hash() -> str:
    """Short hash over the sources that decide what the compiled code does."""
    here = Path(__file__).resolve().parent
    digest = hashlib.sha256(version("numba").encode())
    compiler, constants = here / "jit.py", here / "frames.py"
    for source in [compiler, constants, *sorted((here / "kernels").glob("*.py"))]:
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


def is_compiled() -> bool:
    """Whether the folder holds anything for these sources."""
    return any(cache_folder().rglob("*.nbi"))
