"""Make the kernels ready in the background while the page is already served.

The first start on a machine compiles for half a minute, later ones read the result from disk in
about a second. Everything but simulating works meanwhile.
"""

import logging
import subprocess
import threading
from collections.abc import Callable
from typing import Literal

from ...engine.kernel_cache import is_compiled
from ..compile import PARTS, start_compilers
from ..errors import Compiling, Unavailable
from ..simulators.simulators import Simulators
from .samples import read_sample_project, remember

log = logging.getLogger(__name__)

LOADING = "Loading the compiled model; a matter of seconds."

FIRST_START = "Compiling the model; the first start takes half a minute, or somewhat more."

RETRY_AFTER = 30
"""s after which what failed is tried again."""

State = Literal["compiling", "ready", "failed"]


class WarmUp:
    """Does its work in a thread of its own, and says how far it is."""

    def __init__(self, work: "Callable[[WarmUp], object]"):
        self._work = work
        self.state: State = "compiling"
        self.message = LOADING
        self._ended = threading.Event()
        self._closing = threading.Event()
        self._apart: list[subprocess.Popen[bytes]] = []
        self._thread = threading.Thread(target=self._run, name="warm-up", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def tell(self, message: str) -> None:
        """Say what is being done."""
        self.message = message

    def require(self) -> None:
        """Refuse work that needs the kernels while they are not there."""
        if self.state == "compiling":
            raise Compiling(self.message, retry_after=1)
        if self.state == "failed":
            raise Unavailable(self.message, retry_after=RETRY_AFTER)

    def wait(self) -> bool:
        """Wait until it has succeeded or failed; False if the service stops before it."""
        self._ended.wait()
        return not self.closed

    @property
    def closed(self) -> bool:
        """Whether nobody waits for it any more."""
        return self._closing.is_set()

    def close(self) -> None:
        """Stop waiting for it."""
        self._closing.set()
        for compiler in self._apart:
            compiler.kill()
        self._ended.set()

    def compile_apart(self) -> None:
        """Compile in processes of their own, so that this one stays small and quick to answer."""
        self._apart = start_compilers()
        for done, compiler in enumerate(self._apart):
            self.tell(f"{FIRST_START} Done: {done} of {len(PARTS)} parts.")
            compiler.wait()
        self.tell(LOADING)

    def _run(self) -> None:
        """Until it succeeds: what it lacked, memory for one, may be there later."""
        while not self._succeeded():
            self._ended.set()
            if self._closing.wait(RETRY_AFTER):
                return
        self.state, self.message = "ready", "Ready."
        self._ended.set()

    def _succeeded(self) -> bool:
        try:
            self._work(self)
        except Exception:
            if not self.closed:  # what the service's end overtakes has not failed
                log.exception("the simulation could not be made ready")
            self.state = "failed"
            self.message = (
                "The simulation could not be made ready, which is tried again every "
                f"{RETRY_AFTER:g} s; the service's log has the details."
            )
            return False
        return True


def ready_to_simulate(warmup: WarmUp, simulators: Simulators) -> None:
    """The service's own warm-up: the simulators, and from one of them the sample project, which
    the service would have to load scipy for.
    """
    if not is_compiled():
        warmup.compile_apart()
    if not warmup.closed:
        simulators.start()
        remember(simulators.run("", read_sample_project))
