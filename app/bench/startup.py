"""Rows on what one waits for before anything moves, each in a fresh process, by the clock."""

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from urllib.request import HTTPCookieProcessor, build_opener

from .. import compile
from .cases import Case
from .row import Row
from .timing import Timing
from .workbench import Workbench

APP = compile.__name__.removesuffix(".compile")

SERVE = f"from {APP}.cli import main; main()"
SIMULATE = f"from {compile.__name__} import PARTS; PARTS['free']()"

PATIENCE = 300.0
"""Longest wait for a process or an answer, s."""


def importing(bench: Workbench) -> Row:
    """Import of the service."""
    timing = _repeated(bench, lambda: _python("-c", f"import {APP}.main"))
    return Row("import of the service", timing)


def cold(_: Workbench) -> Row:
    """Every kernel, compiled into a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        compilers = compile.start_compilers(bare_environment() | {"RIDETUNE_CACHE": folder})
        for compiler in compilers:
            compiler.wait(PATIENCE)
        seconds = time.perf_counter() - began
    return Row("first start: every kernel compiled (once)", Timing((seconds,)))


def warm(bench: Workbench) -> Row:
    """A fresh process until its first simulation is done, kernels read from disk."""
    timing = _repeated(bench, lambda: _python("-c", SIMULATE))
    return Row("later start until a first simulation is done", timing)


def page(bench: Workbench) -> Row:
    """A fresh service until it has answered GET /."""
    return Row("service until GET / is answered", _repeated(bench, _until_answered))


def _repeated(bench: Workbench, once: Callable[[], float]) -> Timing:
    """What takes its own time, after one go that does not count."""
    once()
    return Timing(tuple(once() for _ in range(bench.pace.fewest)))


def _python(*arguments: str) -> float:
    """Seconds of a Python process from its start to its end."""
    began = time.perf_counter()
    subprocess.run(
        [sys.executable, *arguments],
        env=bare_environment(),
        stdout=subprocess.DEVNULL,
        timeout=PATIENCE,
        check=True,
    )
    return time.perf_counter() - began


def bare_environment() -> dict[str, str]:
    """This process's, without what the service is told by it."""
    told = {name for name in os.environ if name.startswith("RIDETUNE_")} - {"RIDETUNE_CACHE"}
    return {name: value for name, value in os.environ.items() if name not in told}


def _until_answered() -> float:
    """Seconds of a service with a data folder of its own until the page is there."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-u", "-c", SERVE, "serve", "--no-login"]
        command += ["--port", "0", "--data", folder]
        began = time.perf_counter()
        with subprocess.Popen(
            command, env=bare_environment(), stdout=subprocess.PIPE, text=True
        ) as service:
            try:
                assert service.stdout is not None
                [address] = re.findall(r"http://[\d.:]+/", service.stdout.readline())
                browser = build_opener(HTTPCookieProcessor())  # the page belongs to a session
                with browser.open(address, timeout=PATIENCE) as answer:
                    answer.read()
                return time.perf_counter() - began
            finally:
                service.terminate()
                service.wait()


STARTS: Mapping[str, Case] = {
    "start-import": importing,
    "start-cold": cold,
    "start-warm": warm,
    "start-page": page,
}
"""Rows by name, in the order of the table."""
