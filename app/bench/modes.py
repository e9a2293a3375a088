"""What is simulated: 20 s of the reference car in each mode, once as usual and once converged.

road : Manoeuvre 2, driven from rest
posts : a rig's posts replay the road that each wheel met there
rims : the paper twin's recording of it drives the wheel centres
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ...engine.demand import Demand, PiecewiseLinear, PostMotion
from ...engine.frames import CORNERS
from ...engine.manoeuvre import reference_manoeuvres
from ...engine.measurement import read_run
from ...engine.parameters import PARAMETER_NAMES
from ...engine.simulation.car_rows import car_rows
from ...engine.simulation.integration import free_states, rims_states
from ...engine.simulation.rims import prepare
from ...engine.simulation.rims_settings import RimsSettings
from ...engine.simulation.simulate import FREE_STEP, simulate_road
from ...engine.simulation.stepping import prepare_free
from ...engine.vehicle import Vehicle
from ...engine.vehicle_file import reference_vehicles
from ..package_files import package_folder

Array = NDArray[np.float64]

SAMPLE_STEP = 0.01
"""Between kept states, s: the steps of road and posts mode divide it evenly."""

FINER = 16
"""How many times shorter the steps of a converged run are: its error is 65536 times smaller."""

STAGES = 4
"""Right-hand sides in a step of Runge-Kutta."""

SPREAD = 0.1
"""Greatest deviation of a batch's parameters from the reference car's."""


@dataclass(frozen=True)
class Mode:
    """One mode of the model under one set of inputs.

    name : road, posts or rims
    time (S,) : when states are kept, s;  evaluations : right-hand sides of one car
    states, converged : cars (C, CAR_ROWS) -> states (C, S, 16) at these times
    """

    name: str
    what: str
    time: Array
    evaluations: int
    states: Callable[[Array], Array]
    converged: Callable[[Array], Array]

    @property
    def seconds(self) -> float:
        """Simulated time, s."""
        return float(np.ptp(self.time))

    def error(self, cars: Array) -> float:
        """Error of some cars' states, the greatest of them."""
        pairs = zip(self.states(cars), self.converged(cars), strict=True)
        return max(relative_error(found, reference) for found, reference in pairs)


def relative_error(found: Array, reference: Array) -> float:
    """Greatest over z, pitch and roll of max |difference| / max |reference from its start|.

    found, reference : states (S, 16)
    """
    difference = np.abs(found[:, 1:4] - reference[:, 1:4]).max(axis=0)
    motion = np.abs(reference[:, 1:4] - reference[0, 1:4]).max(axis=0)
    return float(np.max(difference / motion))


@cache
def the_car() -> Vehicle:
    """The paper's car."""
    return reference_vehicles()["paper"]


@cache
def the_demand() -> Demand:
    """What Manoeuvre 2 asks of it."""
    return reference_manoeuvres()["2"].demand(the_car())


def some_cars(count: int) -> Array:
    """So many rows like the reference car's (C, CAR_ROWS), their twelve parameters scattered."""
    rng = np.random.default_rng(0)
    usual = np.array([the_car().value(name) for name in PARAMETER_NAMES])
    scattered = usual * (1.0 + rng.uniform(-SPREAD, SPREAD, (count, usual.size)))
    return car_rows(the_car(), PARAMETER_NAMES, scattered)


def road_mode(demand: Demand | None = None, sample_step: float = SAMPLE_STEP) -> Mode:
    """Manoeuvre 2, or another demand on a road."""
    return _free_mode("road", "Manoeuvre 2", demand or the_demand(), sample_step)


def posts_mode() -> Mode:
    """The posts that replay what the wheels of the reference car meet in Manoeuvre 2."""
    driven = simulate_road(the_car(), reference_manoeuvres()["2"], sample_step=SAMPLE_STEP).run
    heights = np.column_stack([driven[f"road.{corner}.z"] for corner in CORNERS])
    still = PiecewiseLinear.zero(driven.duration)
    posts = PostMotion(driven.time, heights)
    demand = Demand(driven.duration, 0.0, still, still, None, posts)
    return _free_mode("posts", "its road on four posts", demand, SAMPLE_STEP)


def rims_mode() -> Mode:
    """The recording of Manoeuvre 2 that comes along, its samples on the steps."""
    run = read_run(package_folder("sample_runs") / "twin/manoeuvre_2.csv")
    settings = RimsSettings()
    usual = prepare(run, the_car(), settings)
    fine = prepare(run, the_car(), replace(settings, step=settings.step / FINER))
    return Mode(
        "rims",
        "its recording on rims",
        usual.node_time,
        STAGES * (usual.node_time.size - 1),
        lambda cars: rims_states(cars, usual, exact=True).values,
        lambda cars: rims_states(cars, fine, exact=True).values[:, ::FINER],
    )


def _free_mode(name: str, what: str, demand: Demand, sample_step: float) -> Mode:
    usual = prepare_free(demand, FREE_STEP, sample_step)
    fine = prepare_free(demand, FREE_STEP / FINER, sample_step)
    return Mode(
        name,
        what,
        usual.time,
        STAGES * usual.steps.size,
        lambda cars: free_states(cars, usual).values,
        lambda cars: free_states(cars, fine).values,
    )
