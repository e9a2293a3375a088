"""Compile every kernel by calling each mode; as a program, one of two parts of them.

`python -m ridetune.app.compile PART` fills the cache on disk. The service runs both parts side by
side when the cache is cold, in processes of their own: the compiler takes half a minute and 200 MB
each, which the service would feel.
"""

import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

FIRST_CALL = "Compiling the kernels for this machine; later starts take a second."


def _free() -> None:
    """One car and a batch on the rig and on the road, which share their kernels."""
    import numpy as np

    from ..engine.manoeuvre import reference_manoeuvres
    from ..engine.simulation.car_rows import car_row
    from ..engine.simulation.integration import free_states
    from ..engine.simulation.simulate import FREE_STEP, SAMPLE_STEP, simulate_posts
    from ..engine.simulation.stepping import prepare_free
    from ..engine.vehicle_file import reference_vehicles

    car = reference_vehicles()["paper"]
    shaken = replace(reference_manoeuvres()["heave"], duration=0.5)
    simulate_posts(car, shaken)
    cars = np.stack([car_row(car), car_row(car)])
    free_states(cars, prepare_free(shaken.demand(car), FREE_STEP, SAMPLE_STEP))


def _rims() -> None:
    """One car and a batch on rims that stand still."""
    import numpy as np

    from ..engine.channels import INPUT_CHANNELS
    from ..engine.run import Run
    from ..engine.simulation.car_rows import car_row
    from ..engine.simulation.rims import prepare
    from ..engine.simulation.simulate import rims_batch, simulate_rims
    from ..engine.vehicle_file import reference_vehicles

    car, time = reference_vehicles()["paper"], np.linspace(0.0, 0.5, 101)
    still = Run("still", time, {name: np.zeros(time.size) for name in INPUT_CHANNELS})
    simulate_rims(car, still)
    cars = np.stack([car_row(car), car_row(car)])
    rims_batch(cars, prepare(still, car), "exact")


PARTS: dict[str, Callable[[], None]] = {"free": _free, "rims": _rims}


def start_compilers(environment: Mapping[str, str] | None = None) -> list[subprocess.Popen[bytes]]:
    """One process for each part; environment : this one's unless told."""
    program, silent = [sys.executable, "-m", load_all.__module__], subprocess.DEVNULL
    return [
        subprocess.Popen([*program, part], stdin=silent, stdout=silent, env=environment)
        for part in PARTS
    ]


def load_all() -> None:
    """Load every part, or compile it here if it is not in the cache."""
    for part in PARTS.values():
        part()


@contextmanager
def compiling_told() -> Iterator[None]:
    """Within, the first kernel that is compiled, not read from disk, is told on standard error."""
    from numba.core import event

    class Teller(event.Listener):
        told = False

        def on_start(self, event: object) -> None:
            if not self.told:
                self.told = True
                print(FIRST_CALL, file=sys.stderr, flush=True)

        def on_end(self, event: object) -> None:
            pass

    with event.install_listener("numba:compile", Teller()):
        yield


if __name__ == "__main__":
    PARTS[sys.argv[1]]()
