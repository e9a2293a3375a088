"""The process that simulators are forked from: Python's fork server, with the kernels loaded."""

import os
from multiprocessing import forkserver, get_context
from pathlib import Path

from ...engine.kernel_cache import is_compiled

processes = get_context("forkserver")
processes.set_forkserver_preload(["ridetune.app.work.preload"])


def load_early(data: Path) -> None:
    """Let it load the kernels while this process has other things to load; where they must be
    compiled first, it waits for that.

    data : the data directory, which keeps compiled code where the user has no cache, as a system
        service has not
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    try:
        Path(home, "ridetune").mkdir(parents=True, exist_ok=True)
    except OSError:
        os.environ.setdefault("RIDETUNE_CACHE", str(data / "cache"))
    if is_compiled():
        forkserver.ensure_running()
