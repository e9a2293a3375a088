"""Compile the kernels in the background while the page is already served.

The first start on a machine compiles for some tens of seconds, later ones read the result from
disk. Everything but simulating works meanwhile.
"""

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

from .errors import Compiling
from .samples import sample_project

log = logging.getLogger(__name__)

State = Literal["compiling", "ready", "failed"]
Step = tuple[str, Callable[[], object]]


class WarmUp:
    """Runs each step once, in a thread of its own, and says how far it is."""

    def __init__(self, steps: Callable[[], Sequence[Step]]):
        self._steps = steps
        self.state: State = "compiling"
        self.message = "Compiling the simulation; the first start takes up to a minute."
        self._thread = threading.Thread(target=self._run, name="warm-up", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def require(self) -> None:
        """Refuse work that needs the kernels while they are not there."""
        if self.state == "compiling":
            raise Compiling(self.message, retry_after=1)

    def join(self, seconds: float) -> None:
        """Wait for the end."""
        self._thread.join(seconds)

    def _run(self) -> None:
        try:
            steps = self._steps()
            for number, (what, step) in enumerate(steps, start=1):
                self.message = (
                    f"Compiling {what} ({number} of {len(steps)}); "
                    "the first start takes up to a minute."
                )
                step()
        except Exception:
            log.exception("the simulation could not be compiled")
            self.state = "failed"
            self.message = (
                "The simulation could not be compiled; the service's log has the details."
            )
        else:
            self.state, self.message = "ready", "Ready."


def simulation_steps() -> Sequence[Step]:
    """One call of every mode, short, so that each kernel is compiled or loaded."""
    from ..engine.manoeuvre import reference_manoeuvres
    from ..engine.rims import RimsSettings, prepare
    from ..engine.simulation import rims_batch, simulate_posts, simulate_rims, simulate_road
    from ..engine.vehicle_file import reference_vehicles

    car = reference_vehicles()["paper"]
    manoeuvres = reference_manoeuvres()
    rolling = replace(manoeuvres["coast"], duration=0.5)
    shaken = replace(manoeuvres["heave"], duration=0.5)

    def follow_rims() -> None:
        driven = simulate_road(car, rolling).run
        for traction in ("exact", "paper"):
            simulate_rims(car, driven, traction=traction)
        rims_batch([car, car], prepare(driven, car, RimsSettings()), "exact")

    return (
        ("the sample project", sample_project),
        ("the car on the road", lambda: simulate_road(car, rolling)),
        ("the car on the rig", lambda: simulate_posts(car, shaken)),
        ("the car on its rims", follow_rims),
    )
