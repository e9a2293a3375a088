"""Compile every kernel by calling each mode once; as a program, in a process of its own.

`python -m ridetune.app.compile` fills the cache on disk and says what it is at. The service runs it
so when the cache is cold: the compiler takes a minute and 200 MB, which the service would feel.
"""

from collections.abc import Callable
from dataclasses import replace

STEPS = ("the car on the road", "the car on the rig", "the car on its rims")


def steps() -> dict[str, Callable[[], object]]:
    """One short call of every mode, by name; compiles, or loads what has been compiled."""
    from ..engine.manoeuvre import reference_manoeuvres
    from ..engine.rims import prepare
    from ..engine.simulation import rims_batch, simulate_posts, simulate_rims, simulate_road
    from ..engine.vehicle_file import reference_vehicles

    car = reference_vehicles()["paper"]
    rolling = replace(reference_manoeuvres()["coast"], duration=0.5)
    shaken = replace(reference_manoeuvres()["heave"], duration=0.5)

    def on_its_rims() -> None:
        driven = simulate_road(car, rolling).run
        simulate_rims(car, driven, traction="exact")
        simulate_rims(car, driven, traction="paper")
        rims_batch([car, car], prepare(driven, car), "exact")

    road, rig, rims = STEPS
    return {
        road: lambda: simulate_road(car, rolling),
        rig: lambda: simulate_posts(car, shaken),
        rims: on_its_rims,
    }


def compile_all(tell: Callable[[str], None]) -> None:
    """Take every step, saying which before each."""
    for number, (what, step) in enumerate(steps().items(), start=1):
        tell(f"Compiling {what} ({number} of {len(STEPS)}); the first start takes a minute or two.")
        step()


def is_compiled() -> bool:
    """Whether the cache on disk holds anything for these sources."""
    from ..engine.jit import cache_folder

    return any(cache_folder().rglob("*.nbi"))


if __name__ == "__main__":
    compile_all(lambda message: print(message, flush=True))
